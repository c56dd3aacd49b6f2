"""All ends of one problem, looked at together: the lowest cost known, the basins, and why some
were lost.
"""

from dataclasses import asdict, dataclass, field

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
    """The ends of all runs on one problem, from any start. Basins are numbered from 0, the lowest.

    Attributes:
        where: the basin of each end, in the order in which the ends were given.
        costs: the cost of each basin.
        optimality: `Problem.optimality` at the lowest point of each basin.
        points: (basins, n) these lowest points.
        explanations: why a basin was not left for the best one, by the basin's number.
        message: why there is no analysis; empty if there is one.
    """

    where: tuple[int, ...] = ()
    costs: tuple[float, ...] = ()
    optimality: tuple[float, ...] = ()
    points: Array = field(default_factory=lambda: np.zeros((0, 0)))
    explanations: dict[int, Explanation] = field(default_factory=dict)
    message: str = ""

    def stored(self) -> Stored:
        """The analysis as facts and arrays; `of` reads them."""
        facts = asdict(self)
        facts["explanations"] = {str(k): told for k, told in facts["explanations"].items()}
        return facts, {"points": facts.pop("points")}

    @staticmethod
    def of(stored: Stored) -> "EndAnalysis":
        """The analysis that `stored` gave. Raises BadFile for anything else."""
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


def analyse_ends(setup: Setup, ends: tuple[Array, ...]) -> EndAnalysis:
    """Analyse the ends of a problem, (n,) each; this runs in a worker process."""
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
