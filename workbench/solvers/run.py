"""One run of a solver on a problem: its evaluations, its iterates, its best point, its limits."""

from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import asdict, replace
from math import isfinite, isnan, sqrt
from types import TracebackType
from typing import Any, NamedTuple, NoReturn, TypeVar

import numpy as np

from workbench.arrays import Array, Mask
from workbench.blocks import Values
from workbench.interrupts import Interrupts
from workbench.problem import Linearization, Problem, storage
from workbench.problem.optimality import Rounding, all_finite, decrease, half_squared
from workbench.problem.steps import automatic, cholesky, sparing
from workbench.problem.storage import Stored, entries
from workbench.solvers.abilities import refuse
from workbench.solvers.judgement import (
    GAIN_BY_VIOLATION,
    LOOSE_TOLERANCE,
    SHOWS_NOTHING,
    end_point,
    ending,
    rewrapped,
    running_off,
)
from workbench.solvers.limits import GUARDED, Limits, Meter, Stop, stop_asked, stop_of, unwarned
from workbench.solvers.solution import Callback, Evaluations, Iterate, Solution, Status
from workbench.threads import limited_threads

T = TypeVar("T")
Evaluated = tuple[float, Array]  # the cost and the residual (m,) at a point
NOT_FINITE_IN_A_ROW = 100  # a line search that halves has long met rounding by then
POLISHING_TRIES = 6  # for a more stationary point, each step more cautious than the last
INTERRUPTED = "interrupted from the keyboard"
DIVERGENCE_LOOKED_AT = (128, 256, 512, 1024)  # iterates: does the cost fall for ever?
CLEARLY_ABOVE = 100.0  # times the rounding errors of a few points ago: these do not matter
REMEASURED_AFTER = 5  # linearizations, rounding errors are measured in any case
BY_NORMAL_EQUATIONS = (automatic, cholesky, sparing)
ONE_PASS_UP_TO = 2**26  # bytes of a Jacobian, of which two are in memory at a time
TOO_COSTLY = 1.001  # times the cost: the Jacobian of a trial that costs more is not looked at
MORE_STATIONARY = 0.99  # of the optimality before, at most, where costs do not tell points apart


