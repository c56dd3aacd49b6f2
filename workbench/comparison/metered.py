"""A problem that counts and times every evaluation, and keeps the best point, whoever asks."""

import copy
import sys
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.comparison.record import KINDS, RunLog
from workbench.problem import Linearization, Problem
from workbench.problem.constraints import ConstraintSet
from workbench.problem.costs import CostGradients, CostMethod, Costs, Places, interpreted
from workbench.problem.optimality import half_squared
from workbench.problem.storage import Stored
from workbench.residuals import Residual
from workbench.solvers.judgement import SHOWS_NOTHING
from workbench.solvers.limits import GUARDED, Meter
from workbench.solvers.solution import limited
from workbench.threads import limited_threads

T = TypeVar("T")
Point = tuple[Array, Array]  # free and fixed numbers
Complete = Callable[[Array, Array], Point]
CLOSING_EVALUATIONS = 3  # evaluations after the last one that counts
BOUND_ROUNDING = 1e-9  # of a number: rounding on a bound


def feasible(problem: Problem, x: Array, fixed: Array) -> bool:
    """Inside the bounds, and no constraint missed by more than its tolerance."""
    tolerance = BOUND_ROUNDING * np.maximum(1, abs(x))
    if not ((problem.lower <= x + tolerance) & (x - tolerance <= problem.upper)).all():
        return False
    constraints = problem.stacked_constraints
    return constraints is None or constraints.violation(constraints.values(x, fixed)) <= 1


def look(problem: Problem, x: Array, fixed: Array) -> tuple[float, float]:
    """Cost and optimality of a point by the problem itself; NaN where it cannot be evaluated."""
    try:
        with limited_threads():
            with GUARDED:
                here = problem.linearize_at(x, fixed)
            if not here.finite:
                return (here.cost if np.isfinite(here.cost) else np.nan), np.nan
            with GUARDED:
                rounding = problem.rounding(x, fixed, here.residual)
            return here.cost, problem.optimality(x, here, rounding)
    except SHOWS_NOTHING:
        return np.nan, np.nan


class RunMeter:
    """Counts, clock and limits of one run.

    The clock starts when this is made, and stands still while a graph is built, or while it is
    checked whether a point is feasible. Points that are evaluated after the limits are never the
    best one. A solver that ends by itself has a few evaluations, and `closing` seconds, to look at
    its answer; a solver that goes on after that is ended by a Stop.
    """

    def __init__(
        self,
        problem: Problem,
        fixed: Array,
        max_evaluations: int,
        max_seconds: float,
        log: RunLog,
        closing: float = 0.0,
    ) -> None:
        self.problem, self._fixed, self._log = problem, fixed, log
        self._most, self._longest = max_evaluations, max_seconds
        self._meter = Meter(KINDS, max_evaluations + CLOSING_EVALUATIONS, max_seconds + closing)
        self.paused, self.taken = self._meter.paused, log.taken
        self._spent = np.zeros(len(KINDS))
        self._not_finite, self._best = 0, np.inf

    @property
    def seconds(self) -> float:
        """The time on the clock, in s."""
        return self._meter.seconds

    def metered(self) -> "MeteredProblem":
        """A copy of the problem whose evaluations are metered; it shares everything that is built.

        If other blocks of it are freed, that problem is metered as well, and its points are
        completed by what is fixed. Without some of its residuals, or with other numbers fixed, a
        problem has another cost: its evaluations are counted, and are never the best point. The
        same holds for what is asked to judge an end (`Problem.for_judging`).
        """
        return MeteredProblem(self.problem, self, lambda x, fixed: (x, fixed))

    def ask(
        self,
        kinds: dict[str, int],
        compute: Callable[[], T],
        costs: Callable[[T], Any] | None = None,
        point: Callable[[int], Point] | None = None,
        complete: Complete | None = None,
    ) -> T:
        """Compute an answer, count it, and keep the best of its points if `complete` makes them
        those of the whole problem.

        `costs` are those in the answer, and `point` gives the i-th point as (x, fixed).
        """
        first = next(iter(kinds))
        if limited(kinds):
            self._meter.check_evaluations()
        self._meter.check_seconds()
        before = self.seconds
        for kind, count in kinds.items():
            self._meter.counts[kind] += count
        answer = compute()
        after = self.seconds
        self._spent[KINDS.index(first)] += after - before
        if costs is not None and point is not None and complete is not None:
            each = np.asarray(costs(answer), dtype=float).ravel()
            self._keep_best(each, first, lambda i: complete(*point(i)), after)
        self._log.note(_numbers(self._meter.counts), self._spent, self._not_finite, after)
        return answer

    def _keep_best(
        self, costs: Array, kind: str, point: Callable[[int], Point], seconds: float
    ) -> None:
        """Keep the best of points with these costs (k,), evaluated one by one or all at once."""
        self._not_finite += int(np.count_nonzero(~np.isfinite(costs)))
        for i in np.flatnonzero(costs < self._best):
            counts = {**self._meter.counts}
            counts[kind] -= len(costs) - 1 - int(i)
            within = limited(counts) <= self._most and seconds <= self._longest
            if not (within and -np.inf < costs[i] < self._best):
                continue
            with self.paused():
                x, fixed = point(int(i))
                same = np.array_equal(fixed, self._fixed)
                allowed = same and feasible(self.problem, x, self._fixed)
            if allowed:
                self._best = float(costs[i])
                self._log.better(x, _numbers(counts), seconds, self._best)


