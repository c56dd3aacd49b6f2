"""Where a posterior has its modes: minima of the cost, looked for from many places."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy.optimize
import scipy.special

from workbench.arrays import Array, Index
from workbench.errors import WorkbenchError
from workbench.geometry import rotation
from workbench.sampling.log_density import LogDensity, violation_in_words
from workbench.sampling.subspace import Improper

Vector = Callable[[Array], Array]
NEGLIGIBLE_DECREASE = 0.1  # of the cost, by the linear model: at a minimum it is less
AT_A_BOUND = 1e-6  # of the scale of an entry: it is held there
INSIDE = 1e-9  # of the scale of a bound: where a search for a minimum stops in front of it
ROUNDING = 1e-12  # of the largest entry of a direction: zero, but for rounding
SAME_MODE = 1.0  # standard deviations: minima that are nearer to each other are one
NEGLIGIBLE_SHARE = 1e-4  # of the largest mass
POPULATED_SHARE = 0.01  # of all mass: in smaller modes no walker begins, as it would never leave
COMPARABLE_SHARE = 0.05  # of the mass of all: a mode that draws have to visit
VISITED_SHARE = 0.2  # of a mode's share: fewer of the draws are there, and it counts as missed
MOST_ASSIGNED = 20_000  # draws that are looked at
REACH = (3.0, 1000.0)  # standard deviations of Laplace's approximation that starts are away
SHELLS = 8  # of distances, in equal ratios
POINTS_IN_SHELL = 128
FAR_AWAY = np.geomspace(REACH[1], 1e6 * REACH[1], 7)  # Laplace's standard deviations from a mode


class NoMinimum(WorkbenchError):
    """A search that ended where constraints are violated."""


@dataclass(frozen=True, eq=False)
class Mode:
    """A minimum of the cost in z, and Laplace's approximation there."""

    z: Array  # (k,) where the cost is least
    cost: float  # the cost there
    half: Array  # (k, k) such that half @ half.T is the covariance
    log_mass: float  # the log of its integral, up to a constant that all modes share
    share: float = 1.0  # its share of the mass of all modes
    settled: bool = True  # whether the linear model predicts almost no further decrease of the cost

    def mapped(self, into: Array, z: Array) -> "Mode":
        """The same minimum at z (m,) in other coordinates, of which `into` (m, k) is the Jacobian.

        Its Gaussian is the marginal where m < k.
        """
        R = np.linalg.qr((into @ self.half).T, mode="r")
        return replace(self, z=z, half=np.asarray(R).T)

    def distance(self, z: Array) -> float:
        """How many standard deviations a point is away, as a root mean square over entries."""
        return float(np.linalg.norm(np.linalg.solve(self.half, z - self.z)) / np.sqrt(len(z)))


def mode_from(target: LogDensity, start: Array) -> Mode:
    """The minimum that least squares reaches from z = start, inside bounds and constraints.

    It takes no step that leads out of the domain of a residual, such as one behind a camera. Raises
    Improper where a direction is held by nothing, and NoMinimum where no point that meets the
    constraints is reached.
    """
    problem, space = target.problem, target.subspace

    def residual(z: Array) -> Array:
        return problem.residual(space.points(z[None])[0], target.fixed)

    def limited_residual(z: Array) -> Array:
        """Infinite outside of a domain, so that no step leads there."""
        r = residual(z)
        return r if target.in_domain(z[None])[0] else np.full_like(r, np.inf)

    def jacobian(z: Array) -> Array:
        return problem.linearize_at(space.points(z[None])[0], target.fixed).jacobian @ space.along

    low, high = bounds_of(target)
    gap = 1e-10 * np.maximum(1.0, abs(start))
    thin = high - low <= 4 * gap  # trf wants room
    start = np.where(thin, start, np.clip(start, low + gap, high - gap))
    wide = np.where(thin, -np.inf, low), np.where(thin, np.inf, high)
    solution = scipy.optimize.least_squares(
        limited_residual, start, jacobian, bounds=wide, x_scale="jac", max_nfev=200
    )
    z, settled = np.asarray(solution.x), True
    limited = problem.stacked_constraints is not None or len(dependent_bounds(target)[0])
    if not limited or target.allows(space.points(z[None]))[0]:
        settled = _predicted_decrease(residual(z), jacobian(z), z, low, high) < NEGLIGIBLE_DECREASE
    else:
        z = _constrained(target, start, residual, jacobian)
    half = covariance_half(target, jacobian(z))
    cost = 0.5 * float(np.sum(residual(z) ** 2))
    log_det = np.linalg.slogdet(half)[1] + _cut_off(jacobian(z), residual(z), z, low, high)
    return Mode(z, cost, half, float(log_det - cost), settled=settled)