class Run:
    """One run of a solver: a context that ends with a Stop, after which `solution` says how.

    A solver calls `begin`, then `gain_ratio` (or `cost`) at every trial point, and `move` to one
    that it takes. These evaluate at flat vectors and count that; each point is offered to `best`,
    and each iterate goes into the `trace`. Stop is raised when a limit is reached. An interrupt
    from the keyboard also ends the run and keeps the best point: until `solution` returns, signals
    are noted and looked at before every evaluation. Linear algebra uses WORKBENCH_THREADS threads.
    Raises NotSupported, before anything is evaluated, for a problem that the solver does not take.
    """

    def __init__(
        self, name: str, solver: Limits, problem: Problem, start: Values, callback: Callback
    ) -> None:
        refuse(name, solver.abilities, problem)
        self.name, self.limits, self.problem, self.callback = name, solver, problem, callback
        x, self.fixed = problem.split(start)
        self.x = np.clip(x, problem.lower, problem.upper)
        self._fixed_values = problem.fixed.unpack(self.fixed) if problem.free.parts else None
        self.meter = Meter(asdict(Evaluations()), solver.max_evaluations, solver.max_seconds)
        self.trace: list[Iterate] = []
        self.best = Best(self.x)
        self.stopped: Stop | None = None
        self._not_finite_in_a_row = 0  # points at which the residual was NaN or infinite
        self._last_not_finite = -2  # how long the trace was at the last of them
        self.longest_columns = np.zeros(self.x.size)  # of the Jacobian, at all points
        self._unpolished = 0  # tries in a row that did not lead to a more stationary point
        self.linearizations = LinearizationCache()
        self.rounding_noise = RoundingNoise(problem, self.fixed, self.linearizations)
        self._last_recorded: Array | None = None  # iterate
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

    def cost_and_residual(self, x: Array) -> Evaluated:
        """The cost at x (n,) and the residual (m,) there; see `cost`."""
        if (here := self.linearizations.at(x)) is not None:
            self.check()
            return here.cost, here.residual  # it was offered to `best` before
        r = self.evaluate("residual", lambda: self.problem.residual(x, self.fixed))
        return self._offer(x, half_squared(r)), r

    def evaluate_trial(self, to: Array, before: float) -> Evaluated:
        """The cost and the residual (m,) at a trial point (n,); the last cost was `before`.

        If `one_pass` expects that it is taken, it is linearized at once.
        """
        at_once = self.linearizations.at(to) is None and self.one_pass.expected()
        evaluated = self._linearize(to, TOO_COSTLY * before) if at_once else None
        return evaluated or self.cost_and_residual(to)

    def cost_and_gradient(self, x: Array) -> tuple[float, Array]:
        """The cost and its gradient at x, by one reverse sweep."""
        cost, g = self.evaluate("gradient", lambda: self.problem.cost_and_gradient(x, self.fixed))
        return self._offer(x, cost if all_finite(g) else np.inf), g

    def linearize(self, x: Array) -> Linearization:
        """Residual and Jacobian at x; stops the run where they are not finite."""
        if (here := self.linearizations.at(x)) is not None:
            return here
        self.check()
        self.linearizations.forget()  # first: memory that is used again is already there, and near
        self._linearize(x)
        if (here := self.linearizations.at(x)) is None:
            raise Stop(Status.NOT_FINITE)
        return here

    def _linearize(self, x: Array, most: float = np.inf) -> Evaluated | None:
        """Linearize at x; kept if it is finite and costs at most `most`. None if not finite."""
        here = self.evaluate("jacobian", lambda: self.problem.linearize_at(x, self.fixed))
        if not here.cost <= most:
            return self._offer(x, here.cost), here.residual
        if self.one_pass.on:
            _ = here.normal  # with the gradient and the lengths of columns
        if not isfinite(self._offer(x, here.cost if here.finite else np.inf, here)):
            return None
        self.longest_columns = np.maximum(self.longest_columns, here.column_norms)
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
        if (constraints := self.problem.stacked_constraints) is None:
            return np.zeros(0)
        return self.evaluate("constraint", lambda: constraints.values(x, self.fixed))

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

    def _offer(self, x: Array, cost: float, here: Linearization | None = None) -> float:
        """Offer an evaluated point to `best`; its cost, or infinity if it is not finite there.

        Stops the run after too many points in a row that are not finite.
        """
        constraints, violation = self.problem.stacked_constraints, 0.0
        if constraints is not None and isfinite(cost):
            linearized = None if here is None else here.constraints
            values = self.constraints(x) if linearized is None else linearized.values
            violation = constraints.violation(values)
        if not (isfinite(cost) and isfinite(violation)):
            self._not_finite_in_a_row += 1
            self._last_not_finite = len(self.trace)
            if self._not_finite_in_a_row >= NOT_FINITE_IN_A_ROW:
                raise Stop(Status.NOT_FINITE)
            return np.inf
        self._not_finite_in_a_row = 0
        if not isfinite(self.best.cost):
            self.rounding_noise.first_cost = cost
        self.best.offer(x, cost, violation)
        return cost

    @property
    def interrupted(self) -> bool:
        """Whether somebody has pressed Ctrl-C."""
        return self._interrupts.pressed

    # Iterates.

    def gain_ratio(self, x: Array, here: Linearization, to: Array, predicted: float) -> float:
        """The actual decrease of the cost from x to another point over the `predicted` one.

        Where rounding hides both decreases, the ratio is 1 for a more stationary point and minus
        infinity for others; after several of these in a row, the run ends.
        """
        self.check()  # a solver that tries shorter and shorter steps may never evaluate anything
        if not predicted > 0:
            return -np.inf
        cost, residual = self.evaluate_trial(to, here.cost)
        if not isfinite(cost):
            return -np.inf
        moved, fall = residual != here.residual, decrease(here.residual, residual)
        hidden = self.rounding_noise.hides(max(predicted, fall), x, here, moved)
        self.one_pass.judged(taken=hidden or fall > 0)  # what is hidden is linearized
        if not hidden:
            return fall / predicted
        optimality = self.rounding_noise.optimality
        if optimality(to, self.linearize(to)) <= MORE_STATIONARY * optimality(x, here):
            self._unpolished = 0
            return 1.0
        self._unpolished += 1
        if self._unpolished > POLISHING_TRIES:
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
        at_end = self.linearize(to)

        def is_free(wrapped: Array) -> bool:
            return self.cost(wrapped) <= at_end.cost + self.rounding_noise.of_cost(to, at_end)

        x = rewrapped(self.problem, to, is_free)
        here = self.linearize(x)
        self.record(x, here.cost, here, damping, linear_algebra, to)
        return x, here

    def record(
        self,
        x: Array,
        cost: float,
        here: Linearization | None = None,
        damping: float = 0.0,
        linear_algebra: str = "",
        to: Array | None = None,
    ) -> None:
        """Add an iterate to the trace, and its optimality if it was linearized `here`.

        The step led `to` (n,) if that is not x: rotation vectors may have been shortened since.
        Stops the run if it has converged, its iterations are used up, or the callback says so.
        """
        optimality = np.nan if here is None else self.rounding_noise.optimality(x, here)
        before = x if self._last_recorded is None else self._last_recorded
        step = (x if to is None else to) - before
        self._last_recorded = x.copy()
        iterate = Iterate(
            values=self.problem.free.unpack(x, self._fixed_values),
            cost=cost,
            optimality=optimality,
            step_norm=sqrt(step @ step),
            damping=damping,
            evaluations=Evaluations(**self.meter.counts),
            seconds=self.meter.seconds,
            linear_algebra=linear_algebra,
        )
        self.trace.append(iterate)
        if here is not None and not isnan(optimality):
            self._settle(x, cost, here, optimality)
        by_callback: Stop | None = None
        if self.callback is not None:
            with self._interrupts.raised_at_once():
                by_callback = stop_asked(self.callback(iterate))
        self._interrupts.check()
        if optimality <= self.limits.gradient_tolerance:
            raise Stop(Status.CONVERGED)
        if len(self.trace) in DIVERGENCE_LOOKED_AT and here is not None and self._runs_off(x, here):
            raise Stop(Status.NO_FINITE_MINIMUM)
        if by_callback is not None:
            raise by_callback
        if len(self.trace) > self.limits.max_iterations:
            raise Stop(Status.MAX_ITERATIONS)

    def _settle(self, x: Array, cost: float, here: Linearization, optimality: float) -> None:
        """Prefer this point (n,) to the best one if it is more stationary and costs the same.

        Costs are the same up to rounding, 1/2 (tolerance |r|)^2, and what the tolerances of
        constraints allow.
        """
        constraints = self.problem.stacked_constraints
        noise = self.rounding_noise.recent(x, here).of_cost(here.residual)
        noise += self.limits.gradient_tolerance**2 * cost
        if constraints is None:
            self.best.settle(x, cost, 0.0, optimality, noise)
        elif here.constraints is not None:
            violation = constraints.violation(here.constraints.values)
            self.best.settle(x, cost, violation, optimality, GAIN_BY_VIOLATION * cost + noise)

    def _runs_off(self, x: Array, here: Linearization) -> bool:
        """Whether unknowns grow without limit, at the best point x (n,) of a long run."""
        if self.limits.gradient_tolerance >= LOOSE_TOLERANCE or not np.array_equal(x, self.best.x):
            return False
        try:
            return bool(running_off(self, end_point(self, here)).any())
        except SHOWS_NOTHING:
            return False

    def stall(self, message: str = "") -> NoReturn:
        """End the run because no better point is found, for the reason in `message` if given."""
        if len(self.trace) - self._last_not_finite <= 1:  # in the last step or the one before
            raise Stop(Status.NOT_FINITE)
        raise Stop(Status.STALLED, message)

    def solution(self) -> Solution:
        """The best point and how the run ended, which is STOPPED after Ctrl-C, even at its end."""
        stop = self.stopped or Stop(Status.STALLED)
        with closing(self._interrupts), unwarned(), limited_threads():
            end = ending(self, stop)
        if self._interrupted or self.interrupted:
            late = ", after it had converged" if end.status is Status.CONVERGED else ""
            end = replace(end, status=Status.STOPPED, message=INTERRUPTED + late)
        return Solution(
            values=self.problem.free.unpack(self.best.x, self._fixed_values),
            cost=self.best.cost,
            solver=self.name,
            evaluations=Evaluations(**self.meter.counts),
            seconds=self.meter.seconds,
            trace=tuple(self.trace),
            violation=max(self.best.violation, 0.0) if np.isfinite(self.best.cost) else 0.0,
            **vars(end),
        )


