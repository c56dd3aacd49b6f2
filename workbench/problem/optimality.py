"""How far a point is from stationary, also within linear limits, and what rounding hides of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import isfinite, sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.optimize
from scipy.sparse import csc_array, csr_array, diags_array

from workbench.arrays import Array, Index, Mask
from workbench.problem import storage
from workbench.problem.sparsity import SparseSum, tied_columns
from workbench.problem.storage import Stored, absolute, dense, row_norms

if TYPE_CHECKING:
    from workbench.problem.linearization import Linearization

ROUNDING_FACTOR = 10.0  # of eps: a row is the end of a chain of operations, not of one


@dataclass(frozen=True, eq=False)
class Rounding:
    """The rounding error that each of the `rows` (m,) of a residual may carry, in its sigma."""

    rows: Array

    @cached_property
    def norm(self) -> float:
        """The length of the vector of all rows' rounding errors."""
        return float(np.linalg.norm(self.rows))

    def of_cost(self, residual: Array) -> float:
        """How far rounding may have changed 1/2 |r|^2: |r|' e + 1/2 |e|^2, e the rows' errors."""
        return float(np.abs(residual) @ self.rows) + 0.5 * self.norm**2

    def of_decrease(self, residual: Array, moved: Mask) -> float:
        """How far rounding may have changed a difference of costs by the rows that `moved` (m,)."""
        return Rounding(self.rows[moved]).of_cost(residual[moved])


def half_squared(r: Array) -> float:
    """1/2 |r|^2 of a residual (m,); infinite, without a warning, where it is too large."""
    return 0.5 * float(np.vdot(r, r))


def all_finite(r: Array) -> bool:
    """Whether all numbers of a vector are finite, which the sum of their squares tells sooner."""
    return isfinite(half_squared(r)) or bool(np.isfinite(r).all())


def decrease(residual: Array, to: Array) -> float:
    """1/2 |r|^2 - 1/2 |s|^2 of two residuals (m,), as 1/2 (r - s)'(r + s).

    Large rows that do not change cancel exactly. In the difference of two costs they would take
    digits.
    """
    return 0.5 * float((residual - to) @ (residual + to))


class RowSupport:
    """Which rows of the residual each free number can change, by the structure of the graph.

    `kinds_of` (n, k) marks what each number moves, such as the points of a body, `rows_of` (k, m)
    the rows that read it, and `own` (n, m) single rows. Numbers of the same kinds share a group of
    rows, so that those of a mesh are stored once.
    """

    def __init__(self, kinds_of: csr_array, rows_of: csr_array, own: csr_array) -> None:
        kinds_of.sort_indices()
        numbers: dict[bytes, int] = {}  # of groups, by their kinds
        keys = (kinds_of.indices[a:b].tobytes() for a, b in pairwise(kinds_of.indptr))
        self._group_of = np.array([numbers.setdefault(key, len(numbers)) for key in keys], int)
        _, first = np.unique(self._group_of, return_index=True)
        self._groups = csr_array(kinds_of[first] @ rows_of)
        self._groups.data[:] = 1.0
        groups, single = self._groups.tocoo(), own.tocoo()
        in_groups = np.ravel_multi_index((groups.row, groups.col), groups.shape)
        own_places = np.ravel_multi_index((self._group_of[single.row], single.col), groups.shape)
        outside = ~np.isin(own_places, in_groups)  # so that nothing counts twice
        own_entries = single.row[outside], single.col[outside]
        self._own = csr_array((np.ones(len(own_entries[0])), own_entries), shape=own.shape)

    @staticmethod
    def of_frames(
        parts: Sequence[tuple["RowSupport", Index, Index]], shape: tuple[int, int]
    ) -> "RowSupport":
        """The support (n, m) of several groups of similar frames.

        `parts` has for each group the support of one frame, and the rows (F, m) and the free
        numbers (F, n) of its F frames.
        """
        kinds_of, rows_of, own, count = [], [], [], 0
        for support, rows, columns in parts:
            groups, single = support._groups.tocoo(), support._own.tocoo()
            kinds = count + groups.shape[0] * np.arange(len(rows))[:, None]
            count += groups.shape[0] * len(rows)
            kinds_of.append((columns, kinds + support._group_of))
            rows_of.append((kinds + groups.row, rows[:, groups.col]))
            own.append((columns[:, single.row], rows[:, single.col]))
        n, m = shape
        return RowSupport(
            csr_array(SparseSum(kinds_of, (n, count)).pattern),
            csr_array(SparseSum(rows_of, (count, m)).pattern),
            csr_array(SparseSum(own, shape).pattern),
        )

    def norms(self, rows: Array) -> Array:
        """|v| over the rows that each free number can change: (n,) for v (m,)."""
        squares = rows**2
        return np.asarray(np.sqrt((self._groups @ squares)[self._group_of] + self._own @ squares))

    def rows(self, numbers: Mask) -> Mask:
        """The rows (m,) that some of the free numbers (n,) can change."""
        chosen = np.zeros(self._groups.shape[0])
        chosen[self._group_of[numbers]] = 1.0
        return np.asarray(chosen @ self._groups + numbers @ self._own) > 0

    @cached_property
    def read(self) -> Mask:
        """Which free numbers can change any row at all, (n,)."""
        return self.norms(np.ones(self._groups.shape[1])) > 0

    @cached_property
    def changing(self) -> Mask:
        """The rows that any free number can change, (m,)."""
        return self.rows(np.ones(len(self._group_of), dtype=bool))