def _cut_off(J: Array, r: Array, z: Array, low: Array, high: Array) -> float:
    """The log of the share of Laplace's Gaussian at z that bounds leave, where z is on bounds.

    For an entry on a bound let g be the slope with which the cost rises away from the bound, and
    sigma its standard deviation if the entries on no bound are free. The share is
    exp((g sigma)^2 / 2) Phi(-g sigma); the shares of several such entries are multiplied.
    """
    near = AT_A_BOUND * np.maximum(1.0, abs(z))
    at_low, at_high = z - low <= near, high - z <= near
    held = (at_low | at_high) & (high > low)
    if not held.any():
        return 0.0
    slope = np.where(at_low, J.T @ r, -(J.T @ r))[held]
    rest, _ = np.linalg.qr(J[:, ~held])
    across = J[:, held] - rest @ (rest.T @ J[:, held])
    lengths = np.linalg.norm(across, axis=0)  # 0 where bounds alone hold an entry
    reach = np.divide(slope, lengths, out=np.zeros_like(slope), where=lengths > 0)
    # exp(u^2 / 2) Phi(-u) is erfcx(u / sqrt 2) / 2
    return float(np.sum(np.log(scipy.special.erfcx(reach / np.sqrt(2)) / 2)))


def bounds_of(target: LogDensity) -> tuple[Array, Array]:
    """The bounds of z, (k,) each."""
    space, problem = target.subspace, target.problem
    return problem.lower[space.entries], problem.upper[space.entries]


def dependent_bounds(target: LogDensity) -> tuple[Array, Array, Array]:
    """Bounds on numbers on the ridge of what is integrated out: low <= A z <= high.

    A is (c, k), low and high (c,); c is 0 where the rest stays where it is.
    """
    space, problem = target.subspace, target.problem
    bounded = np.isfinite(problem.lower) | np.isfinite(problem.upper)
    bounded[space.entries] = False
    size = abs(space.along).max(axis=0, initial=0.0)  # what rounding moves does not move
    bounded &= (abs(space.along) > ROUNDING * size).any(axis=1)
    A = space.along[bounded]
    offset = space.origin[bounded] - A @ space.centre
    return A, problem.lower[bounded] - offset, problem.upper[bounded] - offset


def covariance_half(target: LogDensity, J: Array) -> Array:
    """A square root of (J'J)^-1.

    The variance of an entry with two bounds is at most that of a uniform distribution.
    """
    return inverse_half(target, np.vstack([J, rows_between(*bounds_of(target), np.sqrt(12))]))


def rows_between(low: Array, high: Array, scale: float) -> Array:
    """For every entry with two bounds, a row that weighs it by `scale` over their distance."""
    width = high - low
    known = np.isfinite(width) & (width > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.diag(np.where(known, scale / width, 0.0))[known])


