"""All ends of one problem, looked at together: the lowest cost known, the basins, and why some
were lost.
"""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.comparison.basins import basins
from workbench.comparison.explanation import Explanation, explain
from workbench.comparison.record import Stored
from workbench.errors import BadFile, listed
from workbench.fitting.setup import Setup
from workbench.reading.facts import Facts, number, whole

NOTHING = np.zeros(0)
EXPLAINED = 8  # lost basins of one problem, the lowest; more are counted


@dataclass(frozen=True, eq=False)
class EndAnalysis:
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
            "where": self.where,
            "costs": self.costs,
            "optimality": self.optimality,
            "explanations": {str(k): e.data() for k, e in self.explanations.items()},
            "message": self.message,
        }
        return facts, {"points": self.points}

    @staticmethod
    def of(stored: Stored) -> "EndAnalysis":
        """From what `stored` gave; raises BadFile if it is something else."""
        facts, points = Facts(stored[0]), stored[1].get("points", NOTHING)
        # the points of no basins are (0,) or (0, 0)
        if points.ndim < 1 or (points.ndim != 2 and points.size) or not np.isfinite(points).all():
            raise BadFile(f"points has shape {points.shape}, or is not finite")
        costs = facts.several("costs", number)
        optimality, where = facts.several("optimality", number), facts.several("where", whole)
        basins = {str(k): k for k in range(len(costs))}
        told = facts.named("explanations", Explanation.of)
        if not len(points) == len(optimality) == len(costs) or max(where, default=-1) >= len(costs):
            raise BadFile(f"{len(costs)} costs of {len(points)} basins; ends lie in {where}")
        if beyond := told.keys() - basins.keys():
            raise BadFile(f"explanations of {listed(beyond)}, which are no basins")
        explained = {basins[k]: explanation for k, explanation in told.items()}
        return EndAnalysis(where, costs, optimality, points, explained, facts.text("message"))


def not_analysed(message: str = "") -> EndAnalysis:
    """Where there are no ends, or looking at them failed."""
    return EndAnalysis((), (), (), np.zeros((0, 0)), {}, message)


def analyse_ends(setup: Setup, ends: tuple[Array, ...]) -> EndAnalysis:
    """Inside a worker."""
    problem = setup.problem
    problem.prepare()
    fixed = problem.split(setup.start)[1]
    found, where = basins(problem, fixed, ends)
    told = {}
    for k, lost in list(enumerate(found))[1 : EXPLAINED + 1]:
        if np.isfinite(lost.cost):
            told[k] = explain(problem, fixed, lost, found[0], setup.priors)
    return EndAnalysis(
        where,
        tuple(basin.cost for basin in found),
        tuple(basin.optimality for basin in found),
        np.array([basin.x for basin in found]),
        told,
    )
