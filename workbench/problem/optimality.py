"""How far a point is from stationary, also within linear limits."""

from collections.abc import Iterator
from itertools import pairwise
from math import sqrt
from typing import NamedTuple

import numpy as np
import scipy.optimize
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components

from workbench.arrays import Array
from workbench.problem import storage
from workbench.problem.linearization import Linearization
from workbench.problem.rounding import Rounding, RowSupport
from workbench.problem.storage import Stored, absolute, dense, row_norms

Index = NDArray[np.signedinteger]
ROUNDING = 1e-12  # of the sum of a row's absolute terms: a smaller violation is none


class LinearLimits(NamedTuple):
    """left <= d <= right and down <= A d <= up.

    Attributes:
        left: (n,) lower bounds.
        right: (n,) upper bounds.
        A: (k, n) the gradients of the linear limits.
        down: (k,) their lower limits.
        up: (k,) their upper limits.
    """

    left: Array
    right: Array
    A: Stored
    down: Array
    up: Array


def projected(target: Array, limits: LinearLimits) -> Array:
    """The d (n,) nearest to the target that meets all limits; infinite where none does.

    Small problems are solved at once, large ones part by part.
    """
    k, n = limits.A.shape
    lengths = row_norms(limits.A)
    flat = lengths == 0
    if (flat & ((limits.down > 0) | (limits.up < 0))).any():
        return np.full_like(target, np.inf)
    lengths = np.where(flat, 1.0, lengths)
    down, up = limits.down / lengths, limits.up / lengths
    if n * (n + k) <= storage.DENSE_FROM:
        rows = dense(limits.A) / lengths[:, None]
        return projected_dense(target, LinearLimits(limits.left, limits.right, rows, down, up))
    A = csc_array(diags_array(1 / lengths) @ csc_array(limits.A))
    return projected_sparse(target, LinearLimits(limits.left, limits.right, A, down, up))


def projected_dense(target: Array, limits: LinearLimits) -> Array:
    """`projected` for an array A whose rows have length 1, by nonnegative least squares.

    These give the multipliers (Lawson and Hanson, Solving least squares problems, 1974, chapter
    23). Infinite where no d meets the limits.
    """
    left, right, A, down, up = limits
    bounded = np.isfinite(left) | np.isfinite(right)
    rows = np.concatenate([np.eye(len(target))[bounded], dense(A)])
    lows, highs = np.concatenate([left[bounded], down]), np.concatenate([right[bounded], up])
    # G z >= h for z = d - target, in units of the farthest that d may have to go
    reach = float(np.linalg.norm(target)) + float(
        np.max(np.concatenate([lows, -highs, [0.0]]), initial=0.0)
    )
    if reach == 0:
        return np.zeros_like(target)
    at = rows @ target
    G = np.concatenate([rows, -rows])
    h = np.concatenate([lows - at, at - highs]) / reach
    near = h > -4.0 * np.sqrt(len(target))  # a limit farther away than any d stops nothing
    G, h = G[near], h[near]
    if (h <= 0).all():
        return target
    E = np.concatenate([G.T, h[None]])
    u, distance = scipy.optimize.nnls(E, np.append(np.zeros(len(target)), 1.0))
    if distance < 1e-10:
        return np.full_like(target, np.inf)
    active = u > 0
    z = np.linalg.lstsq(G[active], h[active], rcond=None)[0]  # the same, to all digits
    return np.asarray(target + reach * z)


def projected_sparse(target: Array, limits: LinearLimits) -> Array:
    """`projected` for many unknowns and a sparse A whose rows have length 1.

    First d is the target, clipped to the bounds. Then the rows that it violates are imposed, the
    problem is solved again, and so on, until no row is violated. This ends, because each row is
    imposed at most once. The last d is the answer: if the nearest point under some of the limits
    meets the others, it is the nearest point under all of them. Rows that share no unknown are
    solved separately, and unknowns that no imposed row reads keep their target. A single part with
    thousands of imposed rows takes long, because it is solved by arrays.
    """
    left, right, A, down, up = limits
    by_rows, sizes = csr_array(A), absolute(A)
    d = np.clip(target, left, right)
    imposed = np.zeros(A.shape[0], dtype=bool)
    while True:
        at, room = by_rows @ d, ROUNDING * (sizes @ (abs(d) + abs(target)))
        violated = ((at < down - room) | (at > up + room)) & ~imposed
        if not violated.any():
            return np.asarray(d)
        imposed |= violated
        for part in _parts(by_rows, np.flatnonzero(imposed)):
            if not violated[part.rows].any():
                continue  # it was solved before
            rows, columns = part.rows, part.columns
            box = left[columns], right[columns]
            found = _one(target[columns], LinearLimits(*box, part.entries(), down[rows], up[rows]))
            if not np.isfinite(found).all():
                return np.full_like(target, np.inf)
            d[columns] = found


