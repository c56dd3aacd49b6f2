"""One run, as it was seen from outside: what it cost, where it ended, and what it said of that."""

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.comparison.log import ROW, Seen
from workbench.solvers import Evaluations

Array = NDArray[np.float64]
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
            "solver": self.solver, "instance": self.instance, "ending": self.ending.name,
            "message": self.message, "claim": self.claim, "claimed_cost": self.claimed_cost,
            "cost": self.cost, "optimality": self.optimality, "inside": self.inside,
            "digits": self.digits, "machine": self.machine, "counts": list(seen.counts),
            "spent": list(seen.spent), "taken": seen.taken,
            "not_finite": seen.not_finite, "seconds": seen.seconds,
        }  # fmt: skip
        return facts, {"end": self.end, "best": seen.best, "trace": seen.trace}

    @staticmethod
    def of(stored: Stored) -> "Record":
        """From what `stored` gave; raises KeyError or ValueError if it is something else."""
        facts, arrays = stored
        return Record(
            solver=facts["solver"], instance=facts["instance"], ending=Ending[facts["ending"]],
            message=facts["message"], claim=facts["claim"], claimed_cost=facts["claimed_cost"],
            cost=facts["cost"], optimality=facts["optimality"], inside=facts["inside"],
            digits=facts["digits"], end=arrays["end"], machine=facts["machine"],
            seen=Seen(
                tuple(facts["counts"]), tuple(facts["spent"]), facts["not_finite"],
                facts["seconds"], arrays["best"], arrays["trace"].reshape(-1, ROW), facts["taken"],
            ),
        )  # fmt: skip


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
