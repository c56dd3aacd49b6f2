"""A problem that counts what it is asked, times it, and keeps the best point, whoever asks."""

import copy
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from workbench.problem import Linearization, Problem
from workbench.solvers import Evaluations, Status
from workbench.solvers.limits import Stop

Array = NDArray[np.float64]
T = TypeVar("T")
KINDS = ("residual", "gradient", "jacobian", "hessian")
HEAD = 12  # n, rows, 4 counts, 4 times, not finite, seconds
ROW = 6  # 4 counts, seconds, cost
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
    still while a graph is built.
    """

    def __init__(
        self, problem: Problem, max_evaluations: int, max_seconds: float, log: Log
    ) -> None:
        self._problem, self._log = problem, log
        self._most, self._longest = max_evaluations, max_seconds
        self._counts, self._spent = dict.fromkeys(KINDS, 0), dict.fromkeys(KINDS, 0.0)
        self._not_finite, self._best, self._paused = 0, np.inf, 0.0
        self._lower = problem.lower - 1e-9 * np.maximum(1, abs(problem.lower))
        self._upper = problem.upper + 1e-9 * np.maximum(1, abs(problem.upper))
        self._began = time.perf_counter()

    @property
    def seconds(self) -> float:
        """On the clock."""
        return time.perf_counter() - self._began - self._paused

    def watched(self) -> Problem:
        """A copy of the problem whose evaluations are seen here; it shares all that is built."""
        problem = self._problem
        copied = copy.copy(problem)
        vars(copied).update(  # methods of this one copy
            residual=lambda x, fixed: self._asked(
                "residual", x, lambda: problem.residual(x, fixed), lambda r: 0.5 * float(r @ r)
            ),
            cost_and_gradient=lambda x, fixed: self._asked(
                "gradient", x, lambda: problem.cost_and_gradient(x, fixed), lambda found: found[0]
            ),
            linearize_at=lambda x, fixed: self._asked(
                "jacobian", x, lambda: problem.linearize_at(x, fixed), _cost
            ),
            hessian_at=self._hessian,
        )
        return copied

    def _hessian(self, x: Array, fixed: Array) -> Array:
        before = time.perf_counter()
        _ = self._problem.hessian
        self._paused += time.perf_counter() - before
        return self._asked(
            "hessian", x, lambda: self._problem.hessian_at(x, fixed), lambda H: np.nan
        )

    def _asked(
        self, kind: str, x: Array, compute: Callable[[], T], cost_of: Callable[[T], float]
    ) -> T:
        if sum(self._counts.values()) >= self._most:
            raise Stop(Status.MAX_EVALUATIONS)
        before = time.perf_counter()
        if before - self._began - self._paused > self._longest:
            raise Stop(Status.MAX_SECONDS)
        self._counts[kind] += 1
        answer = compute()
        after = time.perf_counter()
        self._spent[kind] += after - before
        seconds = after - self._began - self._paused
        if kind != "hessian":
            self._heard(np.asarray(x, dtype=float).ravel(), float(cost_of(answer)), seconds)
        self._log.numbers[2:HEAD] = (
            *self._counts.values(), *self._spent.values(), self._not_finite, seconds
        )  # fmt: skip
        return answer

    def _heard(self, x: Array, cost: float, seconds: float) -> None:
        if not np.isfinite(cost):
            self._not_finite += 1
        elif cost < self._best and ((self._lower <= x) & (x <= self._upper)).all():
            self._best = cost
            self._log.better(x, (*self._counts.values(), seconds, cost))


def _cost(here: Linearization) -> float:
    return here.cost
