"""What is known of an instance and of a run, and the log that outlives the run's process."""

import os
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadFile
from workbench.reading.facts import Facts, amount, whole
from workbench.solvers import Evaluations, Status

KINDS = (  # of evaluations
    "residual",
    "gradient",
    "jacobian",
    "hessian",
    "constraint",
    "constraint_jacobian",
    "constraint_hessian",
)
LIMITED_KINDS = 4  # of them a budget limits: all but those of the constraints
COUNTS = slice(2, 2 + len(KINDS))
SPENT = slice(COUNTS.stop, COUNTS.stop + len(KINDS))
NOT_FINITE, SECONDS, TAKEN = SPENT.stop, SPENT.stop + 1, SPENT.stop + 2
HEAD = TAKEN + 1  # n, rows, counts, times, and these three
ROW = len(KINDS) + 2  # counts, seconds, cost
ROWS = 20_000  # improvements that are kept


@dataclass(frozen=True, eq=False)
class ObservedRun:
    """What a metered problem observed of one run."""

    counts: tuple[int, ...]  # the number of evaluations by kind, in the order of KINDS
    spent: tuple[float, ...]  # the seconds spent in the problem by kind, likewise
    not_finite: int  # the number of evaluations whose cost was NaN or infinite
    seconds: float  # how long the run took
    best: Array  # (n,) the point of least cost; empty if no cost was finite
    # (k, kinds + 2) for every improvement the evaluations by kind, the seconds and the cost,
    # which falls
    trace: Array
    taken: bool = False  # whether a graph was taken to where its evaluations cannot be counted

    @property
    def evaluations(self) -> Evaluations:
        """In the words of the solvers, who do not tell kinds of constraints' evaluations apart."""
        residual, gradient, jacobian, hessian, *constraints = self.counts
        return Evaluations(residual, gradient, jacobian, hessian, sum(constraints))


class RunLog:
    """A file that is mapped into memory: what is in it outlives the process that wrote it."""

    def __init__(self, path: str | Path, n: int) -> None:
        self.n = n
        shape = (HEAD + n + ROW * ROWS,)
        self.numbers = np.memmap(path, dtype=float, mode="w+", shape=shape)
        self.numbers[0] = n

    def better(self, x: Array, counts: Array, seconds: float, cost: float) -> None:
        """Record an improvement; when the file is full it replaces the last one."""
        k = min(int(self.numbers[1]), ROWS - 1)
        begin = HEAD + self.n + ROW * k
        self.numbers[begin : begin + ROW] = (*counts, seconds, cost)
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
    def read(path: str | Path) -> ObservedRun:
        """What a file holds, whether or not the process that writes it still lives."""
        numbers = np.fromfile(path, dtype=float)
        if numbers.size < HEAD:  # of a run that ended before it had begun
            numbers = np.zeros(HEAD)
        n, rows = int(numbers[0]), int(numbers[1])
        trace = numbers[HEAD + n : HEAD + n + ROW * rows].reshape(rows, ROW)
        best = numbers[HEAD : HEAD + n] if rows else numbers[:0]
        return ObservedRun(
            tuple(int(c) for c in numbers[COUNTS]),
            tuple(float(s) for s in numbers[SPENT]),
            int(numbers[NOT_FINITE]),
            float(numbers[SECONDS]),
            best.copy(),
            trace.copy(),
            bool(numbers[TAKEN]),
        )


Stored = tuple[dict[str, Any], dict[str, Array]]  # facts, and arrays by name
ARRAYS = "end", "best", "trace"  # of a record


class RunEnding(Enum):
    """How a run came to its end."""

    RETURNED = "it returned a solution"
    CUT = "it was stopped when the budget was spent"
    KILLED = "it did not stop in time, and its process was ended"
    CRASHED = "its process died"
    RAISED = "it raised an exception"
    BROKEN = "what it returned is no solution"
    REFUSED = "it is not made for this problem"