ROUNDING_OF_ROWS = 1e-12  # of the sum of a row's absolute terms: a smaller violation is none


class LinearLimits(NamedTuple):
    """left <= d <= right, (n,), and down <= A d <= up, (k,); A (k, n)."""

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
    is_zero = lengths == 0
    if (is_zero & ((limits.down > 0) | (limits.up < 0))).any():
        return np.full_like(target, np.inf)
    lengths = np.where(is_zero, 1.0, lengths)
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
    at_target = rows @ target
    G = np.concatenate([rows, -rows])
    h = np.concatenate([lows - at_target, at_target - highs]) / reach
    in_reach = h > -4.0 * np.sqrt(len(target))  # a limit farther away than any d stops nothing
    G, h = G[in_reach], h[in_reach]
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
    problem is solved again, and so on, until no row is violated: if the nearest point under some of
    the limits meets the others, it is the nearest point under all of them. Rows that share no
    unknown are solved separately, by arrays, and unknowns that no imposed row reads keep their
    target.
    """
    left, right, A, down, up = limits
    by_rows, sizes = csr_array(A), absolute(A)
    d = np.clip(target, left, right)
    imposed = np.zeros(A.shape[0], dtype=bool)
    while True:
        values, tolerance = by_rows @ d, ROUNDING_OF_ROWS * (sizes @ (abs(d) + abs(target)))
        violated = ((values < down - tolerance) | (values > up + tolerance)) & ~imposed
        if not violated.any():
            return np.asarray(d)
        imposed |= violated
        chosen = np.flatnonzero(imposed)
        imposed_rows = csc_array(by_rows[chosen])
        imposed_rows.eliminate_zeros()  # which would tie rows together
        read = np.flatnonzero(np.diff(imposed_rows.indptr))
        imposed_rows = csc_array(imposed_rows[:, read])
        for columns in tied_columns(imposed_rows.tocoo()):
            block, unknowns = csc_array(imposed_rows[:, columns]), read[columns]
            rows = np.unique(block.indices)
            if not violated[chosen[rows]].any():
                continue  # it was solved before
            entries, at_rows = block.toarray()[rows], chosen[rows]
            bounds = left[unknowns], right[unknowns]
            nearest = projected_dense(
                target[unknowns], LinearLimits(*bounds, entries, down[at_rows], up[at_rows])
            )
            if not np.isfinite(nearest).all():
                return np.full_like(target, np.inf)
            d[unknowns] = nearest


Box = tuple[Array, Array]
HARMLESS_ERROR = 1e-3  # of a sigma: rounding errors up to here do no harm
HARMLESS_SHARE = 1e-6  # of an unknown's own size: the same


def optimality(
    x: Array,
    here: "Linearization",
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
    if not support.changing.all():
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
    components = np.abs(d)
    if rounding is not None:
        components = np.maximum(components - rounding_part(x, here, support, rounding), 0.0)
    sizes = np.maximum(support.norms(r), min(sqrt(r @ r), 1.0))
    lengths = _or_one(sizes)
    if lengths is not sizes and ((components > 0) & (sizes == 0)).any():
        return np.inf  # a constraint is violated, and there is no residual
    return float((components / lengths).max(initial=0.0))


def rounding_part(
    x: Array, here: "Linearization", support: RowSupport, rounding: Rounding
) -> Array:
    """The part of each d_i, (n,), that rounding errors of the rows that x_i can change may explain.

    It explains nothing where an unknown is `undetermined_by_rounding`, nor for unknowns that change
    the same rows as such a one: there this need not be the minimum.
    """
    error = _errors(here, support, rounding)
    harmful = undetermined_by_rounding(x, here, support, rounding) > 0
    if not harmful.any():
        return error
    if here.constraints is not None:
        return np.zeros_like(error)
    return np.where(support.norms(support.rows(harmful).astype(float)) > 0, 0.0, error)


def undetermined_by_rounding(
    x: Array, here: "Linearization", support: RowSupport, rounding: Rounding
) -> Array:
    """By how much rounding leaves each x_i undetermined, (n,), in its unit; 0 if harmless.

    It is harmless up to a thousandth of a sigma, or a millionth of x_i itself.
    """
    error, norms = _errors(here, support, rounding), here.column_norms
    harmless = (
        (error <= HARMLESS_ERROR) | (error <= HARMLESS_SHARE * norms * np.abs(x)) | (norms == 0)
    )
    return np.where(harmless, 0.0, error / np.where(norms > 0, norms, 1.0))


def _or_one(lengths: Array) -> Array:
    """The lengths with 1 in place of 0; the array itself if none is 0."""
    return lengths if lengths.min(initial=1.0) > 0 else np.where(lengths > 0, lengths, 1.0)


def _errors(here: "Linearization", support: RowSupport, rounding: Rounding) -> Array:
    if here.constraints is not None:  # they carry the error of one number to another
        return np.full(len(here.column_norms), rounding.norm)
    return support.norms(rounding.rows)