class _Settled(NamedTuple):
    """A feasible point of known optimality, whose cost is uncertain by `noise`."""

    x: Array
    cost: float
    violation: float
    optimality: float
    noise: float


class Best:
    """The feasible point of lowest cost; as long as there is none, that of the least violation.

    Where costs differ by no more than rounding, the more stationary point is the best one.

    Attributes:
        x: (n,) the point.
        cost: the cost there.
        violation: by how many tolerances the worst constraint is exceeded there.
    """

    def __init__(self, start: Array) -> None:
        self.x, self.cost, self.violation = start.copy(), np.inf, np.inf
        self._settled: _Settled | None = None

    def offer(self, x: Array, cost: float, violation: float) -> None:
        """Take a point with a finite cost if it is better; `violation` is in tolerances."""
        if violation <= 1 and self.violation <= 1:
            better = cost < self.cost
        else:
            better = (violation, cost) < (self.violation, self.cost)
        if better:
            self.x, self.cost, self.violation = x.copy(), cost, violation

    def settle(
        self, x: Array, cost: float, violation: float, optimality: float, noise: float
    ) -> None:
        """Remember a point of known optimality, whose cost is uncertain by `noise`."""
        if violation > 1 or self.violation > 1 or not cost <= self.cost + noise:
            return
        last = self._settled
        if last is None or optimality < last.optimality or self._is_better_than(last):
            self._settled = _Settled(x.copy(), cost, violation, optimality, noise)

    def decide(self, optimality: float) -> float:
        """Prefer the settled point if it costs the same and is more stationary than the best.

        Takes the optimality of the best point, and returns that of the chosen one.
        """
        settled = self._settled
        if settled is None or self._is_better_than(settled) or optimality <= settled.optimality:
            return optimality
        self.x, self.cost, self.violation = settled.x, settled.cost, settled.violation
        return settled.optimality

    def _is_better_than(self, settled: _Settled) -> bool:
        """Whether the best point costs less by more than rounding explains."""
        return self.cost + settled.noise < settled.cost


