"""Points against their mirror image: a body whose left side should be its right side, reflected."""

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.blocks import Points
from workbench.errors import BadResidual
from workbench.geometry.mirror import REFLECTION
from workbench.residuals.arguments import expressed, named_after, numbered
from workbench.residuals.residual import Residual


def mirrored(
    points: Points | cs.MX, opposite: ArrayLike, *, sigma: float, name: str | None = None
) -> Residual:
    """p_i - U(p)_i in metres: E_Y, the symmetry of a template or of its joints (SMPL, section 4.1).

    U exchanges the sides: U(p)_i = (-x, y, z) of p_opposite[i]. `points` are the symbol of a block
    (N, 3), or points of a body; `opposite` (N,) has for each point the number of the point on the
    other side, and for a point in the middle its own number. Each pair is in the residual twice,
    once from each side, as in the source. A motion along y or z, and a rotation about x, change
    nothing.

    Raises BadResidual unless the other side of the other side is the point itself.
    """
    placed, reads = expressed(points)
    name = name or named_after("mirrored", points.symbol if reads else points, points)
    N = placed.shape[1]
    partner = numbered(name, "opposite (N", np.reshape(opposite, (-1, 1)), 1, N).ravel()
    if len(partner) != N or (partner[partner] != np.arange(N)).any():
        raise BadResidual(
            f"residual {name!r} needs for each of {N} points the number of its opposite, so that "
            f"the opposite of the opposite is the point itself; {len(partner)} numbers were given, "
            "and for them this is not so"
        )
    image = cs.diag(cs.MX(cs.DM(REFLECTION))) @ placed[:, partner.tolist()]
    return Residual(name, cs.vec(placed - image), sigma, "m", points=reads, rows_per_point=3)
