"""A problem that counts what it is asked, times it, and keeps the best point, whoever asks."""

import copy
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from workbench.comparison.feasible import feasible
from workbench.problem import Problem
from workbench.problem.chain import half_squared
from workbench.solvers import Evaluations, Status
from workbench.solvers.limits import Stop

Array = NDArray[np.float64]
T = TypeVar("T")
Complete = Callable[[Array, Array], Array]
Evaluate = Callable[[Array, Array], T]
KINDS = ("residual", "gradient", "jacobian", "hessian")
HEAD = 12  # n, rows, 4 counts, 4 times, not finite, seconds
ROW = 6  # 4 counts, seconds, cost
CLOSING = 3  # evaluations after the last one that counts
ROWS = 20_000  # improvements that are kept


@dataclass(frozen=True, eq=False)
class Seen:
    """What a watch saw: the best point and, for every improvement, when it came."""

    evaluations: Evaluations
    spent: tuple[float, ...]  # s in the problem, by kind
    not_finite: int  # evaluations whose cost was NaN or infinite
    seconds: float
    best: Array  # (n,), empty if no cost was finite
    trace: Array  # (k, 6): evaluations by kind, s, cost, which falls


class Log:
    """A file that is mapped into memory: what is in it outlives the process that wrote it."""

    def __init__(self, path: str | Path, n: int) -> None:
        self.n = n
        shape = (HEAD + n + ROW * ROWS,)
        self.numbers = np.memmap(path, dtype=float, mode="w+", shape=shape)
        self.numbers[0] = n

    def better(self, x: Array, row: tuple[float, ...]) -> None:
        """One more improvement; when the file is full the last one gives way."""
        k = min(int(self.numbers[1]), ROWS - 1)
        at = HEAD + self.n + ROW * k
        self.numbers[at : at + ROW] = row
        self.numbers[HEAD : HEAD + self.n] = x
        self.numbers[1] = k + 1

    @staticmethod
    def read(path: str | Path) -> Seen:
        """What is there by now."""
        numbers = np.fromfile(path, dtype=float)
        if numbers.size < HEAD:
            empty = np.zeros(0)
            return Seen(Evaluations(), (0.0,) * 4, 0, 0.0, empty, empty.reshape(0, ROW))
        n, rows = int(numbers[0]), int(numbers[1])
        counts = [int(c) for c in numbers[2:6]]
        trace = numbers[HEAD + n : HEAD + n + ROW * rows].reshape(rows, ROW)
        best = numbers[HEAD : HEAD + n] if rows else numbers[:0]
        spent = tuple(float(s) for s in numbers[6:10])
        return Seen(
            Evaluations(*counts), spent, int(numbers[10]), float(numbers[11]), best.copy(),
            trace.copy(),
        )  # fmt: skip


class Watch:
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
        self._counts, self._spent = dict.fromkeys(KINDS, 0), dict.fromkeys(KINDS, 0.0)
        self._not_finite, self._best, self._paused = 0, np.inf, 0.0
        self._began = time.perf_counter()

    @property
    def seconds(self) -> float:
        """On the clock."""
        return time.perf_counter() - self._began - self._paused

    def watched(self) -> Problem:
        """A copy of the problem whose evaluations are seen here; it shares all that is built.

        So are those of the same problem with other blocks free, whose points are completed by
        what is fixed. Without some of its residuals a problem has another cost: evaluations of
        that are counted, and make no progress.
        """
        return self._copied(self._problem, lambda x, fixed: x)

    def _copied(self, problem: Problem, whole: Complete | None) -> Problem:
        def asked(kind: str, cost: Callable[[T], float], compute: Evaluate[T]) -> Evaluate[T]:
            def evaluate(x: Array, fixed: Array) -> T:
                answer, seconds = self._asked(kind, lambda: compute(x, fixed))
                if whole is not None and kind != "hessian":
                    at = np.asarray(x, dtype=float).ravel()
                    told = float(cost(answer))
                    self._heard(lambda: whole(at, fixed), told, seconds)
                self._note(seconds)
                return answer

            return evaluate

        def hessian(x: Array, fixed: Array) -> Array:
            with self._standing_still():
                _ = problem.hessian
            return asked("hessian", lambda H: np.nan, problem.hessian_at)(x, fixed)

        def freeing(*names: str) -> Problem:
            part = problem.freeing(*names)
            complete = None if whole is None else _completing(part, self._problem)
            return self._copied(part, complete)

        copied = copy.copy(problem)
        vars(copied).update(  # methods of this one copy
            residual=asked("residual", half_squared, problem.residual),
            cost_and_gradient=asked("gradient", lambda both: both[0], problem.cost_and_gradient),
            linearize_at=asked("jacobian", lambda here: here.cost, problem.linearize_at),
            hessian_at=hessian,
            freeing=freeing,
            without=lambda *names: self._copied(problem.without(*names), None),
        )
        return copied

    def _asked(self, kind: str, compute: Callable[[], T]) -> tuple[T, float]:
        """The answer, and the time on the clock when it came."""
        if sum(self._counts.values()) >= self._most + CLOSING:
            raise Stop(Status.MAX_EVALUATIONS)
        before = self.seconds
        if before > self._longest + self._closing:
            raise Stop(Status.MAX_SECONDS)
        self._counts[kind] += 1
        answer = compute()
        after = self.seconds
        self._spent[kind] += after - before
        return answer, after

    def _heard(self, at: Callable[[], Array], cost: float, seconds: float) -> None:
        if not np.isfinite(cost):
            self._not_finite += 1
        elif cost < self._best and self._within(seconds):
            with self._standing_still():
                x = at()
                allowed = feasible(self._problem, x, self._fixed)
            if allowed:
                self._best = cost
                self._log.better(x, (*self._counts.values(), seconds, cost))

    def _within(self, seconds: float) -> bool:
        return sum(self._counts.values()) <= self._most and seconds <= self._longest

    def _note(self, seconds: float) -> None:
        self._log.numbers[2:HEAD] = (
            *self._counts.values(), *self._spent.values(), self._not_finite, seconds
        )  # fmt: skip

    @contextmanager
    def _standing_still(self) -> Iterator[None]:
        before = time.perf_counter()
        yield
        self._paused += time.perf_counter() - before


def _completing(part: Problem, problem: Problem) -> Complete:
    """From the numbers of a part, free and fixed, to the free ones of the whole problem."""
    return lambda x, fixed: problem.free.pack(part.free.unpack(x) | part.fixed.unpack(fixed))
