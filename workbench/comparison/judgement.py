"""All ends of one problem, looked at together: the lowest cost known, the basins, and why some
were lost.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.comparison.basins import basins
from workbench.comparison.explanation import Explanation, explain
from workbench.comparison.record import Stored
from workbench.experiments.experiment import Setup

Array = NDArray[np.float64]
EXPLAINED = 8  # lost basins of one problem, the lowest; more are counted


@dataclass(frozen=True, eq=False)
class Judgement:
    """Of one problem, whatever the start. Basins are numbered from 0, the lowest."""

    where: tuple[int, ...]  # the basin of each end, in the order in which they were given
    costs: tuple[float, ...]  # of the basins
    optimality: tuple[float, ...]  # at their lowest points
    points: Array  # (basins, n)
    explanations: dict[int, Explanation]  # by basin
    message: str = ""  # why there is no judgement, where there is none

    def stored(self) -> Stored:
        """As facts and arrays."""
        facts = {
            "where": self.where, "costs": self.costs, "optimality": self.optimality,
            "explanations": {str(k): e.data() for k, e in self.explanations.items()},
            "message": self.message,
        }  # fmt: skip
        return facts, {"points": self.points}

    @staticmethod
    def of(stored: Stored) -> "Judgement":
        """From what `stored` gave."""
        facts, arrays = stored
        told = {int(k): Explanation.of(data) for k, data in facts["explanations"].items()}
        return Judgement(
            tuple(facts["where"]), tuple(facts["costs"]), tuple(facts["optimality"]),
            arrays["points"], told, facts["message"],
        )  # fmt: skip


def unjudged(message: str = "") -> Judgement:
    """Where there are no ends, or looking at them failed."""
    return Judgement((), (), (), np.zeros((0, 0)), {}, message)


def judge(setup: Setup, ends: tuple[Array, ...]) -> Judgement:
    """Inside a worker."""
    problem = setup.problem
    problem.prepare()
    fixed = problem.split(setup.start)[1]
    found, where = basins(problem, fixed, ends)
    told = {}
    for k, lost in list(enumerate(found))[1 : EXPLAINED + 1]:
        if np.isfinite(lost.cost):
            told[k] = explain(problem, fixed, lost, found[0], setup.priors)
    return Judgement(
        where,
        tuple(basin.cost for basin in found),
        tuple(basin.optimality for basin in found),
        np.array([basin.x for basin in found]),
        told,
    )
