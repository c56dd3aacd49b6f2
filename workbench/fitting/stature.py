"""How tall a person is: a linear function of the shape, and a measurement of it."""

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Block
from workbench.bodies import SkinnedBody
from workbench.bodies.body import why_not_skinned
from workbench.errors import BadArgument
from workbench.residuals import Residual

SHORTEST, TALLEST = 0.4, 2.8  # m
MEASURED = 0.01  # m, the usual standard deviation of a stature that was measured


def stature(body: SkinnedBody, betas: ArrayLike) -> Array:
    """The height (...,) m of bodies with betas (..., B), from the lowest to the highest vertex.

    These are the vertices that are lowest and highest on the mean person, at rest; so stature is
    linear in betas. A person whose crown or sole is another vertex differs by millimetres.
    """
    mean, slopes = _linear(body)
    return np.asarray(mean + np.asarray(betas, dtype=float) @ slopes)


def stature_expression(body: SkinnedBody, betas: cs.MX) -> cs.MX:
    """`stature` in symbols, of betas (B, 1)."""
    mean, slopes = _linear(body)
    return mean + cs.dot(cs.DM(slopes), betas)


def stature_prior(
    body: SkinnedBody, height: float, *, sigma: float = MEASURED, name: str = "stature"
) -> Residual:
    """The residual of a measured height in metres, `sigma` its standard deviation.

    One image shows how large a person appears, and not how large or how far away; with a known
    stature, it shows the distance too. Raises BadArgument for a height of no person.
    """
    checked_height(height)
    betas: Block = body.blocks()[1]
    off = stature_expression(body, betas.symbol) - height
    return Residual(name, off, sigma, "m", blocks=(betas,))


def checked_height(height: float) -> None:
    """Raise BadArgument for a height in metres of no person."""
    if not SHORTEST <= height <= TALLEST:
        hint = "; it is given in metres" if SHORTEST <= height / 100 <= TALLEST else ""
        raise BadArgument(
            f"a stature is between {SHORTEST:g} and {TALLEST:g} m, not {height:g}{hint}"
        )


def _linear(body: SkinnedBody) -> tuple[float, Array]:
    """The stature of the mean person in m, and what each of the betas adds to it, (B,)."""
    if reason := why_not_skinned(body, "a stature", "measure its vertices"):
        raise BadArgument(reason)
    y, slopes = body.template[:, 1], body.shapedirs[:, 1]
    top, bottom = int(np.argmax(y)), int(np.argmin(y))
    return float(y[top] - y[bottom]), np.asarray(slopes[top] - slopes[bottom])
