"""All ends of one problem: their basins, what curvature says of these, and why some were lost."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np
import scipy.linalg

from workbench.arrays import Array, Mask
from workbench.blocks.layout import in_units
from workbench.comparison.metered import feasible, look
from workbench.comparison.record import Stored
from workbench.diagnostics import Diagnosis, diagnose_whole
from workbench.diagnostics.null_space import WEAK, Direction, named_by_joints
from workbench.errors import BadFile, listed
from workbench.fitting.setup import Setup
from workbench.problem import Problem
from workbench.problem.linearization import largest_eigenvalue
from workbench.problem.optimality import half_squared
from workbench.reading.facts import Facts, facts, number, whole
from workbench.solvers import Ipopt, LevenbergMarquardt, Solver
from workbench.solvers.starts import one_minimum

SADDLE = -1e-4  # of the largest eigenvalue: below, a stationary point counts as a saddle
STEP = 1e-5  # of a whitened unknown, for differences of gradients: their errors are about 1e-10
ON_A_LIMIT = 1e-9  # of a number
SMALL = 200  # unknowns up to which all eigenvalues are computed
ACCURATE = 1e-5  # of the largest eigenvalue, by Lanczos' method
POLISH_SECONDS = 20.0  # at most, per end
POLISH_TO = 1e-13  # of Problem.optimality
STATIONARY = 1e-9  # of Problem.optimality: an end as good as this is not followed
THIN = 0.1  # of the median singular value: below, a direction counts as weak here
NAMED = 3  # directions that are told
SHORT = 0.1  # of the way: what goes less far along a direction is not worth its name
POINTS = 41  # on the straight line between the two ends
ENOUGH = 0.5  # of the way, for weak directions to explain it
NOTHING = np.zeros(0)
EXPLAINED = 8  # lost basins of one problem, the lowest; more are counted


def least_curvature(problem: Problem, x: Array, fixed: Array) -> float:
    """The smallest eigenvalue of the Hessian at a stationary point x (n,) over the largest one.

    Unknowns are scaled by the lengths of their columns of the Jacobian there, so that units do not
    matter. Unknowns on a bound are held fixed, and directions along which active constraints change
    are left out. NaN if the linearization is not finite, and 0 if nothing remains free.
    """
    here = problem.linearize_at(x, fixed)
    if not (np.isfinite(x).all() and here.finite):
        return np.nan
    lengths = here.column_norms
    scale = np.where(lengths > 0, lengths, 1.0)
    free = np.eye(len(x))[:, _inside(problem, x)] / scale[:, None]
    there, active = problem.stacked_constraints, np.zeros(0)
    if there is not None:
        now = there.linearize(x, fixed)
        at_limit = np.minimum(now.values - now.lower, now.upper - now.values) <= now.tolerance
        A = now.rows(at_limit)
        free = free @ scipy.linalg.null_space(A @ free)
        active = np.zeros(there.size)
        active[at_limit] = -np.linalg.lstsq((A / scale).T, here.gradient / scale)[0]

    def gradient(at: Array) -> Array:
        of_cost = problem.cost_and_gradient(at, fixed)[1]
        if there is None:
            return of_cost
        return np.asarray(of_cost + there.linearize(at, fixed).jacobian.T @ active)

    def product(v: Array) -> Array:
        step = free @ v * (STEP / np.linalg.norm(v))
        bend = (gradient(x + step) - gradient(x - step)) / (2 * STEP)
        return np.asarray(free.T @ bend * np.linalg.norm(v))

    return _least_by_largest(product, free.shape[1])


def _inside(problem: Problem, x: Array) -> Mask:
    tolerance = ON_A_LIMIT * np.maximum(1, abs(x))
    return np.asarray((x > problem.lower + tolerance) & (x < problem.upper - tolerance))


def _least_by_largest(product: Callable[[Array], Array], n: int) -> float:
    if n == 0:
        return 0.0
    if n <= SMALL:
        H = np.array([product(unit) for unit in np.eye(n)])
        if not np.isfinite(H).all():
            return np.nan
        values = np.linalg.eigvalsh((H + H.T) / 2)
        return _by_largest(values.min(), abs(values).max())
    largest = largest_eigenvalue(product, n, ACCURATE)
    # shifted, the smallest one is the largest, and is found to a part of the largest
    shifted = largest - largest_eigenvalue(lambda v: largest * v - product(v), n, ACCURATE)
    return _by_largest(shifted, largest)


def _by_largest(value: float, largest: float) -> float:
    return value / largest if largest > 0 else 0.0 * largest


@dataclass(frozen=True, eq=False)
class Basin:
    """A minimum that some ends lead to.

    Attributes:
        x: (n,) its lowest point.
        cost: the cost there.
        optimality: `Problem.optimality` there.
        residual: (m,) the whitened residual there.
    """

    x: Array
    cost: float
    optimality: float
    residual: Array


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
        found = problem.free.pack(solver.solve(problem, values).values)
    except Exception:  # an end at which nothing can be evaluated leads nowhere
        return x
    before, after = look(problem, x, fixed)[0], look(problem, found, fixed)[0]
    lower = after <= before or not np.isfinite(before)
    return found if lower and feasible(problem, found, fixed) else x


def basins(
    problem: Problem, fixed: Array, ends: Sequence[Array]
) -> tuple[tuple[Basin, ...], tuple[int, ...]]:
    """The basins, lowest first, and for each end the number of its own, 0 being the lowest.

    An end is not followed further if its residual already equals that of a known minimum, or if it
    is stationary.
    """
    found: list[list[Basin]] = []
    where = []
    for end in ends:
        basin = _at(problem, end, fixed)
        k = _same_basin(problem, found, basin, fixed)
        if k is None:
            if not basin.optimality <= STATIONARY:
                basin = _at(problem, polished(problem, end, fixed), fixed)
                k = _same_basin(problem, found, basin, fixed)
            if k is None:
                k = len(found)
                found.append([])
            found[k].append(basin)
        where.append(k)
    lowest = [min(members, key=lambda basin: basin.cost) for members in found]
    order = sorted(range(len(lowest)), key=lambda k: lowest[k].cost)
    rank = {k: i for i, k in enumerate(order)}
    return tuple(lowest[k] for k in order), tuple(rank[k] for k in where)


def _same_basin(problem: Problem, found: list[list[Basin]], at: Basin, fixed: Array) -> int | None:
    """The first basin with a member that has the same residual."""
    for k, members in enumerate(found):
        for member in members:
            if one_minimum(problem, fixed, member.x, member.residual, at.residual):
                return k
    return None


def _at(problem: Problem, x: Array, fixed: Array) -> Basin:
    cost, optimality = look(problem, x, fixed)
    return Basin(x, cost, optimality, problem.residual(x, fixed))


@dataclass(frozen=True)
class Component:
    """How far the way goes along one weak direction.

    Attributes:
        name: the name of the direction.
        length: how far the way goes along it, in units of the unknowns.
        change: how many sigmas the residuals change per unit.
    """

    name: str
    length: float
    change: float


@dataclass(frozen=True)
class Explanation:
    """The straight way from a lost end to the best one.

    Attributes:
        cost: the cost at the lost end.
        best: the cost at the best end.
        length: the length of the way, in the units of the unknowns: radians, metres, standard
            deviations.
        share: the share of its square that lies along weak directions of the lost end, 0 to 1.
        components: the longest parts along named weak directions, the longest first.
        rest: the largest entries of the way, in words.
        ridge: by how much the cost rises above that of the lost end on the way.
    """

    cost: float
    best: float
    length: float
    share: float
    components: tuple[Component, ...]
    rest: str
    ridge: float

    @staticmethod
    def of(given: object, name: str) -> "Explanation":
        """From facts; raises BadFile, saying `name`, if it is something else."""
        told = facts(given, name)
        return Explanation(
            cost=told.number("cost"),
            best=told.number("best"),
            length=told.number("length"),
            share=told.number("share"),
            components=told.several("components", _component),
            rest=told.text("rest"),
            ridge=told.number("ridge"),
        )

    def __str__(self) -> str:
        said = (
            f"It costs {self.cost - self.best:.4g} more than the best end ({self.cost:.6g} against "
            f"{self.best:.6g}). "
        )
        way = f"{self.share:.0%} of the way from here to there ({self.length:.3g} units)"
        if self.share >= ENOUGH and self.components:
            named = "; ".join(
                f"{p.name.partition(': ')[0]} ({p.length:.2g} units, {p.change:.2g} sigma per unit)"
                for p in self.components
            )
            said += (
                f"{way} goes along weak directions, so the data did little to keep a solver from "
                f"sliding here; the largest parts are {named}. "
            )
        else:
            said += (
                f"Only {way} goes along weak directions; it is mostly {self.rest}, which the data "
                "determine: this is another minimum, and not a slide. "
            )
        if self.ridge > 0:
            return said + (
                f"On the straight line between them the cost rises by {self.ridge:.3g}: a solver "
                "that only goes downhill does not return along it."
            )
        return said + "On the straight line between them the cost only falls."


def _component(given: object, name: str) -> Component:
    told = facts(given, name)
    return Component(told.text("name"), told.number("length"), told.number("change"))


def explain(
    problem: Problem, fixed: Array, lost: Basin, best: Basin, priors: tuple[str, ...] = ()
) -> Explanation:
    """Decompose the way from the lost end to the best one into directions with names.

    They are the directions that are weak at the lost end, without the residuals that are priors: a
    singular value is weak if it is below a tenth of the median one, or below one sigma for a whole
    unit and below a tenth of the largest.
    """
    way = best.x - lost.x
    length = float(np.linalg.norm(way))
    values = problem.values(lost.x, fixed)
    data = problem.without(*priors) if 0 < len(priors) < len(problem.residuals) else problem
    seen = diagnose_whole(data, values)
    along, components = _along(way, _weak(seen, data, problem))
    between = [lost.x + s * way for s in np.linspace(0, 1, POINTS)]
    costs = [half_squared(problem.residual(x, fixed)) for x in between]
    return Explanation(
        cost=lost.cost,
        best=best.cost,
        length=length,
        share=along,
        components=components,
        rest=in_units(way, problem.free) if length > 0 else "nothing",
        ridge=max(0.0, float(np.nanmax(costs)) - lost.cost),
    )


def _weak(seen: Diagnosis, data: Problem, whole: Problem) -> tuple[Direction, ...]:
    """The weak directions of the data, as vectors of all free numbers."""
    if seen.here.estimated or not seen.here.finite:
        return ()
    s = seen.here.spectrum.s
    thin = max(THIN * float(np.median(s)), min(WEAK, THIN * float(s.max(initial=0.0))))
    least = max(thin, seen.here.spectrum.tolerance)
    null = seen.here.spectrum.Vt[int(np.sum(s > least)) :].T
    found = list(named_by_joints(null, data.free, data.trees, seen.here))
    for k, direction in enumerate(found):
        vector = np.zeros(whole.free.size)
        for name in data.free.names:
            vector[whole.free.slices[name]] = direction.vector[data.free.slices[name]]
        found[k] = replace(direction, vector=vector)
    return tuple(found)


def _along(way: Array, weak: tuple[Direction, ...]) -> tuple[float, tuple[Component, ...]]:
    """The share of |way|^2 in the span of the directions, and the few that make most of it.

    Named directions are not orthogonal: all of them together would tell of large moves that
    cancel. So they are taken one by one, each time the one that is nearest to what is left.
    """
    if not weak or not way.any():
        return 0.0, ()
    V = np.column_stack([d.vector for d in weak])
    within = V @ np.linalg.lstsq(V, way)[0]
    share = float(np.sum(within**2) / np.sum(way**2))
    chosen: list[int] = []
    c: Array = np.zeros(0)
    left: Array = within
    while len(chosen) < min(NAMED, len(weak)):
        nearness = abs(V.T @ left)
        nearness[chosen] = 0
        if nearness.max() <= SHORT * np.linalg.norm(way):
            break
        chosen.append(int(np.argmax(nearness)))
        c = np.asarray(np.linalg.lstsq(V[:, chosen], within)[0], dtype=float)
        left = within - V[:, chosen] @ c
    components = [
        Component(weak[i].name, float(abs(x)), weak[i].change)
        for i, x in zip(chosen, c, strict=True)
    ]
    return min(1.0, share), tuple(sorted(components, key=lambda part: -part.length))


@dataclass(frozen=True, eq=False)
class EndAnalysis:
    """The ends of all runs on one problem, from any start. Basins are numbered from 0, the lowest.

    Attributes:
        where: the basin of each end, in the order in which the ends were given.
        costs: the cost of each basin.
        optimality: `Problem.optimality` at the lowest point of each basin.
        curvatures: the least curvature over the largest one at these points, for the lowest basins;
            NaN where it is not known; see `least_curvature`.
        points: (basins, n) the lowest point of each basin.
        explanations: why runs ended in a basin and not in the best one, by the basin's number.
        message: why there is no analysis; empty if there is one.
    """

    where: tuple[int, ...] = ()
    costs: tuple[float, ...] = ()
    optimality: tuple[float, ...] = ()
    curvatures: tuple[float, ...] = ()
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
        curvatures = facts.several("curvatures", number)
        message = facts.text("message")
        return EndAnalysis(where, costs, optimality, curvatures, points, explained, message)


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
        tuple(least_curvature(problem, basin.x, fixed) for basin in found[: EXPLAINED + 1]),
        np.array([basin.x for basin in found]),
        told,
    )
