"""One run: what it cost, where it ended, and what the solver claims."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.comparison.log import KINDS, ROW, ROWS, Observed
from workbench.errors import BadFile
from workbench.reading.facts import Facts, amount, whole
from workbench.solvers import Evaluations, Status

Stored = tuple[dict[str, Any], dict[str, Array]]  # facts, and arrays by name
ARRAYS = "end", "best", "trace"  # of a record


class Ending(Enum):
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
    ending: Ending
    message: str
    observed: Observed
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
        cost = facts.amount("cost")
        if np.isfinite(cost) and not (end.size and np.isfinite(end).all()):
            raise BadFile(f"its end costs {cost:.3g}, and is no point")
        trace = finite_array_of(arrays, "trace", 2)
        if trace.shape[1] != ROW or len(trace) > ROWS or (np.diff(trace[:, -1]) > 0).any():
            raise BadFile(f"trace has shape {trace.shape}, or its costs do not fall")
        counts, spent = facts.several("counts", whole), facts.several("spent", amount)
        if not len(counts) == len(spent) == len(KINDS) or not np.isfinite(spent).all():
            raise BadFile(f"counts are {counts} and times {spent}, of {len(KINDS)} kinds")
        return Record(
            solver=facts.text("solver"),
            instance=facts.text("instance"),
            ending=Ending[facts.among("ending", Ending.__members__)],
            message=facts.text("message"),
            claim=_claim(facts.text("claim")),
            claimed_cost=facts.number("claimed_cost"),
            cost=cost,
            optimality=facts.amount("optimality"),
            inside=facts.truth("inside"),
            digits=facts.number("digits"),
            end=end,
            machine=facts.text("machine"),
            observed=Observed(
                counts,
                spent,
                facts.whole("not_finite"),
                facts.duration("seconds"),
                best,
                trace.reshape(-1, ROW),
                facts.truth("taken"),
            ),
        )


def _claim(name: str) -> str:
    """The present name of a status, which older files may name otherwise."""
    return Status[name].name if name in Status.__members__ else name


def ended(
    group: tuple[str, ...], solvers: tuple[str, ...], records: dict[tuple[str, str], Record]
) -> list[tuple[str, str]]:
    """The runs of a group that ended at a point that can be looked at, in a fixed order."""
    keys = [(name, solver) for name in group for solver in solvers]
    return [key for key in keys if records[key].finite and records[key].inside]


def array_of(arrays: Mapping[str, Array], name: str, axes: int) -> Array:
    """One of the stored arrays; raises BadFile if it is missing or has other axes."""
    found = arrays.get(name)
    if found is None or found.ndim != axes:
        raise BadFile(f"{name} is no array with {axes} axes")
    return found


def finite_array_of(arrays: Mapping[str, Array], name: str, axes: int) -> Array:
    """As `array_of`; raises BadFile also for numbers that are not finite."""
    found = array_of(arrays, name, axes)
    if not np.isfinite(found).all():
        raise BadFile(f"{name} holds numbers that are not finite")
    return found