def inverse_half(target: LogDensity, J: Array) -> Array:
    """A half (k, k) with half half' = (J'J)^-1.

    Raises Improper if J has no full rank. That is judged with columns of length 1, so that no unit
    decides what is seen.
    """
    lengths = np.linalg.norm(J, axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    _, nonzero, Vt = np.linalg.svd(J / lengths, full_matrices=len(J) < J.shape[1])
    s = np.zeros(J.shape[1])
    s[: nonzero.size] = nonzero
    if (s <= np.finfo(float).eps * max(J.shape) * max(s.max(initial=0), 1e-300)).any():
        direction = abs(Vt[int(np.argmin(s))] / lengths)
        raise Improper(
            f"nothing holds a direction with {target.subspace.labels[int(np.argmax(direction))]}: "
            "its posterior has no width. Add a prior or bounds, or fix it; `workbench diagnose` "
            "names all such directions"
        )
    return np.asarray(Vt.T / s / lengths[:, None])


def _constrained(target: LogDensity, start: Array, residual: Vector, jacobian: Vector) -> Array:
    """The minimum from a start by SciPy's SLSQP, in units of the Jacobian's columns.

    Raises NoMinimum if it ends where constraints are violated or a residual means nothing.
    """
    space, constraints = target.subspace, target.problem.stacked_constraints
    lengths = np.linalg.norm(jacobian(start), axis=0)
    scale = 1 / np.where(lengths > 0, lengths, 1.0)
    G, low, high = dependent_bounds(target)
    gap = [
        INSIDE * np.maximum(1.0, np.where(np.isfinite(side), abs(side), 0)) for side in (low, high)
    ]
    low, high = low + gap[0], high - gap[1]
    moving = np.zeros(0, dtype=bool)
    if constraints is not None:
        moving = ~constraints.equal  # an equation between numbers that stay is no matter of z
        low = np.concatenate([constraints.lower[moving], low])
        high = np.concatenate([constraints.upper[moving], high])
    below, above = np.isfinite(low), np.isfinite(high)

    def margins(u: Array) -> Array:
        z = start + scale * u
        c = G @ z
        if constraints is not None:
            c = np.concatenate(
                [constraints.values(space.points(z[None])[0], target.fixed)[moving], c]
            )
        return np.concatenate([(c - low)[below], (high - c)[above]])

    def margins_jacobian(u: Array) -> Array:
        A = G * scale
        if constraints is not None:
            here = constraints.linearize(space.points((start + scale * u)[None])[0], target.fixed)
            A = np.vstack([here.along(space.along)[moving] * scale, A])
        return np.concatenate([A[below], -A[above]])

    def cost(u: Array) -> float:
        z = start + scale * u
        inside = target.in_domain(z[None])[0]
        return 0.5 * float(np.sum(residual(z) ** 2)) if inside else np.inf

    def gradient(u: Array) -> Array:
        z = start + scale * u
        return np.asarray(scale * (jacobian(z).T @ residual(z)))

    least, most = ((side - start) / scale for side in bounds_of(target))
    solution = scipy.optimize.minimize(
        cost,
        np.zeros(len(start)),
        method="SLSQP",
        jac=gradient,
        bounds=scipy.optimize.Bounds(least, most),
        constraints=scipy.optimize.NonlinearConstraint(margins, 0.0, np.inf, jac=margins_jacobian),
        options={"maxiter": 500, "ftol": 1e-10},
    )
    z = np.asarray(start + scale * solution.x)
    if not (target.allows(space.points(z[None]))[0] and target.in_domain(z[None])[0]):
        why = violation_in_words(target.problem, target.fixed, space.points(z[None])[0])
        raise NoMinimum(
            f"no point near the start meets the bounds and constraints ({why}); solve the problem "
            "with a solver that takes constraints, and start at its answer"
        )
    return z


def _predicted_decrease(r: Array, J: Array, z: Array, low: Array, high: Array) -> float:
    """By how much the linear model predicts that the cost can fall, entries at bounds fixed."""
    near = AT_A_BOUND * np.maximum(1.0, abs(z))
    free = (z - low > near) & (high - z > near)
    if not free.any() or not np.isfinite(J).all():
        return 0.0 if not free.any() else np.inf
    step = np.linalg.lstsq(J[:, free], -r)[0]
    return 0.5 * float(np.sum((J[:, free] @ step) ** 2))


@dataclass(frozen=True, eq=False)
class ModeSearch:
    """The modes that were found, the largest first, and how widely they were looked for."""

    modes: tuple[Mode, ...]  # the modes
    starts: int  # how many searches there were
    farthest: float  # the largest distance of a start, in Laplace's standard deviations
    boxed: int  # how many entries have two bounds, over which starts were spread as well
    components: int = 0  # how many of the searches began at a component of a mixture

    def __str__(self) -> str:
        if not self.starts:
            return "no other modes were looked for"
        text = f"{self.starts} searches for other modes, up to {self.farthest:,.0f} sd away"
        if self.components:
            text += f", from each of {self.components} components of mixtures"
        if self.boxed:
            entries = "entry" if self.boxed == 1 else "entries"
            text += f" and all over the bounds of {self.boxed} {entries}"
        count = len(self.modes)
        text += ", found none" if count == 1 else f", led to {count} modes in all"
        return text if self.components else f"{text}; a much narrower mode can be missed"


def modes(target: LogDensity, first: Mode, rng: np.random.Generator) -> ModeSearch:
    """The modes that least squares finds from wide starts, beside the first, best first.

    A search that ends on a plateau, where the linear model still predicts a decrease of the
    cost, has found no mode. Rotation vectors beyond half a turn are replaced by the shorter ones
    of the same rotations, for a turn more is no other mode. Other modes may exist that no search
    finds, above all much narrower ones. Those of a mixture are looked for from its components.
    """
    minima = [first]
    wide, farthest, boxed = wide_starts(target, first, rng)
    from_components = component_starts(target, first)
    for start in (*from_components, *wide):
        mode = _settled_mode(target, start)
        if mode is not None:
            _include(minima, mode, target)
    masses = np.array([mode.log_mass for mode in minima])
    shares = np.exp(masses - masses.max())
    kept = [
        replace(mode, share=float(share))
        for mode, share in zip(minima, shares / shares.sum(), strict=True)
        if share > NEGLIGIBLE_SHARE * shares.max()
    ]
    count = len(from_components)
    by_share = tuple(sorted(kept, key=lambda mode: -mode.share))
    return ModeSearch(by_share, len(wide) + count, farthest, boxed, count)


def _settled_mode(target: LogDensity, start: Array) -> Mode | None:
    """The mode at which a search ends, with rotations at their shortest; None if it finds none."""
    try:
        mode = mode_from(target, shortest_rotations(target, start))
        turned = shortest_rotations(target, mode.z)
        if not np.array_equal(turned, mode.z):
            mode = mode_from(target, turned)
    except (Improper, NoMinimum, np.linalg.LinAlgError, ValueError):
        return None
    return mode if mode.settled else None


def _include(minima: list[Mode], mode: Mode, target: LogDensity) -> None:
    """Add a mode to the minima, or keep the lower one of it and the minimum that it repeats."""
    for j, known in enumerate(minima):
        turned = shortest_rotations(target, known.z)
        near = min(known.distance(mode.z), mode.distance(turned)) < SAME_MODE
        if near and abs(known.cost - mode.cost) < 0.1:
            minima[j] = min(known, mode, key=lambda m: m.cost)
            return
    minima.append(mode)


def missed_mode(minima: tuple[Mode, ...], draws: Array) -> tuple[float, float] | None:
    """The largest mode of comparable mass that draws (N, k) hardly visit, or None.

    Returns two shares of this mode: of the mass of all modes, and of the draws.
    """
    nearest = nearest_mode(minima, draws[:: max(1, len(draws) // MOST_ASSIGNED)])
    shares = ((mode.share, float(np.mean(nearest == i))) for i, mode in enumerate(minima))
    missed = (s for s in shares if s[0] >= COMPARABLE_SHARE and s[1] < VISITED_SHARE * s[0])
    return next(missed, None)


def nearest_mode(minima: Sequence[Mode], z: Array) -> Index:
    """The number of the mode (N,) that each point z (N, k) belongs to: that whose Laplace
    approximation, times its share, has the highest density there.
    """
    log_density = [
        np.log(mode.share)
        - np.linalg.slogdet(mode.half)[1]
        - 0.5 * np.sum(np.linalg.solve(mode.half, (z - mode.z).T) ** 2, axis=0)
        for mode in minima
    ]
    return np.asarray(np.argmax(log_density, axis=0))


def walkers_at(
    target: LogDensity, minima: tuple[Mode, ...], count: int, rng: np.random.Generator
) -> Array:
    """Draws (count, k) of the modes' Laplace approximations, each mode by its share, in bounds."""
    shares = np.array([mode.share for mode in minima])
    shares[shares < POPULATED_SHARE * shares.sum()] = 0.0
    chosen = rng.choice(len(minima), size=count, p=shares / shares.sum())
    return np.array([_walker_at(target, minima[int(i)], rng) for i in chosen])


def _walker_at(target: LogDensity, mode: Mode, rng: np.random.Generator) -> Array:
    """A draw (k,) of a mode's Laplace approximation that has a density."""
    for _ in range(20):
        z = mode.z + mode.half @ rng.standard_normal(len(mode.z))
        if np.isfinite(target(z[None])[0]):
            return z
    for _ in range(60):  # so much of the way from the mode that it has a density
        z = mode.z + 0.5 * (z - mode.z)
        if np.isfinite(target(z[None])[0]):
            return z
    return mode.z


def improper_in_words(target: LogDensity, mode: Mode, draws: Array) -> str:
    """Why there is no posterior where draws (..., k) have run away from a mode; "" if they did not.

    A density in k numbers that can be normalised falls faster than 1 / r^k with the distance r.
    Draws that are a thousand of Laplace's standard deviations away have run away where in their
    direction, a million times as far, it has not even fallen like 1 / r.
    """
    z = draws.reshape(-1, target.subspace.size)
    with np.errstate(over="ignore"):
        distance = np.linalg.norm(np.linalg.solve(mode.half, (z - mode.z).T), axis=0)
    farthest = int(np.argmax(distance))
    if not REACH[1] < distance[farthest] < np.inf:
        return ""
    direction = (z[farthest] - mode.z) / distance[farthest]
    values = target(mode.z + FAR_AWAY[:, None] * direction)
    fallen, needed = values.max() - values[-1], np.log(FAR_AWAY[-1] / FAR_AWAY[0])
    if not fallen < needed:
        return ""
    in_sds = abs(direction) / np.linalg.norm(mode.half, axis=1)
    most = target.subspace.labels[int(np.argmax(in_sds))]
    return (
        f"draws run away without end, above all in {most}. In their direction the log density "
        f"falls by {fallen:.2g} between {FAR_AWAY[0]:,.0f} and {FAR_AWAY[-1]:,.0f} sd from the "
        f"mode; were it to fall by less than {needed:.0f} everywhere, its integral would be "
        "infinite. Give what runs away a prior or bounds"
    )


def shortest_rotations(target: LogDensity, z: Array) -> Array:
    """z (k,) with rotation vectors beyond half a turn replaced by those of the same rotations.

    Rotation vectors are those of the joints of the problem's bodies. One of which only a part is
    sampled stays as it is, and so does one whose bounds forbid the shorter vector.
    """
    space, problem = target.subspace, target.problem
    x, sampled = space.points(z[None])[0], np.isin(np.arange(problem.free.size), space.entries)
    for row in problem.rotations:
        length = float(np.linalg.norm(x[row]))
        if length > np.pi and sampled[row].all():
            shorter = rotation.wrapped_to_pi(x[row])
            if ((shorter >= problem.lower[row]) & (shorter <= problem.upper[row])).all():
                x[row] = shorter
    return np.asarray(x[space.entries])


def wide_starts(
    target: LogDensity, first: Mode, rng: np.random.Generator
) -> tuple[list[Array], float, int]:
    """Starts (k,) for searches, how far they reach, and over how many bounds they are spread.

    Each shell of distances gives two starts: of many random points the one with the least cost, and
    the one with the least cost on the other side of the first mode. Half of the points move all
    entries, the other half a single entry and those that are correlated with it. If entries have
    two bounds, two more starts come from points everywhere between these. Points without a density
    are left out.
    """
    k = target.subspace.size
    low, high = bounds_of(target)
    edges = np.geomspace(*REACH, SHELLS + 1)
    covariance = first.half @ first.half.T
    alone = covariance / np.sqrt(np.diag(covariance))  # columns: one entry by 1 sd, all along
    starts: list[Array] = []
    farthest = 0.0
    for near, far in pairwise(edges):
        distance = near * (far / near) ** rng.uniform(size=(POINTS_IN_SHELL, 1))
        direction = rng.standard_normal((POINTS_IN_SHELL, k)) @ first.half.T
        single = rng.integers(k, size=POINTS_IN_SHELL // 2)
        direction[::2] = (
            rng.choice([-1.0, 1.0], size=(POINTS_IN_SHELL // 2, 1)) * alone[:, single].T
        )
        z = np.clip(first.z + distance * direction, low, high)
        lowest = _lowest(target, first, z)
        if lowest:
            farthest = far
        starts += lowest
    two_sided = np.isfinite(high - low) & (high > low)
    if two_sided.any():
        z = first.z + REACH[0] * rng.standard_normal((POINTS_IN_SHELL, k)) @ first.half.T
        share = rng.uniform(size=(POINTS_IN_SHELL, int(two_sided.sum())))
        z[:, two_sided] = low[two_sided] + share * (high - low)[two_sided]
        starts += _lowest(target, first, np.clip(z, low, high))
    return starts, farthest, int(two_sided.sum())


def component_starts(target: LogDensity, first: Mode) -> list[Array]:
    """Starts (k,) for searches, from residuals that know their components, as mixtures do.

    Each is the minimum that least squares reaches from the first mode where one component stands
    in place of the mixture; without other residuals, that is the component's mean.
    """
    problem, starts = target.problem, list[Array]()
    for i, mixture in enumerate(problem.residuals):
        for component in mixture.components:
            each = [*problem.residuals[:i], component, *problem.residuals[i + 1 :]]
            alone = replace(target, problem=problem.variant(each, problem.free.spelled()))
            try:
                starts.append(mode_from(alone, first.z).z)
            except (Improper, NoMinimum, np.linalg.LinAlgError, ValueError):
                continue
    return starts


def _lowest(target: LogDensity, first: Mode, z: Array) -> list[Array]:
    """The point of least cost among z (M, k), and that on the other side of the first mode."""
    log_p = target(z)
    finite = np.isfinite(log_p)
    if not finite.any():
        return []
    best = int(np.argmax(log_p))
    directions = np.linalg.solve(first.half, (z - first.z).T).T
    opposite = finite & (directions @ directions[best] < 0)
    if not opposite.any():
        return [z[best]]
    return [z[best], z[int(np.argmax(np.where(opposite, log_p, -np.inf)))]]
