"""How far a point is from stationary, without units: one measure for all solvers."""

from math import sqrt

import numpy as np

from workbench.arrays import Array
from workbench.problem.least_distance import Limits, nearest
from workbench.problem.linearization import Linearization
from workbench.problem.rounding import Rounding, Support

Box = tuple[Array, Array]
HARMLESS = 1e-3  # of a sigma: rounding that does no harm
IMMATERIAL = 1e-6  # of an unknown's own size: the same


def optimality(
    x: Array,
    here: Linearization,
    support: Support,
    box: Box | None = None,
    rounding: Rounding | None = None,
) -> float:
    """How far x (n,) is from stationary: 0 at a stationary point, and at most 1 unless constrained.

    It is the largest |d_i| / s_i, less what rounding explains, and NaN where the linearization is
    not finite. d_i = -g_i / |J_i| is the negative gradient in the variables y_i = |J_i| x_i, whose
    steps have the units of the residual. s_i is the length of the residual in the rows that x_i can
    change, so that d_i / s_i is the cosine between a column of the Jacobian and the residual in
    these rows, whatever the residual is in others. But s_i is at least one sigma, if all rows
    together are longer than that.

    With bounds (a box, lower and upper) and constraints, d is the projection of that vector on the
    steps that the bounds and the linearized constraints allow; a violated constraint makes d
    nonzero. So d = 0 means that the conditions of Karush, Kuhn and Tucker hold (Nocedal and Wright,
    Numerical Optimization, 2006, theorem 12.1).
    """
    if not here.finite:
        return np.nan
    norms, r = here.column_norms, here.residual
    if not support.all_change:
        r = np.where(support.changing, r, 0.0)
    if here.constraints is None:
        scale = _or_one(norms)  # the gradient is zero where the column is
        d = -here.gradient / scale
        if box is not None:
            lower, upper = box
            d = np.clip(d, (lower - x) * scale, (upper - x) * scale)
    else:  # an unknown that changes no residual may still serve a constraint
        lower, upper = box or (np.full_like(x, -np.inf), np.full_like(x, np.inf))
        scale = np.where(norms > 0, norms, norms.max(initial=0.0) or 1.0)
        A = here.constraints.per(scale)
        box = (lower - x) * scale, (upper - x) * scale
        d = nearest(-here.gradient / scale, Limits(*box, A, *here.constraints.allowed_changes))
    way = np.abs(d)
    if rounding is not None:
        way = np.maximum(way - explained_by_rounding(x, here, support, rounding), 0.0)
    sizes = np.maximum(support.norms(r), min(sqrt(r @ r), 1.0))
    lengths = _or_one(sizes)
    if lengths is not sizes and ((way > 0) & (sizes == 0)).any():
        return np.inf  # a constraint is violated, and there is no residual
    return float((way / lengths).max(initial=0.0))


def explained_by_rounding(
    x: Array, here: Linearization, support: Support, rounding: Rounding
) -> Array:
    """The part of each d_i, (n,), that rounding errors of the rows that x_i can change may explain.

    It explains nothing where rounding hides an unknown (see `hidden`): there it is the reason why
    no better point is found, which does not mean that this is the minimum. The same holds for
    unknowns that change the same rows as a hidden one.
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

    It is harmless up to a thousandth of a sigma, or a millionth of x_i itself.
    """
    error, norms = _errors(here, support, rounding), here.column_norms
    harmless = (error <= HARMLESS) | (error <= IMMATERIAL * norms * np.abs(x)) | (norms == 0)
    return np.where(harmless, 0.0, error / np.where(norms > 0, norms, 1.0))


def _or_one(lengths: Array) -> Array:
    """The lengths with 1 in place of 0; the array itself if none is 0."""
    return lengths if lengths.min(initial=1.0) > 0 else np.where(lengths > 0, lengths, 1.0)


def _errors(here: Linearization, support: Support, rounding: Rounding) -> Array:
    if here.constraints is not None:  # they carry the error of one number to another
        return np.full(len(here.column_norms), rounding.norm)
    return support.norms(rounding.rows)
