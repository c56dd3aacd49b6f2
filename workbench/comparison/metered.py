"""A problem that counts and times every evaluation, and keeps the best point, whoever asks."""

import copy
from collections.abc import Callable
from typing import Any, TypeVar

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.comparison.feasible import feasible
from workbench.comparison.graphs import MeteredFunction
from workbench.comparison.log import KINDS, Log
from workbench.problem import Problem
from workbench.problem.constraints import ConstraintSet
from workbench.problem.costs import CostGradients, CostMethod, Costs, Places, interpreted
from workbench.problem.rounding import half_squared
from workbench.problem.storage import Matrix
from workbench.solvers.limits import Meter, limited

T = TypeVar("T")
Complete = Callable[[Array, Array], tuple[Array, Array]]
Evaluate = Callable[[Array, Array], T]
Points = Callable[[Array], tuple[Array, Array]]
CLOSING = 3  # evaluations after the last one that counts


class Metered:
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
        log: Log,
        closing: float = 0.0,
    ) -> None:
        self._problem, self._fixed, self._log = problem, fixed, log
        self._most, self._longest = max_evaluations, max_seconds
        self._meter = Meter(KINDS, max_evaluations + CLOSING, max_seconds + closing)
        self._spent = np.zeros(len(KINDS))
        self._not_finite, self._best = 0, np.inf

    @property
    def seconds(self) -> float:
        """The time on the clock, in s."""
        return self._meter.seconds

    def metered(self) -> Problem:
        """A copy of the problem whose evaluations are metered; it shares everything that is built.

        If other blocks of it are freed, that problem is metered as well, and its points are
        completed by what is fixed. Without some of its residuals, or with other numbers fixed, a
        problem has another cost: its evaluations are counted, and are never the best point. The
        same holds for what is asked to judge an end (`Problem.for_judging`).
        """
        return self._copied(self._problem, lambda x, fixed: (x, fixed))

    def _copied(self, problem: Problem, whole: Complete | None) -> Problem:
        constrained = problem.stacked_constraints is not None
        linearization = {"jacobian": 1} | ({"constraint_jacobian": 1} if constrained else {})

        def metered(
            kinds: dict[str, int], compute: Evaluate[T], cost: Callable[[T], float]
        ) -> Evaluate[T]:
            def evaluate(x: Array, fixed: Array) -> T:
                return self._asked(
                    kinds,
                    lambda: compute(x, fixed),
                    lambda answer: [cost(answer)],
                    lambda _: (np.asarray(x, dtype=float).ravel(), fixed),
                    whole,
                )

            return evaluate

        def hessian(x: Array, fixed: Array) -> Matrix:
            with self._meter.paused():
                _ = problem.hessian
            return self._asked({"hessian": 1}, lambda: problem.hessian_at(x, fixed))

        def freeing(*names: str) -> Problem:
            part = problem.freeing(*names)
            complete = None if whole is None else _completing(part, self._problem)
            return self._copied(part, complete)

        def together(
            kind: str, compute: Callable[[Array], T], cost: Callable[[T], Array], at: Points
        ) -> Callable[[Array], T]:
            return lambda z: self._asked(
                {kind: len(z)}, lambda: compute(z), cost, lambda i: at(z[i]), whole
            )

        def costs(
            x: Array, fixed: Array, entries: Places | None = None, by: CostMethod = interpreted
        ) -> Costs:
            with self._meter.paused():
                found = problem.costs(x, fixed, entries, by)
            return together("residual", found, lambda costs: costs, _placed(x, fixed, entries))

        def cost_gradients(x: Array, fixed: Array, entries: Places | None = None) -> CostGradients:
            with self._meter.paused():
                found = problem.cost_gradients(x, fixed, entries)
            return together("gradient", found, lambda both: both[0], _placed(x, fixed, entries))

        def graph(
            kind: str, build: Callable[[], cs.Function], cost: Callable[[cs.DM], Array] | None
        ) -> MeteredFunction:
            def built() -> cs.Function:
                with self._meter.paused():
                    return build()

            def call(
                compute: Callable[[], T], points: Array, fixed: Array, costs: Callable[[T], Array]
            ) -> T:
                return self._asked(
                    {kind: len(points)},
                    compute,
                    None if cost is None else costs,
                    lambda i: (points[i], fixed[i]),
                    whole,
                )

            sizes = problem.free.size, problem.fixed.size
            return MeteredFunction(built, sizes, call, cost or _nothing, self._log.taken)

        def handed_over() -> cs.MX:
            self._log.taken()
            return problem.graph()

        methods: dict[str, Any] = dict(
            residual=metered({"residual": 1}, problem.residual, half_squared),
            cost_and_gradient=metered(
                {"gradient": 1}, problem.cost_and_gradient, lambda both: both[0]
            ),
            linearize_at=metered(linearization, problem.linearize_at, lambda here: here.cost),
            hessian_at=hessian,
            costs=costs,
            cost_gradients=cost_gradients,
            freeing=freeing,
            without=lambda *names: self._copied(problem.without(*names), None),
            for_judging=lambda: self._copied(problem, None),
            graph=handed_over,
        )
        for name, method in methods.items():  # so that the error of a wrong call has its name
            method.__qualname__ = f"Problem.{name}"
        copied = copy.copy(problem)
        vars(copied).update(  # methods and graphs of this one copy
            methods,
            function=graph("residual", lambda: problem.function, _half_squared),
            derivative=graph("jacobian", lambda: problem.derivative, _half_squared),
            adjoint=graph("gradient", lambda: problem.adjoint, _plain),
            hessian=graph("hessian", lambda: problem.hessian, None),
            stacked_constraints=self._constraints(problem.stacked_constraints),
            solvers_made=[],  # so that no run is quicker for those before it
        )
        return copied

    def _constraints(self, there: ConstraintSet | None) -> ConstraintSet | None:
        if there is None:
            return None

        def counted(kind: str, compute: Callable[..., T]) -> Callable[..., T]:
            return lambda *given: self._asked({kind: 1}, lambda: compute(*given))

        copied = copy.copy(there)
        vars(copied).update(
            values=counted("constraint", there.values),
            linearize=counted("constraint_jacobian", there.linearize),
            hessian=counted("constraint_hessian", there.hessian),
        )
        return copied

    def _asked(
        self,
        kinds: dict[str, int],
        compute: Callable[[], T],
        costs: Callable[[T], Any] | None = None,
        point: Callable[[int], tuple[Array, Array]] | None = None,
        whole: Complete | None = None,
    ) -> T:
        """Compute an answer, count it, and keep the best of its points if `whole` completes them.

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
        if costs is not None and point is not None and whole is not None:
            self._keep_best(np.asarray(costs(answer), dtype=float), first, point, whole, after)
        self._log.note(_numbers(self._meter.counts), self._spent, self._not_finite, after)
        return answer

    def _keep_best(
        self,
        costs: Array,
        kind: str,
        point: Callable[[int], tuple[Array, Array]],
        whole: Complete,
        seconds: float,
    ) -> None:
        """Keep the best of points with these costs (k,), evaluated one by one or all at once."""
        self._not_finite += int(np.count_nonzero(~np.isfinite(costs)))
        for i in np.flatnonzero(costs < self._best):
            counts = {**self._meter.counts}
            counts[kind] -= len(costs) - 1 - int(i)
            within = limited(counts) <= self._most and seconds <= self._longest
            if not (within and -np.inf < costs[i] < self._best):
                continue
            with self._meter.paused():
                x, fixed = whole(*point(int(i)))
                allowed = np.array_equal(fixed, self._fixed) and feasible(
                    self._problem, x, self._fixed
                )
            if allowed:
                self._best = float(costs[i])
                self._log.better(x, _numbers(counts), seconds, self._best)


def _numbers(counts: dict[str, int]) -> Array:
    """The counts in the order of KINDS."""
    return np.array(list(counts.values()), dtype=float)


def _completing(part: Problem, problem: Problem) -> Complete:
    """A function from the free and fixed numbers of a part to those of the whole problem."""
    return lambda x, fixed: problem.split(part.values(x, fixed))


def _placed(x: Array, fixed: Array, entries: Places | None) -> Points:
    """The points of `Problem.costs`, which equal x except in some places."""

    def point(z: Array) -> tuple[Array, Array]:
        at = np.array(x, dtype=float).ravel()
        at[slice(None) if entries is None else entries] = z
        return at, fixed

    return point


def _half_squared(r: cs.DM) -> Array:
    """The costs (M,) of residuals (m, M), one column for each point."""
    return 0.5 * np.asarray(np.sum(np.asarray(r, dtype=float) ** 2, axis=0))


def _plain(cost: cs.DM) -> Array:
    return np.asarray(cost, dtype=float).ravel()


def _nothing(_: cs.DM) -> Array:
    return np.zeros(0)
