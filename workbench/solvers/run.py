"""One run of a solver on a problem: its evaluations, its iterates, its best point, its limits."""

from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import asdict
from math import isfinite, isnan, sqrt
from types import TracebackType
from typing import NoReturn, TypeVar

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.interrupts import Interrupts
from workbench.problem import Linearization, Problem
from workbench.problem.rounding import all_finite, fall, half_squared
from workbench.problem.storage import Stored, entries
from workbench.solvers.abilities import refuse
from workbench.solvers.best import Best
from workbench.solvers.ending import ending, prefer_stationary
from workbench.solvers.limits import GUARDED, Limits, Meter, Stop, stop_asked, stop_of, unwarned
from workbench.solvers.linearization_cache import LinearizationCache
from workbench.solvers.one_pass import HIGHER, OnePass, takes_one_pass
from workbench.solvers.rounding_noise import RoundingNoise
from workbench.solvers.sensitivity import Sensitivity
from workbench.solvers.solution import Callback, Evaluations, Iterate, Solution, Status
from workbench.solvers.wrapping import rewrapped
from workbench.threads import limited_threads

T = TypeVar("T")
Known = tuple[float, Array] | None  # the cost and the residual (m,) at a point
NOT_FINITE_IN_A_ROW = 100  # a line search that halves has long met rounding by then
TRIES = 6  # to find a more stationary point, each step more cautious than the last
INTERRUPTED = "interrupted from the keyboard"
POLISHED = 0.99  # of the optimality before, at most, where costs no longer tell points apart


