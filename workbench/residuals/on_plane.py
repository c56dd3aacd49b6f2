"""Points that should lie in a plane, such as feet on the ground."""

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.blocks import Points
from workbench.blocks.checks import reals
from workbench.errors import BadResidual
from workbench.residuals.arguments import expressed, named
from workbench.residuals.kernels import Kernel, quadratic
from workbench.residuals.residual import Residual


def on_plane(
    points: Points | cs.MX,
    *,
    sigma: float,
    normal: ArrayLike = (0.0, 1.0, 0.0),
    offset: cs.MX | float = 0.0,
    some: tuple[str, ...] | None = None,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Residual:
    """n.p_k - d, how far each point (3, M) m lies above the plane n.x = d, in metres.

    The plane is the floor unless `normal` (of any length) says otherwise; `offset` is d in metres,
    a number or the symbol of a block, for a floor whose height is unknown. `some` are the labels
    of the points that count, such as `("left_heel", "left_big_toe")`. A robust kernel lets a foot
    leave the ground. Raises BadResidual for a normal without length and for unknown labels.
    """
    where, reads = expressed(points)
    name = name or named("on_plane", where)
    n = reals(f"residual {name!r}: the normal", normal)
    length = float(np.linalg.norm(n)) if n.shape == (3,) else 0.0
    if not 0 < length < np.inf:
        raise BadResidual(
            f"residual {name!r} needs a normal of three finite numbers, not {normal!r}"
        )
    labels = points.labels if isinstance(points, Points) else None
    if some is not None:
        unknown = [label for label in some if label not in (labels or ())]
        if unknown or not some:
            raise BadResidual(
                f"residual {name!r} is about the points {', '.join(some) or '(none)'}, but the "
                f"points are called {', '.join(labels or ())}"
            )
        assert labels is not None
        where = where[:, [labels.index(label) for label in some]]
        labels = tuple(some)
    above = cs.vec(cs.DM(n / length).T @ where) - offset
    return Residual(name, above, sigma, "m", kernel, reads, labels)
