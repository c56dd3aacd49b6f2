"""One run, as it was seen from outside: what it cost, where it ended, and what it said of that."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.comparison.log import KINDS, ROW, ROWS, Seen
from workbench.errors import BadFile
from workbench.reading.facts import Facts, amount, whole
from workbench.solvers import Evaluations

Stored = tuple[dict[str, Any], dict[str, Array]]  # facts, and arrays by name


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
    """A run. What the solver claims stands beside what the problem itself says of its point."""

    solver: str
    instance: str
    ending: Ending
    message: str
    claim: str  # the status that it returned; "" if it returned none
    claimed_cost: float
    cost: float  # of the problem, at the point that was returned; NaN without one
    optimality: float  # Problem.optimality there
    digits: float  # that agree with a certified answer, 0 to 11; NaN where none is known
    inside: bool  # the bounds and constraints
    end: Array  # (n,) that point; empty without one
    seen: Seen
    machine: str

    @property
    def evaluations(self) -> Evaluations:
        """By the problem's own counters."""
        return self.seen.evaluations

    @property
    def lowest(self) -> float:
        """The least cost at any point that it visited; infinite if there is none."""
        return float(self.seen.trace[-1, -1]) if len(self.seen.trace) else np.inf

    @property
    def finite(self) -> bool:
        """Whether it ended at a point of finite cost."""
        return bool(self.end.size and np.isfinite(self.cost))

    def stored(self) -> Stored:
        """As facts and arrays."""
        seen = self.seen
        facts = {
            "solver": self.solver,
            "instance": self.instance,
            "ending": self.ending.name,
            "message": self.message,
            "claim": self.claim,
            "claimed_cost": self.claimed_cost,
            "cost": self.cost,
            "optimality": self.optimality,
            "inside": self.inside,
            "digits": self.digits,
            "machine": self.machine,
            "counts": list(seen.counts),
            "spent": list(seen.spent),
            "taken": seen.taken,
            "not_finite": seen.not_finite,
            "seconds": seen.seconds,
        }
        return facts, {"end": self.end, "best": seen.best, "trace": seen.trace}

    @staticmethod
    def of(stored: Stored) -> "Record":
        """From what `stored` gave; raises BadFile if it is something else."""
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
            claim=facts.text("claim"),
            claimed_cost=facts.number("claimed_cost"),
            cost=cost,
            optimality=facts.amount("optimality"),
            inside=facts.truth("inside"),
            digits=facts.number("digits"),
            end=end,
            machine=facts.text("machine"),
            seen=Seen(
                counts,
                spent,
                facts.whole("not_finite"),
                facts.duration("seconds"),
                best,
                trace.reshape(-1, ROW),
                facts.truth("taken"),
            ),
        )


def array_of(arrays: Mapping[str, Array], name: str, axes: int) -> Array:
    """One of the stored arrays; raises BadFile if it is missing or has other axes."""
    found = arrays.get(name)
    if found is None or found.ndim != axes:
        raise BadFile(f"{name} is no array with {axes} axes")
    return found


def finite_array_of(arrays: Mapping[str, Array], name: str, axes: int) -> Array:
    """The same, if all its numbers are finite."""
    found = array_of(arrays, name, axes)
    if not np.isfinite(found).all():
        raise BadFile(f"{name} holds numbers that are not finite")
    return found


def ended_early(
    solver: str, instance: str, ending: Ending, message: str, seen: Seen, machine: str
) -> Record:
    """A run that returned nothing."""
    nothing = np.zeros(0)
    return Record(
        solver,
        instance,
        ending,
        message,
        "",
        np.nan,
        np.nan,
        np.nan,
        np.nan,
        True,
        nothing,
        seen,
        machine,
    )
