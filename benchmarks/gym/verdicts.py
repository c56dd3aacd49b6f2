"""Whether a point that is called converged is a minimum, judged by differences in many digits.

A point violates what CONVERGED claims in three ways, each a kind of its own:

- `lost`: an unknown changed the residual on the way, and no longer does. Its column of the Jacobian
  is zero to rounding at the end and was not at another iterate. That is no violation if the rows
  that it changed are zero, or if the cost rises to both sides of it;
- `gradient`: the cosine that `Problem.optimality` measures is above the tolerance, less what
  rounding errors explain: those that the workbench estimates, and the difference of its residual
  from the one in 50 digits. That is no violation if the cost is level by the sizes of the unknowns:
  a cosine says nothing of columns that are too short;
- `saddle`: the cost has negative curvature in a direction, by more than the error of the
  differences, and is lower to both sides along it by more than its rounding error and by more than
  10 times the square of the tolerance, as a share of the cost. CONVERGED does not claim that there
  are no smaller falls; they are recorded all the same.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mpmath as mp
import numpy as np

from benchmarks.gym.arithmetic import DIGITS, IN_DIGITS, Arithmetic, arithmetic_of
from workbench.arrays import Array
from workbench.problem import Linearization, Problem
from workbench.problem.optimality import rounding_part
from workbench.problem.rounding import Rounding
from workbench.problem.storage import dense
from workbench.solvers.no_minimum import WORTH

LOST, GRADIENT, SADDLE = "lost", "gradient", "saddle"
KINDS = (LOST, GRADIENT, SADDLE)
AT_MOST = 30  # iterates of a trace at which a column is looked at
SLACK = 1.01  # of the tolerance: the end of a run is computed with errors, too
NUDGES = (1e-3, 1e-2, 1e-1)  # of the size of an unknown
DIRECTIONS = 3  # of least curvature that are tried
FLAT = 1e-2  # of the largest curvature: directions below are tried
LENGTHS = np.logspace(0, -8, 17)  # of the residual, or of the size of an unknown if less: steps
WIDTH = 1e-5  # of a whitened unknown, for differences of gradients in double precision


@dataclass(frozen=True)
class Verdict:
    """What differences say of a point that is called converged.

    Attributes:
        arithmetic: in which they were computed.
        cosine: the largest cosine between a column and the residual; see `Problem.optimality`.
        unexplained: the same, less what rounding explains.
        lost: the labels of unknowns that are lost.
        curvature: the least over the largest one, in unknowns scaled by their columns, of the
            directions that were tried; NaN if none was flat.
        fall: by how much the cost is lower to both sides of a saddle, as a share of it; else 0. It
            is no violation up to what the tolerance counts.
        violations: the kinds of violations.
    """

    arithmetic: str
    cosine: float
    unexplained: float
    lost: tuple[str, ...]
    curvature: float
    fall: float
    violations: tuple[str, ...]


def judge(
    problem: Problem,
    fixed: Array,
    end: Array,
    iterates: Sequence[Array],
    tolerance: float,
    arithmetic: Arithmetic | None = None,
) -> Verdict:
    """The verdict on `end` (n,), which is called converged after the `iterates`, the start first.

    The problem has no bounds and no constraints. Raises ArithmeticError where the residual next to
    the end is no real number.
    """
    with mp.workdps(DIGITS), np.errstate(all="ignore"):
        return _Judged(
            problem, fixed, end, iterates, arithmetic or arithmetic_of(problem, fixed)
        ).verdict(tolerance)


class _Judged:
    """The numbers at an end, each computed once."""

    def __init__(
        self,
        problem: Problem,
        fixed: Array,
        end: Array,
        iterates: Sequence[Array],
        arithmetic: Arithmetic,
    ) -> None:
        self.problem, self.fixed, self.x, self.iterates = problem, fixed, end, iterates
        self.arithmetic = arithmetic
        start = iterates[0] if iterates else end
        self.size = np.maximum(np.abs(end), np.abs(end - start))
        self.size = np.where(self.size > 0, self.size, 1.0)
        self.r = arithmetic.residual(arithmetic.of(end))
        found = [arithmetic.column(end, i, self.size[i]) for i in range(end.size)]
        self.columns = [column for column, _ in found]
        self.error = np.array([np.linalg.norm(error) for _, error in found])
        self.rounding: Rounding = problem.rounding(end, fixed, self.r.astype(float))
        self.noise = problem.support.norms(self.rounding.rows)
        self.lengths = np.array([_length(column) for column in self.columns])
        self.gone = (self.lengths - self.error) * self.size <= self.noise

    def verdict(self, tolerance: float) -> Verdict:
        cosine, unexplained = self._cosines(tolerance)
        lost = tuple(
            self.problem.free.label(int(i)) for i in np.flatnonzero(self.gone) if self._is_lost(i)
        )
        curvature, fall = self._saddle()
        kinds = [
            kind
            for kind, there in (
                (LOST, bool(lost)),
                (GRADIENT, unexplained > SLACK * tolerance),
                (SADDLE, fall > WORTH * tolerance**2),
            )
            if there
        ]
        return Verdict(
            self.arithmetic.name, cosine, unexplained, lost, curvature, fall, tuple(kinds)
        )

    def _cosines(self, tolerance: float) -> tuple[float, float]:
        """The largest cosine, and less what rounding and the differences' errors explain."""
        r = self.r.astype(float)
        whole = np.where(self.problem.support.changing, r, 0.0)
        sizes = np.maximum(
            self.problem.support.norms(whole), min(float(np.linalg.norm(whole)), 1.0)
        )
        way = np.array(
            [
                0.0 if gone else float(abs(column @ self.r)) / length
                for column, length, gone in zip(self.columns, self.lengths, self.gone, strict=True)
            ]
        )
        here = self.problem.linearize_at(self.x, self.fixed)
        explained = rounding_part(self.x, here, self.problem.support, self.rounding)
        explained = explained + self.problem.support.norms(here.residual - r)  # as it is
        lengths = np.where(self.lengths > 0, self.lengths, 1.0)
        explained = explained + np.linalg.norm(r) * self.error / lengths
        shares = np.where(sizes > 0, sizes, 1.0)
        left = np.maximum(way - explained, 0.0)
        length = float(np.linalg.norm(r))
        level = way * self.lengths / np.maximum(self.lengths, length / self.size)
        if (level <= SLACK * tolerance * length).all():
            left = np.zeros_like(left)
        return float((way / shares).max(initial=0)), float((left / shares).max(initial=0))

    def _is_lost(self, i: int) -> bool:
        """Whether unknown i, whose column is zero, is lost: see the module."""
        step = max(1, len(self.iterates) // AT_MOST)
        for x in (*self.iterates[::step], *self.iterates[-1:]):
            try:
                column, error = self.arithmetic.column(x, i, self.size[i])
            except ArithmeticError:
                continue
            left = _length(column) - float(np.linalg.norm(error))
            if not left * self.size[i] > self.noise[i]:
                continue
            rows = np.abs(column.astype(float)) > error
            there = np.abs(self.r.astype(float))
            nothing_left = bool((there[rows] <= self.rounding.rows[rows]).all())
            return not nothing_left and not self._rises_along(i)
        return False

    def _rises_along(self, i: int) -> bool:
        """Whether the cost rises to both sides of x_i, by more than its rounding error."""
        unit = np.zeros(self.x.size)
        unit[i] = self.size[i]
        noise = self.rounding.of_decrease(self.r.astype(float), self.problem.support.rows(unit > 0))
        for side in (-1.0, 1.0):
            falls = self._fall(unit, side * np.array(NUDGES))
            seen = falls[np.abs(falls) > noise]
            if not (seen.size and seen[0] < 0):
                return False
        return True

    def _fall(self, direction: Array, lengths: Array) -> Array:
        """As `Arithmetic.falls`, and -inf where the residual is no real number."""
        found = np.full(len(lengths), -np.inf)
        for k in range(len(lengths)):
            try:
                found[k] = float(self.arithmetic.falls(self.x, direction, (lengths[k],))[0])
            except ArithmeticError:
                continue
        return np.where(np.isnan(found), -np.inf, found)

    def _saddle(self) -> tuple[float, float]:
        """The least curvature over the largest, and the fall of the cost along it as a share."""
        H = self._hessian()
        scale = np.maximum(self.lengths, np.sqrt(np.abs(np.diag(H))))
        kept = np.flatnonzero(scale > 0)
        scale = scale[kept]
        H = H[np.ix_(kept, kept)] / np.outer(scale, scale)
        if not (np.isfinite(H).all() and H.any()):
            return np.nan, 0.0
        values, vectors = np.linalg.eigh((H + H.T) / 2)
        largest = float(np.abs(values).max())
        length = float(np.linalg.norm(self.r.astype(float)))
        cost, least = 0.5 * length**2, np.nan
        noise = self.rounding.of_cost(self.r.astype(float))
        for value, vector in list(zip(values, vectors.T, strict=True))[:DIRECTIONS]:
            if value > FLAT * largest:
                break
            direction = np.zeros(self.x.size)
            direction[kept] = vector / scale
            width = max(length, 1e-8) if self.arithmetic.name == IN_DIGITS else 1.0
            try:
                curvature, error = self.arithmetic.curvature(self.x, direction, width)
            except ArithmeticError:
                continue
            least = float(np.fmin(least, curvature / largest))
            if not curvature < -error:
                continue
            farthest = min(length, 1 / float(np.max(np.abs(direction) / self.size)))
            sides = [self._fall(direction, side * farthest * LENGTHS) for side in (-1.0, 1.0)]
            lower = np.minimum(*sides)
            if lower.max() > noise:
                return curvature / largest, float(lower.max()) / cost
        return least, 0.0

    def _hessian(self) -> Array:
        """(n, n) the Hessian in double precision, which only proposes directions."""
        if self.arithmetic.name == IN_DIGITS:
            return dense(self.problem.hessian_at(self.x, self.fixed))
        here: Linearization = self.problem.linearize_at(self.x, self.fixed)
        found = np.zeros((self.x.size, self.x.size))
        for i, norm in enumerate(here.column_norms):
            step = np.zeros(self.x.size)
            step[i] = WIDTH / (norm or 1.0)
            ahead, behind = (
                self.problem.cost_and_gradient(self.x + side * step, self.fixed)[1]
                for side in (1.0, -1.0)
            )
            found[i] = (ahead - behind) / (2 * step[i])
        return found


def _length(column: Array) -> float:
    return float(mp.norm(list(column)) if column.dtype == object else np.linalg.norm(column))
