"""All ends of one problem: the basins that they lie in, and which of these are saddles."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field

import numpy as np

from workbench.arrays import Array
from workbench.comparison.metered import feasible, look
from workbench.comparison.record import Stored
from workbench.errors import BadFile, WorkbenchError
from workbench.fitting.setup import Setup
from workbench.problem import Problem
from workbench.reading.facts import Facts, number, truth, whole
from workbench.solvers import Ipopt, LevenbergMarquardt, Solver
from workbench.solvers.judgement import SHOWS_NOTHING
from workbench.solvers.limits import GUARDED
from workbench.solvers.no_minimum import EndPoint, saddle
from workbench.solvers.starts import one_minimum

POLISH_SECONDS = 20.0  # at most, per end
POLISH_TO = 1e-13  # of Problem.optimality
STATIONARY = 1e-9  # of Problem.optimality: an end as good as this is not followed
BASINS_JUDGED = 9  # basins, the lowest, that may be saddles
MOST_GRADIENTS = 200  # at most, that are taken to find a direction along which the cost falls


@dataclass(frozen=True, eq=False)
class Basin:
    """A minimum that some ends lead to."""

    x: Array  # (n,) its lowest point
    cost: float  # the cost there
    optimality: float  # `Problem.optimality` there
    residual: Array  # (m,) the whitened residual there


def polished(problem: Problem, x: Array, fixed: Array) -> Array:
    """Where Levenberg-Marquardt (IPOPT, with constraints) leads to from x; never to a higher cost,
    nor to a point that violates a limit.
    """
    options = {"gradient_tolerance": POLISH_TO, "max_seconds": POLISH_SECONDS}
    solver: Solver = LevenbergMarquardt(**options)  # type: ignore[arg-type]
    if problem.stacked_constraints is not None:
        solver = Ipopt(**options)  # type: ignore[arg-type]
    values = problem.values(x, fixed)
    try:
        solution = solver.solve(problem, values)
    except WorkbenchError:  # an end that is no start, such as one that is not finite
        return x
    end = problem.free.pack(solution.values)
    before, after = look(problem, x, fixed)[0], look(problem, end, fixed)[0]
    lower = after <= before or not np.isfinite(before)
    return end if lower and feasible(problem, end, fixed) else x


def basins(
    problem: Problem, fixed: Array, ends: Sequence[Array]
) -> tuple[tuple[Basin, ...], tuple[int, ...]]:
    """The basins, lowest first, and for each end the number of its own, 0 being the lowest.

    An end is not followed further if its residual already equals that of a known minimum, or if it
    is stationary.
    """
    known: list[list[Basin]] = []
    numbers = []
    for end in ends:
        basin = _basin_at(problem, end, fixed)
        k = _same_basin(problem, known, basin, fixed)
        if k is None:
            if not basin.optimality <= STATIONARY:
                basin = _basin_at(problem, polished(problem, end, fixed), fixed)
                k = _same_basin(problem, known, basin, fixed)
            if k is None:
                k = len(known)
                known.append([])
            known[k].append(basin)
        numbers.append(k)
    lowest = [min(members, key=lambda basin: basin.cost) for members in known]
    order = sorted(range(len(lowest)), key=lambda k: lowest[k].cost)
    rank = {k: i for i, k in enumerate(order)}
    return tuple(lowest[k] for k in order), tuple(rank[k] for k in numbers)


def _same_basin(problem: Problem, known: list[list[Basin]], end: Basin, fixed: Array) -> int | None:
    """The first basin with a member that has the same residual."""
    for k, members in enumerate(known):
        for member in members:
            if one_minimum(problem, fixed, member.x, member.residual, end.residual):
                return k
    return None


def _basin_at(problem: Problem, x: Array, fixed: Array) -> Basin:
    cost, optimality = look(problem, x, fixed)
    return Basin(x, cost, optimality, problem.residual(x, fixed))


def is_saddle(problem: Problem, fixed: Array, x: Array) -> bool:
    """Whether the cost falls along a line from a stationary point x (n,), as solvers find out.

    False where that is not known: with constraints, or where nothing can be evaluated.
    """
    try:
        with GUARDED:
            here = problem.linearize_at(x, fixed)
            rounding = problem.rounding(x, fixed, here.residual)
        end = EndPoint(problem, fixed, x, here, rounding, x, STATIONARY, lambda: None)
        return here.finite and saddle(end, MOST_GRADIENTS) is not None
    except SHOWS_NOTHING:
        return False


@dataclass(frozen=True, eq=False)
class EndAnalysis:
    """The ends of all runs on one problem. Basins are numbered from 0, the lowest."""

    where: tuple[int, ...] = ()  # the basin of each end, in the order in which the ends were given
    costs: tuple[float, ...] = ()  # the cost of each basin
    optimality: tuple[float, ...] = ()  # `Problem.optimality` at the lowest point of each basin
    saddles: tuple[bool, ...] = ()  # whether these points are saddles, of the lowest basins
    # (basins, n) the lowest point of each basin
    points: Array = field(default_factory=lambda: np.zeros((0, 0)))
    message: str = ""  # why there is no analysis; empty if there is one

    def at_saddle(self, basin: int) -> bool:
        """Whether the lowest point of a basin is a saddle; False where that is not known."""
        return basin < len(self.saddles) and self.saddles[basin]

    def stored(self) -> Stored:
        """The analysis as facts and arrays; `of` reads them."""
        facts = asdict(self)
        return facts, {"points": facts.pop("points")}

    @staticmethod
    def of(stored: Stored) -> "EndAnalysis":
        """The analysis that `stored` gave. Raises BadFile for anything else."""
        facts, points = Facts(stored[0]), stored[1].get("points", np.zeros(0))
        # the points of no basins are (0,) or (0, 0)
        if points.ndim < 1 or (points.ndim != 2 and points.size) or not np.isfinite(points).all():
            raise BadFile(f"points has shape {points.shape}, or is not finite")
        costs = facts.several("costs", number)
        optimality, where = facts.several("optimality", number), facts.several("where", whole)
        if not len(points) == len(optimality) == len(costs) or max(where, default=-1) >= len(costs):
            raise BadFile(f"{len(costs)} costs of {len(points)} basins; ends lie in {where}")
        saddles = facts.several("saddles", truth)
        return EndAnalysis(where, costs, optimality, saddles, points, facts.text("message"))


def analyse_ends(setup: Setup, ends: tuple[Array, ...]) -> EndAnalysis:
    """Analyse the ends of a problem, (n,) each; this runs in a worker process."""
    problem = setup.problem
    problem.prepare()
    fixed = problem.split(setup.start)[1]
    lowest_first, where = basins(problem, fixed, ends)
    return EndAnalysis(
        where,
        tuple(basin.cost for basin in lowest_first),
        tuple(basin.optimality for basin in lowest_first),
        tuple(is_saddle(problem, fixed, basin.x) for basin in lowest_first[:BASINS_JUDGED]),
        np.array([basin.x for basin in lowest_first]),
    )
