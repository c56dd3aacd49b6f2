"""One solver at work on one problem: it evaluates, counts, keeps the best, knows when to stop."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict
from types import TracebackType
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Values
from workbench.errors import NotSupported
from workbench.problem import Linearization, Problem
from workbench.solvers.solution import Callback, Evaluations, Iterate, Solution, Status
from workbench.threads import limited_threads

Array = NDArray[np.float64]
T = TypeVar("T")
NOT_FINITE_IN_A_ROW = 100  # a line search that halves has long met rounding by then


class Limits(Protocol):
    """What every solver's options include."""

    @property
    def max_iterations(self) -> int:
        """Steps."""

    @property
    def max_evaluations(self) -> int:
        """Of the residual, its gradient, its Jacobian and its Hessian, together."""

    @property
    def max_seconds(self) -> float:
        """Wall time."""

    @property
    def gradient_tolerance(self) -> float:
        """Of Problem.optimality: at or below it a point counts as converged."""


class Stop(Exception):
    """The end of a run, from wherever it is noticed."""

    def __init__(self, status: Status, message: str = "") -> None:
        super().__init__(message or status.value)
        self.status, self.message = status, message or status.value


class Run:
    """A context: what is raised inside ends the run, and `solution` tells how.

    Functions evaluate at flat vectors and raise Stop when a limit is reached. An interrupt from
    the keyboard ends the run too, with the best point kept. Linear algebra keeps to one thread
    inside, or to WORKBENCH_THREADS.
    """

    def __init__(
        self, name: str, limits: Limits, problem: Problem, start: Values, callback: Callback | None
    ) -> None:
        self.name, self.limits, self.problem, self.callback = name, limits, problem, callback
        self.x, self.fixed = problem.split(start)
        self.began = time.perf_counter()
        self.counts = dict.fromkeys(asdict(Evaluations()), 0)
        self.trace: list[Iterate] = []
        self.best, self.best_cost = self.x.copy(), np.inf
        self.stopped: Stop | None = None
        self.not_finite = 0  # points in a row at which the residual was NaN or infinite
        self.met_not_finite = -2  # how long the trace was when the last of them was met
        self.rounding = 0.0
        self._linearized: tuple[Array, Linearization] | None = None  # the last one
        self._threads = ExitStack()

    def __enter__(self) -> "Run":
        self._threads.enter_context(limited_threads())
        self.began = time.perf_counter()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> bool:
        self._threads.close()
        if isinstance(error, Stop):
            self.stopped = error
        elif isinstance(error, KeyboardInterrupt):
            self.stopped = Stop(Status.STOPPED, "interrupted from the keyboard")
        else:
            return False
        return True

    # Evaluation.

    def cost(self, x: Array) -> float:
        """The cost at x; infinite where the residual is not finite, so that no step goes there."""
        r = self._evaluate("residual", lambda: self.problem.residual(x, self.fixed))
        return self._kept(x, 0.5 * float(r @ r))

    def cost_and_gradient(self, x: Array) -> tuple[float, Array]:
        """The cost and its gradient at x, by one reverse sweep."""
        cost, g = self._evaluate("gradient", lambda: self.problem.cost_and_gradient(x, self.fixed))
        if not np.isfinite(g).all():
            cost = np.inf
        return self._kept(x, cost), g

    def linearize(self, x: Array) -> Linearization:
        """Residual and Jacobian at x; stops the run where they are not finite."""
        here = self._evaluate("jacobian", lambda: self.problem.linearize_at(x, self.fixed))
        if not np.isfinite(self._kept(x, here.cost if here.finite else np.inf)):
            raise Stop(Status.NOT_FINITE)
        self._linearized = x.copy(), here
        if not self.rounding:
            self.rounding = self.problem.rounding(x, self.fixed)
        return here

    def hessian(self, x: Array) -> Array:
        """The exact Hessian of the cost at x."""
        return self._evaluate("hessian", lambda: self.problem.hessian_at(x, self.fixed))

    def _evaluate(self, kind: str, function: Callable[[], T]) -> T:
        if sum(self.counts.values()) >= self.limits.max_evaluations:
            raise Stop(Status.MAX_EVALUATIONS)
        if time.perf_counter() - self.began > self.limits.max_seconds:
            raise Stop(Status.MAX_SECONDS)
        self.counts[kind] += 1
        try:
            return function()
        except (Stop, KeyboardInterrupt):
            raise
        except Exception as error:
            raise Stop(
                Status.RAISED, f"the residual raised {type(error).__name__}: {error}"
            ) from error

    def _kept(self, x: Array, cost: float) -> float:
        if not np.isfinite(cost):
            self.not_finite, self.met_not_finite = self.not_finite + 1, len(self.trace)
            if self.not_finite >= NOT_FINITE_IN_A_ROW:
                raise Stop(Status.NOT_FINITE)
            return np.inf
        self.not_finite = 0
        if cost < self.best_cost:
            self.best, self.best_cost = x.copy(), cost
        return cost

    # The way.

    def optimality(self, x: Array, here: Linearization) -> float:
        """The problem's measure, less what rounding explains."""
        return self.problem.optimality(x, here, self.rounding)

    def record(
        self, x: Array, cost: float, optimality: float = np.nan, damping: float = 0.0
    ) -> None:
        """Add an iterate to the trace; stop if it is good enough, or limit or callback say so."""
        values = self.problem.free.unpack(x)
        before = self.problem.free.pack(self.trace[-1].values) if self.trace else x
        iterate = Iterate(
            values, cost, optimality, float(np.linalg.norm(x - before)), damping,
            Evaluations(**self.counts), time.perf_counter() - self.began,
        )  # fmt: skip
        self.trace.append(iterate)
        says = self.callback(iterate) if self.callback is not None else None
        stop = isinstance(says, bool | np.bool_) and bool(says)
        if optimality <= self.limits.gradient_tolerance:
            raise Stop(Status.CONVERGED)
        if stop:
            raise Stop(Status.STOPPED, "stopped by the callback")
        if len(self.trace) > self.limits.max_iterations:
            raise Stop(Status.MAX_ITERATIONS)

    def stall(self, message: str = "") -> None:
        """End the run for want of a better point, or for what stood in the way of one."""
        if len(self.trace) - self.met_not_finite <= 1:  # in the last step or the one before
            raise Stop(Status.NOT_FINITE)
        raise Stop(Status.STALLED, message)

    def solution(self) -> Solution:
        """The best point seen. It decides whether the run converged, whoever says otherwise."""
        stop = self.stopped or Stop(Status.STALLED)
        status, message, optimality = stop.status, stop.message, np.nan
        if np.isfinite(self.best_cost):
            try:
                here = self._at_best()
                self.rounding = self.rounding or self.problem.rounding(self.best, self.fixed)
                optimality = self.optimality(self.best, here)
            except Exception as error:  # the residual is the user's; the best point is still ours
                message += f" (no gradient at the best point: {error})"
            if optimality <= self.limits.gradient_tolerance:
                status, message = Status.CONVERGED, Status.CONVERGED.value
            elif status is Status.CONVERGED:
                status, message = Status.STALLED, Status.STALLED.value
        return Solution(
            self.problem.free.unpack(self.best), self.best_cost, optimality, status, message,
            self.name, Evaluations(**self.counts), time.perf_counter() - self.began,
            tuple(self.trace),
        )  # fmt: skip

    def _at_best(self) -> Linearization:
        """The linearization at the best point: the last one made, as a rule."""
        if self._linearized is not None and np.array_equal(self._linearized[0], self.best):
            return self._linearized[1]
        return self.problem.linearize_at(self.best, self.fixed)


def refuse_bounds(name: str, problem: Problem, instead: str) -> None:
    """Raise NotSupported if the problem has bounds, which this algorithm has not."""
    if problem.bounded:
        raise NotSupported(
            f"{name} knows no bounds, but the problem bounds {', '.join(problem.bounds)}; "
            f"use {instead}, or drop the bounds"
        )