class LinearizationCache:
    """One linearization, the point where it was made, and what was measured there.

    Only one is kept, because Jacobians are large and the next one can use the same memory.
    """

    def __init__(self) -> None:
        self._point = b""
        self._here: Linearization | None = None
        self._measured: dict[str, Any] = {}

    def at(self, x: Array) -> Linearization | None:
        """The linearization if it was made at x (n,), else None."""
        return self._here if self._here is not None and self._point == x.tobytes() else None

    def forget(self) -> None:
        """Free the memory of the linearization and of everything measured there."""
        self._here, self._measured = None, {}

    def keep(self, x: Array, here: Linearization) -> None:
        """Keep a linearization at x (n,) in place of the one before."""
        self._point, self._here, self._measured = x.tobytes(), here, {}

    def once(self, what: str, here: Linearization, measure: Callable[[], T]) -> T:
        """The result of `measure`, which is called once for the linearization that is kept.

        `what` names the quantity. For any other linearization it is measured every time.
        """
        if here is not self._here:
            return measure()
        if what not in self._measured:
            self._measured[what] = measure()
        measured: T = self._measured[what]
        return measured


class RoundingNoise:
    """How much rounding errors hide at the points of a run.

    To measure them takes up to a tenth of the time of a linearization; during most of a run, the
    measurement at an earlier point is enough to tell that they are much smaller than the residual.
    """

    def __init__(self, problem: Problem, fixed: Array, linearizations: LinearizationCache) -> None:
        self._problem, self._fixed, self._linearizations = problem, fixed, linearizations
        self._last: Rounding | None = None
        self.age = 0  # of the last measurement, in linearizations
        self.first_cost = np.inf  # at the start: far below its residual nothing matters

    def at(self, x: Array, here: Linearization) -> Rounding:
        """How much of each row of the residual may be rounding error at x (n,), measured there.

        At a far start it may be larger than all of the residual at the minimum.
        """

        def measure() -> Rounding:
            r = here.residual
            floor = min(1.0, sqrt(2 * self.first_cost / max(r.size, 1)))
            with GUARDED:
                self._last, self.age = self._problem.rounding(x, self._fixed, r, floor), 0
            return self._last

        return self._linearizations.once("rounding", here, measure)

    def of_cost(self, x: Array, here: Linearization) -> float:
        """By how much rounding may have changed the cost at x (n,)."""
        return self.at(x, here).of_cost(here.residual)

    def recent(self, x: Array, here: Linearization) -> Rounding:
        """The rounding errors measured a few points ago, or those at x (n,) if there are none."""
        return self._recent or self.at(x, here)

    def optimality(self, x: Array, here: Linearization) -> float:
        """`Problem.optimality` at x (n,), less what rounding explains there."""

        def measure() -> float:
            if (last := self._recent) is not None:
                optimality = self._problem.optimality(x, here)
                gradient = optimality * min(1.0, float(np.sqrt(2 * here.cost)))
                if gradient > CLEARLY_ABOVE * last.norm:
                    return optimality
            return self._problem.optimality(x, here, self.at(x, here))

        return self._linearizations.once("optimality", here, measure)

    def hides(
        self, predicted: float, x: Array, here: Linearization, moved: Mask | None = None
    ) -> bool:
        """Whether rounding may hide that the cost falls from x (n,) by as much as `predicted`.

        If `moved` (m,) is given, only these rows of the residual count.
        """
        last = self._recent
        if last is not None and predicted > CLEARLY_ABOVE * last.of_cost(here.residual):
            return False
        rounding = self.at(x, here)
        if moved is None:
            return predicted <= rounding.of_cost(here.residual)
        return predicted <= rounding.of_decrease(here.residual, moved)

    @property
    def _recent(self) -> Rounding | None:
        return self._last if self.age < REMEASURED_AFTER else None


