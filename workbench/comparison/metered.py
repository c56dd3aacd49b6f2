"""A problem that counts what it is asked, times it, and keeps the best point, whoever asks."""

import copy
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.comparison.feasible import feasible
from workbench.comparison.graphs import MeteredFunction
from workbench.comparison.log import KINDS, LIMITED, Log
from workbench.problem import Problem
from workbench.problem.batch import Costs, Evaluation, Places, Slopes, interpreted
from workbench.problem.constraint_set import ConstraintSet
from workbench.problem.rounding import half_squared
from workbench.problem.storage import Matrix
from workbench.solvers import Status
from workbench.solvers.limits import Stop

T = TypeVar("T")
Complete = Callable[[Array, Array], tuple[Array, Array]]
Evaluate = Callable[[Array, Array], T]
CLOSING = 3  # evaluations after the last one that counts


class Metered:
    """Counts, clock and limits of one run. The clock starts when the watch is made, and stands
    still while a graph is built, or while we look at whether a point is allowed.

    What comes after the limits is no progress. A solver that ends by itself has a few evaluations,
    and `closing` seconds, to look at its answer; whoever asks on is stopped by a Stop.
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
        self._most, self._longest, self._closing = max_evaluations, max_seconds, closing
        self._counts, self._spent = np.zeros(len(KINDS), dtype=int), np.zeros(len(KINDS))
        self._not_finite, self._best, self._paused = 0, np.inf, 0.0
        self._began = time.perf_counter()

    @property
    def seconds(self) -> float:
        """On the clock."""
        return time.perf_counter() - self._began - self._paused

    def metered(self) -> Problem:
        """A copy of the problem whose evaluations are seen here; it shares all that is built.

        So are those of the same problem with other blocks free, whose points are completed by
        what is fixed. Without some of its residuals, or with other numbers fixed, a problem has
        another cost: evaluations of that are counted, and make no progress.
        """
        return self._copied(self._problem, lambda x, fixed: (x, fixed))

    def _copied(self, problem: Problem, whole: Complete | None) -> Problem:
        def asked(kind: str, cost: Callable[[T], float], compute: Evaluate[T]) -> Evaluate[T]:
            def evaluate(x: Array, fixed: Array) -> T:
                def points(_: int) -> tuple[Array, Array]:
                    return np.asarray(x, dtype=float).ravel(), fixed

                return self._asked(
                    {kind: 1}, lambda: compute(x, fixed), lambda told: [cost(told)], points, whole
                )

            return evaluate

        def linearized(x: Array, fixed: Array) -> Any:
            kinds = {"jacobian": 1}
            if problem.stacked_constraints is not None:
                kinds["constraint_jacobian"] = 1
            return self._asked(
                kinds,
                lambda: problem.linearize_at(x, fixed),
                lambda here: [here.cost],
                lambda _: (np.asarray(x, dtype=float).ravel(), fixed),
                whole,
            )

        def hessian(x: Array, fixed: Array) -> Matrix:
            with self._standing_still():
                _ = problem.hessian
            return self._asked({"hessian": 1}, lambda: problem.hessian_at(x, fixed))

        def freeing(*names: str) -> Problem:
            part = problem.freeing(*names)
            complete = None if whole is None else _completing(part, self._problem)
            return self._copied(part, complete)

        def costs(
            x: Array, fixed: Array, entries: Places | None = None, by: Evaluation = interpreted
        ) -> Costs:
            with self._standing_still():
                found = problem.costs(x, fixed, entries, by)
            return lambda z: self._asked(
                {"residual": len(z)},
                lambda: found(z),
                lambda told: told,
                _placed(x, fixed, entries, z),
                whole,
            )

        def slopes(x: Array, fixed: Array, entries: Places | None = None) -> Slopes:
            with self._standing_still():
                found = problem.slopes(x, fixed, entries)
            return lambda z: self._asked(
                {"gradient": len(z)},
                lambda: found(z),
                lambda told: told[0],
                _placed(x, fixed, entries, z),
                whole,
            )

        def graph(
            kind: str, build: Callable[[], cs.Function], cost: Callable[[cs.DM], Array] | None
        ) -> MeteredFunction:
            def built() -> cs.Function:
                with self._standing_still():
                    return build()

            def call(
                compute: Callable[[], T], points: Array, fixed: Array, told: Callable[[T], Array]
            ) -> T:
                return self._asked(
                    {kind: len(points)},
                    compute,
                    None if cost is None else told,
                    lambda i: (points[i], fixed[i]),
                    whole,
                )

            sizes = problem.free.size, problem.fixed.size
            return MeteredFunction(built, sizes, call, cost or _nothing, self._log.taken)

        def handed_over() -> cs.MX:
            self._log.taken()
            return problem.graph()

        methods: dict[str, Any] = dict(
            residual=asked("residual", half_squared, problem.residual),
            cost_and_gradient=asked("gradient", lambda both: both[0], problem.cost_and_gradient),
            linearize_at=linearized,
            hessian_at=hessian,
            costs=costs,
            slopes=slopes,
            freeing=freeing,
            without=lambda *names: self._copied(problem.without(*names), None),
            graph=handed_over,
        )
        for name, method in methods.items():  # so that a wrong call is told by the name it used
            method.__qualname__ = f"Problem.{name}"
        copied = copy.copy(problem)
        vars(copied).update(  # methods and graphs of this one copy
            methods,
            function=graph("residual", lambda: problem.function, _half_squared),
            derivative=graph("jacobian", lambda: problem.derivative, _half_squared),
            adjoint=graph("gradient", lambda: problem.adjoint, _plain),
            hessian=graph("hessian", lambda: problem.hessian, None),
            stacked_constraints=self._constraints(problem.stacked_constraints),
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
        """The answer; what it says of the costs of points is heard, if they are of the whole."""
        first = next(iter(kinds))
        limited = KINDS.index(first) < LIMITED
        if limited and self._counts[:LIMITED].sum() >= self._most + CLOSING:
            raise Stop(Status.MAX_EVALUATIONS)
        before = self.seconds
        if before > self._longest + self._closing:
            raise Stop(Status.MAX_SECONDS)
        for kind, count in kinds.items():
            self._counts[KINDS.index(kind)] += count
        answer = compute()
        after = self.seconds
        self._spent[KINDS.index(first)] += after - before
        if costs is not None and point is not None and whole is not None:
            self._heard(np.asarray(costs(answer), dtype=float), first, point, whole, after)
        self._log.note(self._counts, self._spent, self._not_finite, after)
        return answer

    def _heard(
        self,
        costs: Array,
        kind: str,
        point: Callable[[int], tuple[Array, Array]],
        whole: Complete,
        seconds: float,
    ) -> None:
        """Costs (k,) of points that were asked about one after the other, or at once."""
        self._not_finite += int(np.count_nonzero(~np.isfinite(costs)))
        for i in np.flatnonzero(costs < self._best):
            counts = self._counts.copy()
            counts[KINDS.index(kind)] -= len(costs) - 1 - i
            within = counts[:LIMITED].sum() <= self._most and seconds <= self._longest
            if not (within and -np.inf < costs[i] < self._best):
                continue
            with self._standing_still():
                x, fixed = whole(*point(int(i)))
                allowed = np.array_equal(fixed, self._fixed) and feasible(
                    self._problem, x, self._fixed
                )
            if allowed:
                self._best = float(costs[i])
                self._log.better(x, counts, seconds, self._best)

    @contextmanager
    def _standing_still(self) -> Iterator[None]:
        before = time.perf_counter()
        yield
        self._paused += time.perf_counter() - before


def _completing(part: Problem, problem: Problem) -> Complete:
    """From the numbers of a part, free and fixed, to those of the whole problem."""
    return lambda x, fixed: problem.split(part.values(x, fixed))


def _placed(
    x: Array, fixed: Array, entries: Places | None, z: Array
) -> Callable[[int], tuple[Array, Array]]:
    """The points of `Problem.costs`: x, but for z (M, k) in some places."""

    def point(i: int) -> tuple[Array, Array]:
        at = np.array(x, dtype=float).ravel()
        at[slice(None) if entries is None else entries] = z[i]
        return at, fixed

    return point


def _half_squared(r: cs.DM) -> Array:
    """Of residuals (m, points)."""
    return 0.5 * np.asarray(np.sum(np.asarray(r, dtype=float) ** 2, axis=0))


def _plain(cost: cs.DM) -> Array:
    return np.asarray(cost, dtype=float).ravel()


def _nothing(_: cs.DM) -> Array:
    return np.zeros(0)
