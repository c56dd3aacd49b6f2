"""All ends of one problem, looked at together: the lowest cost known, the basins, and why some
were lost.
"""

from dataclasses import asdict, dataclass, field

import numpy as np

from workbench.arrays import Array
from workbench.comparison.basins import Basin, basins
from workbench.comparison.curvature import SADDLE, least_curvature
from workbench.comparison.explanation import Explanation, explain
from workbench.comparison.record import Stored
from workbench.errors import BadFile, listed
from workbench.fitting.setup import Setup
from workbench.problem import Linearization, Problem
from workbench.problem.optimality import undetermined_by_rounding
from workbench.reading.facts import Facts, number, whole

NOTHING = np.zeros(0)
ABOVE = 1.01  # of the lowest cost: an end above it has a cause
RANKED = 2000  # unknowns up to which the rank at an end is computed: with more it takes minutes
EXPLAINED = 8  # lost basins of one problem, the lowest; more are counted


@dataclass(frozen=True, eq=False)
class EndAnalysis:
    """The ends of all runs on one problem, from any start. Basins are numbered from 0, the lowest.

    Attributes:
        where: the basin of each end, in the order in which the ends were given.
        costs: the cost of each basin.
        optimality: `Problem.optimality` at the lowest point of each basin.
        curvatures: the least curvature over the largest one at these points, for the lowest basins;
            NaN where it is not known; see `least_curvature`.
        lost_ranks: by how much the rank of the Jacobian at each end is below that at the lowest
            point of all; 0 also for ends that cost about as little as that point, and where there
            are more than 2,000 unknowns.
        hidden: how many unknowns rounding leaves undetermined at each end; 0 likewise.
        points: (basins, n) the lowest point of each basin.
        explanations: why runs ended in a basin and not in the best one, by the basin's number.
        message: why there is no analysis; empty if there is one.
    """

    where: tuple[int, ...] = ()
    costs: tuple[float, ...] = ()
    optimality: tuple[float, ...] = ()
    curvatures: tuple[float, ...] = ()
    lost_ranks: tuple[int, ...] = ()
    hidden: tuple[int, ...] = ()
    points: Array = field(default_factory=lambda: np.zeros((0, 0)))
    explanations: dict[int, Explanation] = field(default_factory=dict)
    message: str = ""

    def at_saddle(self, basin: int) -> bool:
        """Whether the lowest point of a basin is a saddle; False where its curvature is unknown."""
        return basin < len(self.curvatures) and self.curvatures[basin] < SADDLE

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
        lost_ranks, hidden = facts.several("lost_ranks", whole), facts.several("hidden", whole)
        if not len(lost_ranks) == len(hidden) == len(where):
            raise BadFile(f"{len(lost_ranks)} ranks and {len(hidden)} counts of {len(where)} ends")
        curvatures = facts.several("curvatures", number)
        of_basins = where, costs, optimality, curvatures, lost_ranks, hidden
        return EndAnalysis(*of_basins, points, explained, facts.text("message"))


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
    looks = [_look(problem, end, fixed, found[0]) for end in ends]
    return EndAnalysis(
        where,
        tuple(basin.cost for basin in found),
        tuple(basin.optimality for basin in found),
        tuple(least_curvature(problem, basin.x, fixed) for basin in found[: EXPLAINED + 1]),
        tuple(lost_rank for lost_rank, _ in looks),
        tuple(unknowns for _, unknowns in looks),
        np.array([basin.x for basin in found]),
        told,
    )


def _look(problem: Problem, end: Array, fixed: Array, best: Basin) -> tuple[int, int]:
    """How much rank is lost at an end, and how many unknowns rounding hides there."""
    here = problem.linearize_at(end, fixed)
    if not here.finite or here.cost <= ABOVE * best.cost:
        return 0, 0
    rounding = problem.rounding(end, fixed, here.residual)
    unknowns = undetermined_by_rounding(end, here, problem.support, rounding) > 0
    return _lost_rank(here, problem.linearize_at(best.x, fixed)), int(np.count_nonzero(unknowns))


def _lost_rank(here: Linearization, best: Linearization) -> int:
    if here.shape[1] > RANKED or not best.finite:
        return 0
    return max(best.rank - here.rank, 0)