def _taken(name: str) -> Any:
    """An attribute of a metered problem whose use may lead to evaluations that are not counted.

    It is noted if it is taken from outside of the workbench.
    """

    def get(problem: "MeteredProblem") -> Any:
        if sys._getframe(1).f_globals.get("__name__", "").partition(".")[0] != "workbench":
            problem._meter.taken()
        return getattr(problem._problem, name)

    return property(get)


class MeteredProblem(Problem):
    """A copy of a problem that a `RunMeter` counts; see `RunMeter.metered`.

    What takes residuals or graphs to where their evaluations cannot be seen is noted in the log.
    """

    residuals, function, derivative, adjoint, hessian = map(
        _taken, ("residuals", "function", "derivative", "adjoint", "hessian")
    )

    def __init__(self, problem: Problem, meter: RunMeter, complete: Complete | None) -> None:
        vars(self).update(vars(problem))
        self._problem, self._meter, self._complete = problem, meter, complete
        self.stacked_constraints = _counted(problem.stacked_constraints, meter)

    def variant(self, residuals: Iterable[Residual], names: Iterable[str]) -> Problem:
        """Another problem, whose evaluations are not counted."""
        self._meter.taken()
        return self._problem.variant(residuals, names)

    def graph(self) -> cs.MX:
        """The graph of the residual, whose evaluations cannot be counted."""
        self._meter.taken()
        return self._problem.graph()

    def freeing(self, *names: str) -> Problem:
        """The problem with other blocks free, metered."""
        part = self._problem.freeing(*names)
        whole = self._meter.problem
        complete = None if self._complete is None else lambda x, f: whole.split(part.values(x, f))
        return MeteredProblem(part, self._meter, complete)

    def without(self, *residuals: str) -> Problem:
        """The problem without these residuals: counted, and its points are never the best."""
        return MeteredProblem(self._problem.without(*residuals), self._meter, None)

    def for_judging(self) -> Problem:
        """A copy whose points are never the best."""
        return MeteredProblem(self._problem, self._meter, None)

    def residual(self, x: Array, fixed: Array) -> Array:
        """As of a problem."""
        return self._one("residual", self._problem.residual, half_squared, x, fixed)

    def cost_and_gradient(self, x: Array, fixed: Array) -> tuple[float, Array]:
        """As of a problem."""
        compute = self._problem.cost_and_gradient
        return self._one("gradient", compute, lambda both: both[0], x, fixed)

    def linearize_at(self, x: Array, fixed: Array) -> Linearization:
        """As of a problem; constraints are linearized with it."""
        compute = self._problem.linearize_at
        return self._one("jacobian", compute, lambda here: here.cost, x, fixed)

    def hessian_at(self, x: Array, fixed: Array) -> Stored:
        """As of a problem; the time of building its graph does not count."""
        with self._meter.paused():
            _ = self._problem.hessian
        return self._meter.ask({"hessian": 1}, lambda: self._problem.hessian_at(x, fixed))

    def costs(
        self, x: Array, fixed: Array, entries: Places | None = None, by: CostMethod = interpreted
    ) -> Costs:
        """As of a problem: every point is counted."""
        with self._meter.paused():
            compute = self._problem.costs(x, fixed, entries, by)
        return self._batch_of("residual", compute, lambda costs: costs, x, fixed, entries)

    def cost_gradients(
        self, x: Array, fixed: Array, entries: Places | None = None
    ) -> CostGradients:
        """As of a problem: every point is counted."""
        with self._meter.paused():
            compute = self._problem.cost_gradients(x, fixed, entries)
        return self._batch_of("gradient", compute, lambda both: both[0], x, fixed, entries)

    def _one(
        self,
        kind: str,
        compute: Callable[[Array, Array], T],
        cost: Callable[[T], float],
        x: Array,
        fixed: Array,
    ) -> T:
        kinds = {kind: 1}
        if kind == "jacobian" and self.stacked_constraints is not None:
            kinds["constraint_jacobian"] = 1
        at = np.asarray(x, dtype=float).ravel(), fixed
        return self._meter.ask(kinds, lambda: compute(x, fixed), cost, lambda _: at, self._complete)

    def _batch_of(
        self,
        kind: str,
        compute: Callable[[Array], T],
        costs: Callable[[T], Array],
        x: Array,
        fixed: Array,
        entries: Places | None,
    ) -> Callable[[Array], T]:
        def ask(z: Array) -> T:
            def point(i: int) -> Point:
                at = np.array(x, dtype=float).ravel()
                at[slice(None) if entries is None else entries] = z[i]
                return at, fixed

            return self._meter.ask({kind: len(z)}, lambda: compute(z), costs, point, self._complete)

        return ask


def _counted(constraints: ConstraintSet | None, meter: RunMeter) -> ConstraintSet | None:
    """A copy of constraints whose evaluations are counted."""
    if constraints is None:
        return None

    def counted(kind: str, compute: Callable[..., T]) -> Callable[..., T]:
        return lambda *arguments: meter.ask({kind: 1}, lambda: compute(*arguments))

    copied = copy.copy(constraints)
    vars(copied).update(
        values=counted("constraint", constraints.values),
        linearize=counted("constraint_jacobian", constraints.linearize),
        hessian=counted("constraint_hessian", constraints.hessian),
    )
    return copied


def _numbers(counts: dict[str, int]) -> Array:
    """The counts in the order of KINDS."""
    return np.array(list(counts.values()), dtype=float)