def _one(target: Array, limits: LinearLimits) -> Array:
    """The answer for one part; without bounds, a single row is met by moving along it."""
    left, right, A, down, up = limits
    if len(down) > 1 or np.isfinite(left).any() or np.isfinite(right).any():
        return projected_dense(target, limits)
    row = dense(A)[0]
    at = float(row @ target)
    return np.asarray(target + row * (min(max(at, down[0]), up[0]) - at))


class _Part(NamedTuple):
    """Some rows, the columns that they read, and their entries, row by row.

    Attributes:
        rows: the numbers of the rows.
        columns: the numbers of the columns that the rows read.
        data: the entries, row by row.
        at_row: the row of each entry, counted among `rows`.
        at_column: the column of each entry, counted among `columns`.
    """

    rows: Index
    columns: Index
    data: Array
    at_row: Index
    at_column: Index

    def entries(self) -> Array:
        """The entries as an array (rows, columns)."""
        found = np.zeros((len(self.rows), len(self.columns)))
        found[self.at_row, self.at_column] = self.data
        return found


def _parts(A: csr_array, chosen: Index) -> Iterator[_Part]:
    """The chosen rows in groups that share no column."""
    some, k = csr_array(A[chosen]), len(chosen)
    some.eliminate_zeros()  # which would tie rows together
    of_row = np.repeat(np.arange(k), np.diff(some.indptr))
    meets = csr_array((np.ones(some.nnz), (of_row, k + some.indices)), shape=(k + A.shape[1],) * 2)
    _, group = connected_components(meets, directed=False)
    order = np.argsort(group[:k], kind="stable")
    edges = [0, *(np.flatnonzero(np.diff(group[:k][order])) + 1).tolist(), k]
    some = csr_array(some[order])  # the rows of a group stand together now
    of_row = np.repeat(np.arange(k), np.diff(some.indptr))
    for first, last in pairwise(edges):
        stored = slice(int(some.indptr[first]), int(some.indptr[last]))
        columns, places = np.unique(some.indices[stored], return_inverse=True)
        yield _Part(
            chosen[order[first:last]], columns, some.data[stored], of_row[stored] - first, places
        )


Box = tuple[Array, Array]
HARMLESS = 1e-3  # of a sigma: rounding that does no harm
IMMATERIAL = 1e-6  # of an unknown's own size: the same


def optimality(
    x: Array,
    here: Linearization,
    support: RowSupport,
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
        d = projected(
            -here.gradient / scale, LinearLimits(*box, A, *here.constraints.allowed_changes)
        )
    way = np.abs(d)
    if rounding is not None:
        way = np.maximum(way - rounding_part(x, here, support, rounding), 0.0)
    sizes = np.maximum(support.norms(r), min(sqrt(r @ r), 1.0))
    lengths = _or_one(sizes)
    if lengths is not sizes and ((way > 0) & (sizes == 0)).any():
        return np.inf  # a constraint is violated, and there is no residual
    return float((way / lengths).max(initial=0.0))


def rounding_part(x: Array, here: Linearization, support: RowSupport, rounding: Rounding) -> Array:
    """The part of each d_i, (n,), that rounding errors of the rows that x_i can change may explain.

    It explains nothing where an unknown is `undetermined_by_rounding`: there rounding is the reason
    why no better point is found, which does not mean that this is the minimum. The same holds for
    unknowns that change the same rows as a hidden one.
    """
    error = _errors(here, support, rounding)
    harmful = undetermined_by_rounding(x, here, support, rounding) > 0
    if not harmful.any():
        return error
    if here.constraints is not None:
        return np.zeros_like(error)
    return np.where(support.norms(support.rows(harmful).astype(float)) > 0, 0.0, error)


def undetermined_by_rounding(
    x: Array, here: Linearization, support: RowSupport, rounding: Rounding
) -> Array:
    """By how much rounding leaves each x_i undetermined, (n,), in its unit; 0 if harmless.

    It is harmless up to a thousandth of a sigma, or a millionth of x_i itself.
    """
    error, norms = _errors(here, support, rounding), here.column_norms
    harmless = (error <= HARMLESS) | (error <= IMMATERIAL * norms * np.abs(x)) | (norms == 0)
    return np.where(harmless, 0.0, error / np.where(norms > 0, norms, 1.0))


def _or_one(lengths: Array) -> Array:
    """The lengths with 1 in place of 0; the array itself if none is 0."""
    return lengths if lengths.min(initial=1.0) > 0 else np.where(lengths > 0, lengths, 1.0)


def _errors(here: Linearization, support: RowSupport, rounding: Rounding) -> Array:
    if here.constraints is not None:  # they carry the error of one number to another
        return np.full(len(here.column_norms), rounding.norm)
    return support.norms(rounding.rows)
