"""What a metered problem records of a run, in a file that outlives the process that writes it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.arrays import Array
from workbench.solvers import Evaluations

KINDS = (  # of evaluations
    "residual",
    "gradient",
    "jacobian",
    "hessian",
    "constraint",
    "constraint_jacobian",
    "constraint_hessian",
)
LIMITED = 4  # of them a budget limits: all but those of the constraints
COUNTS = slice(2, 2 + len(KINDS))
SPENT = slice(COUNTS.stop, COUNTS.stop + len(KINDS))
NOT_FINITE, SECONDS, TAKEN = SPENT.stop, SPENT.stop + 1, SPENT.stop + 2
HEAD = TAKEN + 1  # n, rows, counts, times, and these three
ROW = len(KINDS) + 2  # counts, seconds, cost
ROWS = 20_000  # improvements that are kept


@dataclass(frozen=True, eq=False)
class Observed:
    """What a metered problem observed of one run.

    Attributes:
        counts: the number of evaluations by kind, in the order of KINDS.
        spent: the seconds spent in the problem by kind, likewise.
        not_finite: the number of evaluations whose cost was NaN or infinite.
        seconds: how long the run took.
        best: (n,) the point of least cost; empty if no cost was finite.
        trace: (k, kinds + 2) for every improvement the evaluations by kind, the seconds and the
            cost, which falls.
        taken: whether a graph was taken to where its evaluations cannot be counted.
    """

    counts: tuple[int, ...]
    spent: tuple[float, ...]
    not_finite: int
    seconds: float
    best: Array
    trace: Array
    taken: bool = False

    @property
    def evaluations(self) -> Evaluations:
        """In the words of the solvers, who do not tell kinds of constraints' evaluations apart."""
        residual, gradient, jacobian, hessian, *constraints = self.counts
        return Evaluations(residual, gradient, jacobian, hessian, sum(constraints))


class Log:
    """A file that is mapped into memory: what is in it outlives the process that wrote it."""

    def __init__(self, path: str | Path, n: int) -> None:
        self.n = n
        shape = (HEAD + n + ROW * ROWS,)
        self.numbers = np.memmap(path, dtype=float, mode="w+", shape=shape)
        self.numbers[0] = n

    def better(self, x: Array, counts: Array, seconds: float, cost: float) -> None:
        """Record an improvement; when the file is full it replaces the last one."""
        k = min(int(self.numbers[1]), ROWS - 1)
        at = HEAD + self.n + ROW * k
        self.numbers[at : at + ROW] = (*counts, seconds, cost)
        self.numbers[HEAD : HEAD + self.n] = x
        self.numbers[1] = k + 1

    def note(self, counts: Array, spent: Array, not_finite: int, seconds: float) -> None:
        """Record the counts, the seconds by kind, and the time until now."""
        self.numbers[COUNTS], self.numbers[SPENT] = counts, spent
        self.numbers[NOT_FINITE], self.numbers[SECONDS] = not_finite, seconds

    def taken(self) -> None:
        """Record that from now on not every evaluation can be counted."""
        self.numbers[TAKEN] = 1

    def ended(self, seconds: float) -> None:
        """Record the end of the run, and write everything to the file."""
        self.numbers[SECONDS] = seconds
        self.numbers.flush()

    @staticmethod
    def read(path: str | Path) -> Observed:
        """What a file holds, whether or not the process that writes it still lives."""
        numbers = np.fromfile(path, dtype=float)
        if numbers.size < HEAD:
            empty = np.zeros(0)
            nothing = (0,) * len(KINDS)
            return Observed(nothing, (0.0,) * len(KINDS), 0, 0.0, empty, empty.reshape(0, ROW))
        n, rows = int(numbers[0]), int(numbers[1])
        trace = numbers[HEAD + n : HEAD + n + ROW * rows].reshape(rows, ROW)
        best = numbers[HEAD : HEAD + n] if rows else numbers[:0]
        return Observed(
            tuple(int(c) for c in numbers[COUNTS]),
            tuple(float(s) for s in numbers[SPENT]),
            int(numbers[NOT_FINITE]),
            float(numbers[SECONDS]),
            best.copy(),
            trace.copy(),
            bool(numbers[TAKEN]),
        )
