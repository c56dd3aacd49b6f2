"""How much of each row of a residual may be rounding error, and which rows a number can change."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import isfinite

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index, Mask
from workbench.problem.steps import EPS

FACTOR = 10.0  # of eps: a row is the end of a chain of operations, not of one


@dataclass(frozen=True, eq=False)
class Rounding:
    """The rounding error that each row of a whitened residual may carry, in its sigma.

    Attributes:
        rows: (m,) the rounding error of each row, in sigmas.
    """

    rows: Array

    @staticmethod
    def of(residual: Array, term_sizes: Array, floor: float = 1.0) -> "Rounding":
        """10 eps times the size of the terms of each row, which is at least `floor` sigmas.

        These are its own value, and the terms that `term_sizes` (m,) measures.
        """
        return Rounding(FACTOR * EPS * (floor + np.abs(residual) + term_sizes))

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

    Rows that no free number changes are constant: they add to the cost, but do not show how near a
    minimum is.

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
        taken = np.ravel_multi_index((groups.row, groups.col), groups.shape)
        at = np.ravel_multi_index((self._group_of[single.row], single.col), groups.shape)
        apart = ~np.isin(at, taken)  # so that nothing counts twice
        kept = single.row[apart], single.col[apart]
        self._own = csr_array((np.ones(len(kept[0])), kept), shape=own.shape)

    @staticmethod
    def of_frames(
        parts: Sequence[tuple["RowSupport", Index, Index]], shape: tuple[int, int]
    ) -> "RowSupport":
        """The support (n, m) of several groups of similar frames.

        `parts` has for each group the support of one frame, and the rows (F, m) and the free
        numbers (F, n) of its F frames.
        """
        kinds_of, rows_of, own, first = [], [], [], 0
        for one, rows, columns in parts:
            groups, single = one._groups.tocoo(), one._own.tocoo()
            kinds = first + groups.shape[0] * np.arange(len(rows))[:, None]
            first += groups.shape[0] * len(rows)
            kinds_of.append((columns, kinds + one._group_of))
            rows_of.append((kinds + groups.row, rows[:, groups.col]))
            own.append((columns[:, single.row], rows[:, single.col]))
        n, m = shape
        return RowSupport(
            marked(kinds_of, (n, first)), marked(rows_of, (first, m)), marked(own, (n, m))
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

    @cached_property
    def all_change(self) -> bool:
        """Whether every row of the residual is one that some free number can change."""
        return bool(self.changing.all())


def marked(places: Sequence[tuple[Index, Index]], shape: tuple[int, int]) -> csr_array:
    """A matrix of ones in these places, given as arrays of rows and of columns."""
    rows = np.concatenate([np.ravel(rows) for rows, _ in places])
    columns = np.concatenate([np.ravel(columns) for _, columns in places])
    return csr_array((np.ones(len(rows)), (rows, columns)), shape=shape)
