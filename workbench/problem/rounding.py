"""How much of each row of a residual may be rounding error, and which rows a number can change."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np
from numpy.typing import NDArray
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

    Number i can change the rows of its group, `groups[group_of[i]]` (m,), and those that are marked
    in row i of `own` (n, m). Rows that no free number changes are constant: they add to the cost,
    but do not show how near a minimum is.
    """

    def __init__(
        self,
        groups: Mask | csr_array,
        group_of: NDArray[np.signedinteger],
        own: csr_array,
    ) -> None:
        self._groups, self._group_of, self._own = groups.astype(float), group_of, own
        self._alike = own.nnz == 0  # whether all rows are those of groups

    @staticmethod
    def of_frames(
        parts: Sequence[tuple["RowSupport", Index, Index]], rest: csr_array
    ) -> "RowSupport":
        """The support of a sequence.

        `parts` are groups of F similar frames: the support of one frame, and the rows (F, m) and
        the free numbers (F, n) of all of them. `rest` (n, m) marks the other rows that numbers can
        change.
        """
        n, m = rest.shape
        group_of, first = np.zeros(n, dtype=np.int64), 1  # the first group is empty
        rows_of, groups_of, own = [], [], [rest]
        kinds_of: dict[int, list[tuple[int, int]]] = {}  # of numbers that frames share
        for i, (support, rows, columns) in enumerate(parts):
            kinds = first + support._groups.shape[0] * np.arange(len(rows))[:, None]
            group_of[columns] = kinds + support._group_of
            first = int(kinds[-1, 0]) + support._groups.shape[0]
            kind, row = support._of_groups
            groups_of.append((kinds + kind).ravel())
            rows_of.append(rows[:, row].ravel())
            single = support._own.tocoo()
            numbers, marked = columns[:, single.row].ravel(), rows[:, single.col].ravel()
            own.append(_marked(numbers, marked, (n, m)))
            if len(columns) > 1 or len(parts) > 1:
                for j in np.flatnonzero((columns == columns[0]).all(axis=0)):
                    kinds_of.setdefault(int(columns[0, j]), []).append(
                        (i, int(support._group_of[j]))
                    )
        together: dict[tuple[tuple[int, int], ...], int] = {}
        for number, which in kinds_of.items():
            if tuple(which) not in together:
                together[tuple(which)] = first
                for i, of_one in which:
                    support, rows, _ = parts[i]
                    kind, row = support._of_groups
                    found = rows[:, row[kind == of_one]].ravel()
                    rows_of.append(found)
                    groups_of.append(np.full(len(found), first))
                first += 1
            group_of[number] = together[tuple(which)]
        none = np.zeros(0, dtype=np.int64)
        at = np.concatenate([none, *groups_of]), np.concatenate([none, *rows_of])
        return RowSupport(_marked(*at, (first, m)), group_of, csr_array(sum(own[1:], own[0])))

    @property
    def explicit(self) -> csr_array:
        """The support without groups: row i (n, m) marks all rows that number i can change."""
        kind, row = self._of_groups
        groups = _marked(kind, row, self._groups.shape)
        return csr_array(groups[self._group_of] + self._own)

    @property
    def _of_groups(self) -> tuple[Index, Index]:
        """The groups' numbers and rows, pair by pair."""
        kind, row = self._groups.nonzero()
        return np.asarray(kind, dtype=np.int64), np.asarray(row, dtype=np.int64)

    def norms(self, rows: Array) -> Array:
        """|v| over the rows that each free number can change: (n,) for v (m,)."""
        squares = rows**2
        sums = (self._groups @ squares)[self._group_of]
        return np.asarray(np.sqrt(sums if self._alike else sums + self._own @ squares))

    def rows(self, numbers: Mask) -> Mask:
        """The rows (m,) that some of the free numbers (n,) can change."""
        marked = np.zeros(self._groups.shape[0])
        marked[self._group_of[numbers]] = 1.0
        read = np.asarray(marked @ self._groups) > 0
        read[self._own[np.flatnonzero(numbers)].indices] = True
        return read

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


def _marked(rows: Index, columns: Index, shape: tuple[int, int]) -> csr_array:
    """A matrix of ones in these places."""
    return csr_array((np.ones(len(rows)), (rows, columns)), shape=shape)