class OnePass:
    """Whether a run computes residual, Jacobian and normal equations together, also at trials.

    Attributes:
        on: whether they are computed together.
        at_once: how many trials were linearized at once.
        saved: how many evaluations of the residual were saved, because such a trial was taken.
    """

    def __init__(self, on: bool) -> None:
        self.on, self.at_once, self.saved = on, 0, 0
        self._last_refused = self._last_at_once = False
        self._trials = 0  # since the last that was judged

    def expected(self) -> bool:
        """Whether to linearize the next trial; it counts as refused until it is `judged`."""
        self._last_at_once, self._last_refused = self.on and not self._last_refused, True
        self.at_once += self._last_at_once
        self._trials += 1
        return self._last_at_once

    def judged(self, taken: bool) -> None:
        """Whether the last trial was taken; a line search says so at the end."""
        self.saved += self._last_at_once and taken
        self._last_refused = not taken or self._trials > 1
        self._last_at_once, self._trials = False, 0


def takes_one_pass(solver: Limits, problem: Problem) -> bool:
    """Whether a run computes the normal equations with each Jacobian, and Jacobians of trials.

    So it does where its steps come from normal equations, which compiled code computes with the
    gradient and the lengths of columns. A posed surface and its derivative read the same arrays.
    """
    linear_algebra = getattr(solver, "linear_algebra", None)
    return linear_algebra in BY_NORMAL_EQUATIONS and has_one_pass(problem)


def has_one_pass(problem: Problem) -> bool:
    """Whether compiled code computes the normal equations with the gradient and column lengths."""
    if problem.sparse:
        return False
    m, n = problem.size, problem.free.size
    return (
        storage.worthwhile(m, n)
        and 8 * m * n <= ONE_PASS_UP_TO
        and storage.compiled_gram() is not None
    )
