"""Further attempts to solve, where the end of one is no minimum or probably not the best.

`doubt` says which ends these are. Attempts differ in their first step and in how they measure
steps; the lowest end counts.
"""

from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from typing import NamedTuple

from workbench.interrupts import Interrupts
from workbench.solvers.doubt import is_creeping, is_doubtful
from workbench.solvers.limits import Stop, limited, stop_asked
from workbench.solvers.run import INTERRUPTED, Run
from workbench.solvers.solution import Callback, Iterate, Solution, Status

LOWER = 1e-6  # of the cost: a smaller decrease is none
PATIENCE = 0.25  # of the evaluations of the first attempt, until a further one must be lower
AT_LEAST = 50  # evaluations until then: a first attempt may end early, with a loose tolerance
HALF = 0.5  # of the iterations or the evaluations: an attempt that creeps is put aside


class Left(NamedTuple):
    """What is left of the limits of a solver.

    Attributes:
        iterations: steps.
        evaluations: of all kinds that are limited.
        seconds: wall time in s.
    """

    iterations: int
    evaluations: int
    seconds: float

    def after(self, end: Solution) -> "Left":
        """What is left after one more attempt."""
        return Left(
            self.iterations - end.iterations,
            self.evaluations - end.evaluations.total,
            self.seconds - end.seconds,
        )


AfterStep = Callable[[Run], None]
Attempt = Callable[[int, Left, Callback, AfterStep], Solution]


class Attempts:
    """A first attempt and, where its end is doubtful, further ones from the same start.

    They are made in turn, each once, until an end that is the lowest so far is not doubtful. One
    that is not lower after a quarter of the evaluations of the first is given up; 50 are always
    allowed. An attempt that creeps while it uses up its iterations or its evaluations is put aside
    when it has used half of either, and goes on if no further attempt becomes lower. Time is not
    looked at for this, so that a run is the same on a slower machine.
    """

    def __init__(self, attempt: Attempt, most: int) -> None:
        """`attempt` makes the one of a number below `most`, and calls its last argument after each
        step.
        """
        self._attempt, self._most, self._made = attempt, most, 0

    def solve(self, left: Left, callback: Callback) -> Solution:
        """The lowest end, with the evaluations and the time of all attempts and its own trace."""
        first = self._next(left, callback)
        return self._further(first, left, callback)[0] if is_doubtful(first) else first

    def _next(self, left: Left, callback: Callback) -> Solution:
        """The end of the next attempt, or a lower one of those that were made in its middle."""
        number, self._made = self._made, self._made + 1
        lower: Solution | None = None
        passed, spent = False, 0  # whether half of the limits is; steps of others since then

        def after_step(run: Run) -> None:
            nonlocal lower, passed, spent
            steps, used = len(run.trace) - 1, limited(run.meter.counts)
            if spent and steps + spent >= left.iterations:
                raise Stop(Status.MAX_ITERATIONS)
            if passed or max(steps / left.iterations, used / left.evaluations) < HALF:
                return
            passed = True
            if self._made == self._most or not is_creeping(run.trace):
                return
            here = _so_far(run)
            found, spent = self._further(here, left, callback)
            run.meter.counts |= asdict(found.evaluations)
            lower = found if found.cost < here.cost else None
            if found.status is Status.STOPPED:
                raise Stop(Status.STOPPED, found.message)
            if lower is not None:
                raise Stop(Status.STALLED)  # its own steps are not counted any more

        end = self._attempt(number, left, callback, after_step)
        if lower is None:
            return end
        return replace(lower, seconds=end.seconds, judging=lower.judging + end.judging)

    def _further(self, first: Solution, left: Left, callback: Callback) -> tuple[Solution, int]:
        """The lowest of the `first` end and those of the attempts that are left, and their steps.

        It is STOPPED if one of them was stopped. `left` is what the first had.
        """
        longest, steps = max(PATIENCE * first.evaluations.total, AT_LEAST), 0
        best, left = first, left.after(first)
        while self._made < self._most and min(left) > 0:
            second, why = tried(best, partial(self._next, left), callback, longest)
            is_lower = second.cost < best.cost * (1 - LOWER)
            best, left, steps = joined(best, second), left.after(second), steps + second.iterations
            if why:
                return replace(best, status=Status.STOPPED, message=why), steps
            if is_lower and not is_doubtful(second):
                break
        return best, steps


def _so_far(run: Run) -> Solution:
    """Where a run is, as if it ended there."""
    here = run.trace[-1]
    return Solution(
        here.values,
        here.cost,
        here.optimality,
        Status.STALLED,
        Status.STALLED.value,
        run.name,
        here.evaluations,
        here.seconds,
        tuple(run.trace),
    )


def joined(first: Solution, second: Solution) -> Solution:
    """The lower one of two ends, with the evaluations and the time of both.

    The trace is that of the lower one's attempt.
    """
    best = first
    if second.cost < first.cost * (1 - LOWER):
        best = replace(
            second,
            trace=tuple(after(first, iterate) for iterate in second.trace),
            message=f"{second.message}; an earlier attempt ended higher, at {first.cost:.6g}",
        )
    return replace(
        best,
        evaluations=first.evaluations + second.evaluations,
        seconds=first.seconds + second.seconds,
        judging=first.judging + second.judging,
    )


def after(first: Solution, iterate: Iterate) -> Iterate:
    """An iterate of a further attempt, with the evaluations and the time of the first one."""
    return replace(
        iterate,
        evaluations=first.evaluations + iterate.evaluations,
        seconds=first.seconds + iterate.seconds,
    )


def tried(
    first: Solution, attempt: Callable[[Callback], Solution], callback: Callback, longest: float
) -> tuple[Solution, str]:
    """The end of a further `attempt`, which takes a callback, and why all is to stop, if it is.

    The attempt is given up if it has not been lower than the `first` end after more evaluations
    than `longest`. An interrupt, or a `callback` that returns True, ends it.
    """
    lower, in_vain = False, False

    def told(iterate: Iterate) -> bool:
        nonlocal lower, in_vain
        asked = None if callback is None else stop_asked(callback(after(first, iterate)))
        lower = lower or iterate.cost < first.cost * (1 - LOWER)
        in_vain = asked is None and not lower and iterate.evaluations.total > longest
        return in_vain or asked is not None

    with Interrupts() as interrupts:  # also between the attempts
        second = attempt(told)
    if interrupts.pressed:
        return second, INTERRUPTED
    stopped = second.status is Status.STOPPED and not in_vain
    return second, second.message if stopped else ""
