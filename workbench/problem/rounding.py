"""How much of a residual may be rounding error, row by row, and which rows a number can change."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.problem.steps import EPS

Array = NDArray[np.float64]
FACTOR = 10.0  # of eps: a row is the end of a chain of operations, not of one


@dataclass(frozen=True, eq=False)
class Rounding:
    """The rounding error that each row of a whitened residual may carry, in its sigma."""

    rows: Array  # (m,)

    @staticmethod
    def of(residual: Array, made_of: Array) -> "Rounding":
        """10 eps times the size of what a row is made of: its own value, the terms that `made_of`
        measures, both (m,), and one sigma for the constants in its formula.
        """
        return Rounding(FACTOR * EPS * (1.0 + np.abs(residual) + made_of))

    @cached_property
    def norm(self) -> float:
        """Of all rows together."""
        return float(np.linalg.norm(self.rows))

    def of_cost(self, residual: Array) -> float:
        """By how much rounding may have changed 1/2 |r|^2: |r|' e + 1/2 |e|^2, e the rows."""
        return float(np.abs(residual) @ self.rows) + 0.5 * self.norm**2

    def of_fall(self, residual: Array, moved: NDArray[np.bool_]) -> float:
        """The same of a difference of costs, where only some rows (m,) are not the same."""
        return Rounding(self.rows[moved]).of_cost(residual[moved])


def half_squared(r: Array) -> float:
    """1/2 |r|^2 of a residual (m,); infinite, without a warning, where it is too large."""
    return 0.5 * float(np.vdot(r, r))


def fall(residual: Array, to: Array) -> float:
    """1/2 |r|^2 - 1/2 |s|^2 of two residuals (m,), as 1/2 (r - s)'(r + s).

    Large rows that do not change drop out of it; from the difference of two costs they would take
    the digits.
    """
    return 0.5 * float((residual - to) @ (residual + to))


class Support:
    """Which rows of the residual each free number can change, by the structure of the graph.

    Number i can change the rows of its group, `groups[group_of[i]]` (m,), and those that are
    marked in row i of `own` (n, m). Rows that no free number changes are constants: they make the
    cost larger and say nothing about how near a minimum is.
    """

    def __init__(
        self, groups: NDArray[np.bool_], group_of: NDArray[np.signedinteger], own: csr_array
    ) -> None:
        self._groups, self._group_of, self._own = groups.astype(float), group_of, own

    def norms(self, rows: Array) -> Array:
        """|v| over the rows that each free number can change: (n,) for v (m,)."""
        squares = rows**2
        return np.asarray(np.sqrt((self._groups @ squares)[self._group_of] + self._own @ squares))

    def rows(self, numbers: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """The rows (m,) that some of the free numbers (n,) can change."""
        read = np.asarray(self._groups[np.unique(self._group_of[numbers])].any(axis=0))
        read[self._own[np.flatnonzero(numbers)].indices] = True
        return read

    @cached_property
    def read(self) -> NDArray[np.bool_]:
        """Which free numbers can change any row at all, (n,)."""
        return self.norms(np.ones(self._groups.shape[1])) > 0

    @cached_property
    def changing(self) -> NDArray[np.bool_]:
        """The rows that any free number can change, (m,)."""
        return self.rows(np.ones(len(self._group_of), dtype=bool))
