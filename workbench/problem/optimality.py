"""How far a point is from stationary, free of units: one measure for every solver."""

import numpy as np

from workbench.arrays import Array
from workbench.problem.least_distance import Limits, nearest
from workbench.problem.linearization import Linearization
from workbench.problem.rounding import Rounding, Support

Box = tuple[Array, Array]
IMMATERIAL = 1e-6  # of a sigma, or of an unknown's own size: rounding that harms nobody


def optimality(
    x: Array,
    here: Linearization,
    support: Support,
    box: Box | None = None,
    rounding: Rounding | None = None,
) -> float:
    """0 at a stationary point; without constraints at most 1; NaN where there are no numbers.

    The largest |d_i| / s_i, less what rounding explains. d is the way that the gradient pulls,
    -g_i / |J_i|, in variables y_i = |J_i| x_i, whose steps have the units of the residual. s_i is
    the length of the residual in the rows that x_i can change, so that d_i / s_i is the cosine
    between the residual and a column of the Jacobian, whatever stands in rows that have nothing
    to do with x_i; but s_i is not below one sigma where all rows together are above it.

    With bounds (a box, lower and upper) and constraints d is that pull's projection on what they
    allow, to first order: where the bounds or the linearized constraints stop it, it is stopped,
    and a constraint that is missed moves it. So d = 0 says that Karush, Kuhn and Tucker's
    conditions hold.
    """
    if not here.finite:
        return np.nan
    norms, r = here.column_norms, np.where(support.changing, here.residual, 0.0)
    if here.constraints is None:
        scale = np.where(norms > 0, norms, 1.0)  # nothing pulls at what no residual notices
        d = -here.gradient / scale
        if box is not None:
            lower, upper = box
            d = np.clip(d, (lower - x) * scale, (upper - x) * scale)
    else:  # what no residual notices costs nothing to move, but is measured all the same
        lower, upper = box or (np.full_like(x, -np.inf), np.full_like(x, np.inf))
        scale = np.where(norms > 0, norms, norms.max(initial=0.0) or 1.0)
        A = here.constraints.per(scale)
        box = (lower - x) * scale, (upper - x) * scale
        d = nearest(-here.gradient / scale, Limits(*box, A, *here.constraints.allowed_changes))
    way = np.abs(d)
    if rounding is not None:
        way = np.maximum(way - explained_by_rounding(x, here, support, rounding), 0.0)
    sizes = np.maximum(support.norms(r), min(float(np.linalg.norm(r)), 1.0))
    missed = (way > 0) & (sizes == 0)  # a constraint, where there is no residual
    return (
        np.inf if missed.any() else float((way / np.where(sizes > 0, sizes, 1.0)).max(initial=0.0))
    )


def explained_by_rounding(
    x: Array, here: Linearization, support: Support, rounding: Rounding
) -> Array:
    """How much of each d_i, (n,), rounding errors of the rows that x_i can change may explain.

    Nothing where rounding hides an unknown: see `hidden`. There it explains why no better point
    is seen, and is no reason to say that the minimum was found. The same holds for the unknowns
    that change the same rows: what they do not take, the hidden one does.
    """
    error = _errors(here, support, rounding)
    harmful = hidden(x, here, support, rounding) > 0
    if not harmful.any():
        return error
    if here.constraints is not None:
        return np.zeros_like(error)
    return np.where(support.norms(support.rows(harmful).astype(float)) > 0, 0.0, error)


def hidden(x: Array, here: Linearization, support: Support, rounding: Rounding) -> Array:
    """By how much rounding leaves each x_i undetermined, (n,), in its unit; 0 if harmless.

    It is harmless up to a millionth of a sigma, or of x_i itself.
    """
    error, norms = _errors(here, support, rounding), here.column_norms
    harmless = (error <= IMMATERIAL) | (error <= IMMATERIAL * norms * np.abs(x)) | (norms == 0)
    return np.where(harmless, 0.0, error / np.where(norms > 0, norms, 1.0))


def _errors(here: Linearization, support: Support, rounding: Rounding) -> Array:
    if here.constraints is not None:  # they carry the error of one number to another
        return np.full(len(here.column_norms), rounding.norm)
    return support.norms(rounding.rows)