@dataclass(frozen=True, eq=False)
class Record:
    """One run: what the solver claims, and beside it what the problem says of the same point.

    Attributes:
        solver: the name of the solver.
        instance: the name of the instance.
        ending: how the run came to its end.
        message: why, in the solver's words or those of the error.
        observed: what the metered problem observed.
        machine: the machine on which it ran.
        claim: the status that the solver returned; empty if it returned none.
        claimed_cost: the cost that the solver returned; NaN if it returned none.
        cost: the cost by the problem at the point that was returned; NaN without one.
        optimality: `Problem.optimality` there; NaN without one.
        digits: how many digits agree with a certified answer, 0 to 11; NaN where none is known.
        inside: whether the point is inside the bounds and constraints.
        end: (n,) that point; empty without one.
    """

    solver: str
    instance: str
    ending: RunEnding
    message: str
    observed: ObservedRun
    machine: str
    claim: str = ""
    claimed_cost: float = np.nan
    cost: float = np.nan
    optimality: float = np.nan
    digits: float = np.nan
    inside: bool = True
    end: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def evaluations(self) -> Evaluations:
        """How often the problem was evaluated, by its own counters."""
        return self.observed.evaluations

    @property
    def lowest(self) -> float:
        """The least cost at any point that it visited; infinite if there is none."""
        return float(self.observed.trace[-1, -1]) if len(self.observed.trace) else np.inf

    @property
    def finite(self) -> bool:
        """Whether it ended at a point of finite cost."""
        return bool(self.end.size and np.isfinite(self.cost))

    @property
    def at_end(self) -> bool:
        """Whether it ended at a point of finite cost that bounds and constraints allow."""
        return self.finite and self.inside

    def stored(self) -> Stored:
        """The record as facts and arrays; `of` reads them."""
        facts = asdict(self)
        facts |= facts.pop("observed") | {"ending": self.ending.name}
        return facts, {name: facts.pop(name) for name in ARRAYS}

    @staticmethod
    def of(stored: Stored) -> "Record":
        """The record that `stored` gave. Raises BadFile for anything else."""
        facts, arrays = Facts(stored[0]), stored[1]
        end, best = array_of(arrays, "end", 1), array_of(arrays, "best", 1)
        if end.size and best.size and end.size != best.size:
            raise BadFile(f"the end has {end.size} unknowns, and the best point has {best.size}")
        plain = _read(Record, facts)
        if np.isfinite(plain["cost"]) and not (end.size and np.isfinite(end).all()):
            raise BadFile(f"its end costs {plain['cost']:.3g}, and is no point")
        trace = array_of(arrays, "trace", 2)
        if trace.shape[1] != ROW or len(trace) > ROWS or not np.isfinite(trace).all():
            raise BadFile(f"trace has shape {trace.shape}, or is not finite")
        if (np.diff(trace[:, -1]) > 0).any():
            raise BadFile("the costs of its trace do not fall")
        counts, spent = facts.several("counts", whole), facts.several("spent", amount)
        if not len(counts) == len(spent) == len(KINDS) or not np.isfinite(spent).all():
            raise BadFile(f"counts are {counts} and times {spent}, of {len(KINDS)} kinds")
        claim = plain.pop("claim")  # older files have older names of statuses
        observed = facts.whole("not_finite"), facts.duration("seconds"), best, trace
        return Record(
            **plain,
            ending=RunEnding[facts.among("ending", RunEnding.__members__)],
            claim=Status[claim].name if claim in Status.__members__ else claim,
            end=end,
            observed=ObservedRun(counts, spent, *observed, facts.truth("taken")),
        )


def ended(
    group: tuple[str, ...], solvers: tuple[str, ...], records: dict[tuple[str, str], Record]
) -> list[tuple[str, str]]:
    """The runs of a group that ended at a point that can be looked at, in a fixed order."""
    keys = [(name, solver) for name in group for solver in solvers]
    return [key for key in keys if records[key].at_end]


def array_of(arrays: Mapping[str, Array], name: str, axes: int) -> Array:
    """One of the stored arrays; raises BadFile if it is missing or has other axes."""
    array = arrays.get(name)
    if array is None or array.ndim != axes:
        raise BadFile(f"{name} is no array with {axes} axes")
    return array


@dataclass(frozen=True)
class Description:
    """An instance as a worker process found it."""

    instance: str  # its name
    rows: int  # m, the number of residual rows
    unknowns: int  # n, the number of free numbers
    bounded: bool  # whether there are bounds
    start_cost: float  # the cost at the start
    known_cost: float  # the cost of the known answer; NaN if none is known
    known_source: str  # where the known answer comes from
    question: str  # the question that the experiment asks

    def stored(self) -> Stored:
        """The description as facts; `of` reads them."""
        return asdict(self), {}

    @staticmethod
    def of(stored: Stored) -> "Description":
        """The description that `stored` gave. Raises BadFile for anything else."""
        return Description(**_read(Description, Facts(stored[0])))


BY_TYPE = {str: Facts.text, int: Facts.whole, bool: Facts.truth, float: Facts.number}


def _read(kind: type, facts: Facts) -> dict[str, Any]:
    """The plain fields of a dataclass from facts."""
    return {f.name: BY_TYPE[f.type](facts, f.name) for f in fields(kind) if f.type in BY_TYPE}


@cache
def processor() -> str:
    """The name of the processor, as the system gives it."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            names = [line.partition(":")[2].strip() for line in lines if "model name" in line]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or "unknown"


def machine() -> str:
    """Processor, cores and system: `AMD EPYC, 2 cores, Linux x86_64`."""
    return f"{processor()}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}"