class Run:
    """One run of a solver: a context that ends with a Stop, after which `solution` says how.

    Its methods evaluate at flat vectors and raise Stop when a limit is reached. An interrupt from
    the keyboard also ends the run and keeps the best point: until `solution` returns, signals are
    noted and looked at before every evaluation. Linear algebra uses WORKBENCH_THREADS threads.
    Raises NotSupported, before anything is evaluated, for a problem that the solver does not take.
    """

    def __init__(
        self, name: str, solver: Limits, problem: Problem, start: Values, callback: Callback
    ) -> None:
        refuse(name, solver.abilities, problem)
        self.name, self.limits, self.problem, self.callback = name, solver, problem, callback
        x, self.fixed = problem.split(start)
        self.x = np.clip(x, problem.lower, problem.upper)
        self._around = problem.fixed.unpack(self.fixed) if problem.free.parts else None
        self.meter = Meter(asdict(Evaluations()), solver.max_evaluations, solver.max_seconds)
        self.trace: list[Iterate] = []
        self.best = Best(self.x)
        self.stopped: Stop | None = None
        self.not_finite = 0  # points in a row at which the residual was NaN or infinite
        self.met_not_finite = -2  # how long the trace was when the last of them was met
        self.sensitivity = Sensitivity(self.x)
        self._unpolished = 0  # tries in a row that did not lead to a more stationary point
        self.linearizations = LinearizationCache()
        self.rounding_noise = RoundingNoise(problem, self.fixed, self.linearizations)
        self._recorded: Array | None = None  # the last one
        self.one_pass = OnePass(takes_one_pass(solver, problem))
        self._threads, self._interrupts, self._interrupted = ExitStack(), Interrupts(), False

    def __enter__(self) -> "Run":
        self._threads.enter_context(limited_threads())
        self._threads.enter_context(unwarned())
        self._interrupts.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> bool:
        self._threads.close()
        self._interrupted = isinstance(error, KeyboardInterrupt) or self._interrupts.pressed
        self.stopped = Stop(Status.STOPPED, INTERRUPTED) if self._interrupted else stop_of(error)
        if self.stopped is None:
            self._interrupts.close()
            return False
        if error is not None:
            error.with_traceback(None)  # whose frames would keep the run alive
        return True

    # Evaluation.

    def cost(self, x: Array) -> float:
        """The cost at x (n,); infinite where the residual is not finite."""
        return self.cost_and_residual(x)[0]

    def cost_and_residual(self, x: Array) -> tuple[float, Array]:
        """The cost at x (n,) and the residual (m,) there; see `cost`."""
        if (known := self.linearizations.at(x)) is not None:
            self.check()
            return known.cost, known.residual  # it was offered to `best` before
        r = self.evaluate("residual", lambda: self.problem.residual(x, self.fixed))
        return self._kept(x, half_squared(r)), r

    def tried(self, to: Array, before: float) -> tuple[float, Array]:
        """The same at a trial after a cost `before`, linearized at once if `one_pass` says so."""
        at_once = self.linearizations.at(to) is None and self.one_pass.expected()
        known = self._linearized(to, HIGHER * before) if at_once else None
        return known or self.cost_and_residual(to)

    def cost_and_gradient(self, x: Array) -> tuple[float, Array]:
        """The cost and its gradient at x, by one reverse sweep."""
        cost, g = self.evaluate("gradient", lambda: self.problem.cost_and_gradient(x, self.fixed))
        return self._kept(x, cost if all_finite(g) else np.inf), g

    def linearize(self, x: Array) -> Linearization:
        """Residual and Jacobian at x; stops the run where they are not finite."""
        if (known := self.linearizations.at(x)) is not None:
            return known
        self.check()
        self.linearizations.forget()  # first: memory that is used again is already there, and near
        self._linearized(x)
        if (here := self.linearizations.at(x)) is None:
            raise Stop(Status.NOT_FINITE)
        return here

    def _linearized(self, x: Array, most: float = np.inf) -> Known:
        """Linearize at x; kept if it is finite and costs at most `most`. None if not finite."""
        here = self.evaluate("jacobian", lambda: self.problem.linearize_at(x, self.fixed))
        if not here.cost <= most:
            return self._kept(x, here.cost), here.residual
        if self.one_pass.on:
            _ = here.normal  # with the gradient and the lengths of columns
        if not isfinite(self._kept(x, here.cost if here.finite else np.inf, here)):
            return None
        self.sensitivity.observe(x, here)
        self.rounding_noise.age += 1
        self.linearizations.keep(x, here)
        return here.cost, here.residual

    def hessian(self, x: Array) -> Stored:
        """The exact Hessian of the cost at x; stops the run where it is not finite."""
        H = self.evaluate("hessian", lambda: self.problem.hessian_at(x, self.fixed))
        if not np.isfinite(entries(H)).all():
            raise Stop(Status.NOT_FINITE)
        return H

    def constraints(self, x: Array) -> Array:
        """The constraints' values at x (k,), each in its unit."""
        if (there := self.problem.stacked_constraints) is None:
            return np.zeros(0)
        return self.evaluate("constraint", lambda: there.values(x, self.fixed))

    def check(self) -> None:
        """Stop the run if its evaluations or its time are used up, or if it is interrupted."""
        self._interrupts.check()
        self.meter.check_evaluations()
        self.meter.check_seconds()

    def evaluate(self, kind: str, function: Callable[[], T]) -> T:
        """Call a function of the user, count it, and check the limits before."""
        self.check()
        self.meter.counts[kind] += 1
        with GUARDED, self._interrupts.raised_at_once():
            return function()

    def _kept(self, x: Array, cost: float, here: Linearization | None = None) -> float:
        there, violation = self.problem.stacked_constraints, 0.0
        if there is not None and isfinite(cost):
            known = None if here is None else here.constraints
            values = self.constraints(x) if known is None else known.values
            violation = there.violation(values)
        if not (isfinite(cost) and isfinite(violation)):
            self.not_finite, self.met_not_finite = self.not_finite + 1, len(self.trace)
            if self.not_finite >= NOT_FINITE_IN_A_ROW:
                raise Stop(Status.NOT_FINITE)
            return np.inf
        self.not_finite = 0
        self.best.offer(x, cost, violation)
        return cost

    @property
    def interrupted(self) -> bool:
        """Whether somebody has pressed Ctrl-C."""
        return self._interrupts.pressed

    # Iterates.

    def optimality(self, x: Array, here: Linearization) -> float:
        """`Problem.optimality` at x (n,), less what rounding explains there."""
        return self.rounding_noise.optimality(x, here)

    def gain_ratio(
        self, x: Array, here: Linearization, to: Array, predicted: float, known: Known = None
    ) -> float:
        """The actual decrease of the cost from x to another point over the `predicted` one.

        What is `known` there is not evaluated. Where rounding hides both, it is 1 for a more
        stationary point; after several in a row that are not, the run ends.
        """
        self.check()  # a solver that tries shorter and shorter steps may never evaluate anything
        if not predicted > 0:
            return -np.inf
        cost, residual = self.tried(to, here.cost) if known is None else known
        if not isfinite(cost):
            return -np.inf
        moved, fallen = residual != here.residual, fall(here.residual, residual)
        hidden = self.rounding_noise.hides(max(predicted, fallen), x, here, moved)
        self.one_pass.judged(taken=hidden or fallen > 0)  # what is hidden is linearized
        if not hidden:
            return fallen / predicted
        if self.optimality(to, self.linearize(to)) <= POLISHED * self.optimality(x, here):
            self._unpolished = 0
            return 1.0
        self._unpolished += 1
        if self._unpolished > TRIES:
            self.stall()
        return -np.inf

    def begin(self) -> Linearization:
        """The linearization at the start, which is the first iterate."""
        here = self.linearize(self.x)
        self.record(self.x, here.cost, here)
        return here

    def move(
        self, to: Array, damping: float = 0.0, linear_algebra: str = ""
    ) -> tuple[Array, Linearization]:
        """The next iterate, and the linearization there.

        It is `to` (n,) with rotation vectors of at most half a turn, where neither the cost nor a
        bound forbids that.
        """
        there = self.linearize(to)

        def is_free(turned: Array) -> bool:
            return self.cost(turned) <= there.cost + self.rounding_noise.of_cost(to, there)

        here = self.linearize(x := rewrapped(self.problem, to, is_free))
        self.record(x, here.cost, here, damping, linear_algebra)
        return x, here

    def record(
        self,
        x: Array,
        cost: float,
        here: Linearization | None = None,
        damping: float = 0.0,
        linear_algebra: str = "",
    ) -> None:
        """Add an iterate to the trace, and its optimality if it was linearized `here`.

        Stops the run if it has converged, its iterations are used up, or the callback says so.
        """
        optimality = np.nan if here is None else self.optimality(x, here)
        way = x - (x if self._recorded is None else self._recorded)
        self._recorded = x.copy()
        values, counts = self.problem.free.unpack(x, self._around), Evaluations(**self.meter.counts)
        so_far = counts, self.meter.seconds
        iterate = Iterate(
            values, cost, optimality, sqrt(way @ way), damping, *so_far, linear_algebra
        )
        self.trace.append(iterate)
        if here is not None and not isnan(optimality):
            prefer_stationary(self, x, cost, here, optimality)
        asked: Stop | None = None
        if self.callback is not None:
            with self._interrupts.raised_at_once():
                asked = stop_asked(self.callback(iterate))
        self._interrupts.check()
        if optimality <= self.limits.gradient_tolerance:
            raise Stop(Status.CONVERGED)
        if asked is not None:
            raise asked
        if len(self.trace) > self.limits.max_iterations:
            raise Stop(Status.MAX_ITERATIONS)

    def stall(self, message: str = "") -> NoReturn:
        """End the run because no better point is found, for the reason in `message` if given."""
        if len(self.trace) - self.met_not_finite <= 1:  # in the last step or the one before
            raise Stop(Status.NOT_FINITE)
        raise Stop(Status.STALLED, message)

    def solution(self) -> Solution:
        """The best point and how the run ended, which is STOPPED after Ctrl-C, even at its end."""
        stop = self.stopped or Stop(Status.STALLED)
        with closing(self._interrupts), unwarned(), limited_threads():
            told = vars(ending(self, stop))
        if self._interrupted or self.interrupted:
            late = ", after it had converged" if told["status"] is Status.CONVERGED else ""
            told |= {"status": Status.STOPPED, "message": INTERRUPTED + late}
        return Solution(
            values=self.problem.free.unpack(self.best.x, self._around),
            cost=self.best.cost,
            solver=self.name,
            evaluations=Evaluations(**self.meter.counts),
            seconds=self.meter.seconds,
            trace=tuple(self.trace),
            violation=max(self.best.violation, 0.0) if np.isfinite(self.best.cost) else 0.0,
            **told,
        )
