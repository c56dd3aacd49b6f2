"""Where a posterior has its modes: minima of the cost, looked for from many places."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from workbench.arrays import Array, Index
from workbench.geometry import rotation
from workbench.sampling.descent import Mode, NoMinimum, bounds_of, into_bounds, mode_from
from workbench.sampling.log_density import LogDensity
from workbench.sampling.subspace import Improper

APART = 1.0  # standard deviations: minima that are nearer to each other are one
NEGLIGIBLE = 1e-4  # of the largest mass
SETTLED = 0.01  # of the mass of all: in smaller modes no walker begins, for it would never leave
COMPARABLE = 0.05  # of the mass of all: a mode that draws have to visit
VISITED = 0.2  # of a mode's share: fewer of the draws are there, and it counts as missed
ASSIGNED = 20_000  # draws that are looked at
REACH = (3.0, 1000.0)  # standard deviations of Laplace's approximation that starts are away
SHELLS = 8  # of distances, in equal ratios
TRIED = 128  # points in each of them
BEYOND = np.geomspace(REACH[1], 1e6 * REACH[1], 7)  # Laplace's standard deviations from a mode


@dataclass(frozen=True)
class SearchExtent:
    """How widely other modes were looked for.

    Attributes:
        starts: how many searches there were.
        farthest: the largest distance of a start, in Laplace's standard deviations.
        boxed: how many entries have two bounds, over which starts were spread as well.
        components: how many of the searches began at a component of a mixture.
    """

    starts: int
    farthest: float
    boxed: int
    components: int = 0

    def __str__(self) -> str:
        if not self.starts:
            return "no other modes were looked for"
        said = f"{self.starts} searches for other modes, up to {self.farthest:,.0f} sd away"
        if self.components:
            said += f", from each of {self.components} components of mixtures"
        entries = "entry" if self.boxed == 1 else "entries"
        return said + (f" and all over the bounds of {self.boxed} {entries}" if self.boxed else "")


@dataclass(frozen=True, eq=False)
class ModeSearch:
    """The modes that were found, the largest first, and how widely they were looked for."""

    modes: tuple[Mode, ...]
    extent: SearchExtent


def modes(target: LogDensity, first: Mode, rng: np.random.Generator) -> ModeSearch:
    """The modes that least squares finds from wide starts, beside the first, best first.

    A search that ends on a plateau, where the linear model still predicts a decrease of the
    cost, has found no mode. Rotation vectors beyond half a turn are replaced by the shorter ones
    of the same rotations, for a turn more is no other mode. Other modes may exist that no search
    finds, above all much narrower ones. Those of a mixture are looked for from its components.
    """
    found = [first]
    starts, extent = wide_starts(target, first, rng)
    from_components = component_starts(target, first)
    count = len(from_components)
    extent = replace(extent, starts=extent.starts + count, components=count)
    for start in (*from_components, *starts):
        try:
            mode = mode_from(target, shortest_rotations(target, start))
            turned = shortest_rotations(target, mode.z)
            if not np.array_equal(turned, mode.z):
                mode = mode_from(target, turned)
        except (Improper, NoMinimum, np.linalg.LinAlgError, ValueError):
            continue
        if not mode.settled:
            continue
        same = [
            j
            for j, known in enumerate(found)
            if abs(known.cost - mode.cost) < 0.1
            and min(known.away(mode.z), mode.away(shortest_rotations(target, known.z))) < APART
        ]
        if same:
            j = same[0]
            best = min(found[j], mode, key=lambda m: m.cost)
            found[j] = replace(best, found=found[j].found + 1)
        else:
            found.append(mode)
    masses = np.array([mode.log_mass for mode in found])
    shares = np.exp(masses - masses.max())
    kept = [
        replace(mode, share=float(share))
        for mode, share in zip(found, shares / shares.sum(), strict=True)
        if share > NEGLIGIBLE * shares.max()
    ]
    return ModeSearch(tuple(sorted(kept, key=lambda mode: -mode.share)), extent)


def missed_in_words(missed: tuple[float, float], exact: bool) -> str:
    """What draws lack that hardly visit a mode; `exact` draws are Laplace's, of one mode."""
    share, here = missed
    return (
        f"least squares finds another mode with {share:.0%} of the mass (by Laplace's "
        f"approximation), where {here:.1%} of the draws are. "
    ) + (
        "Laplace's approximation is of one mode; draw with `sample`"
        if exact
        else "Begin at the other mode and compare, or add what tells the modes apart"
    )


def search_in_words(found: ModeSearch) -> str:
    """How widely other modes were looked for, and how many modes are known."""
    count = len(found.modes)
    if not found.extent.starts:
        return str(found.extent)
    said = f"{found.extent}, {'found none' if count == 1 else f'led to {count} modes in all'}"
    return said if found.extent.components else f"{said}; a much narrower mode can be missed"


def missed_mode(known: tuple[Mode, ...], draws: Array) -> tuple[float, float] | None:
    """The largest mode of comparable mass that draws (N, k) hardly visit, or None.

    Returns two shares of this mode: of the mass of all modes, and of the draws.
    """
    if len(known) < 2:
        return None
    some = draws[:: max(1, len(draws) // ASSIGNED)]
    which = nearest_mode(known, some)
    for i, mode in enumerate(known):
        here = float(np.mean(which == i))
        if mode.share >= COMPARABLE and here < VISITED * mode.share:
            return mode.share, here
    return None


def nearest_mode(known: Sequence[Mode], z: Array) -> Index:
    """The number of the mode (N,) that each point z (N, k) belongs to: that whose Laplace
    approximation, times its share, has the highest density there.
    """
    likely = [
        np.log(mode.share)
        - np.linalg.slogdet(mode.half)[1]
        - 0.5 * np.sum(np.linalg.solve(mode.half, (z - mode.z).T) ** 2, axis=0)
        for mode in known
    ]
    return np.asarray(np.argmax(likely, axis=0))


def walkers_at(
    target: LogDensity, found: tuple[Mode, ...], count: int, rng: np.random.Generator
) -> Array:
    """Draws (count, k) of the modes' Laplace approximations, each mode by its share, in bounds."""
    shares = np.array([mode.share for mode in found])
    shares[shares < SETTLED * shares.sum()] = 0.0
    which = rng.choice(len(found), size=count, p=shares / shares.sum())
    z = np.empty((count, target.subspace.size))
    for i, k in enumerate(which):
        mode = found[int(k)]
        for _ in range(20):
            z[i] = mode.z + mode.half @ rng.standard_normal(len(mode.z))
            if np.isfinite(target(z[i : i + 1])[0]):
                break
        else:
            z[i] = into_bounds(target, mode.z, z[i])
    return z


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
    way = (z[farthest] - mode.z) / distance[farthest]
    values = target(mode.z + BEYOND[:, None] * way)
    fallen, needed = values.max() - values[-1], np.log(BEYOND[-1] / BEYOND[0])
    if not fallen < needed:
        return ""
    most = target.subspace.labels[int(np.argmax(abs(way) / np.linalg.norm(mode.half, axis=1)))]
    return (
        f"draws run away without end, above all in {most}. In their direction the log density "
        f"falls by {fallen:.2g} between {BEYOND[0]:,.0f} and {BEYOND[-1]:,.0f} sd from the mode; "
        f"were it to fall by less than {needed:.0f} everywhere, its integral would be infinite. "
        "Give what runs away a prior or bounds"
    )


def shortest_rotations(target: LogDensity, z: Array) -> Array:
    """z (k,) with rotation vectors beyond half a turn replaced by those of the same rotations.

    Rotation vectors are those of the joints of the problem's bodies. One of which only a part is
    sampled stays as it is, and so does one whose bounds forbid the shorter vector.
    """
    space, problem = target.subspace, target.problem
    if space.entries is None:
        return z
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
) -> tuple[list[Array], SearchExtent]:
    """Starts (k,) for searches, and how far they reach.

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
    found: list[Array] = []
    farthest = 0.0
    for near, far in pairwise(edges):
        distance = near * (far / near) ** rng.uniform(size=(TRIED, 1))
        way = rng.standard_normal((TRIED, k)) @ first.half.T
        single = rng.integers(k, size=TRIED // 2)
        way[::2] = rng.choice([-1.0, 1.0], size=(TRIED // 2, 1)) * alone[:, single].T
        z = np.clip(first.z + distance * way, low, high)
        chosen = _lowest(target, first, z)
        if chosen:
            farthest = far
        found += chosen
    two_sided = np.isfinite(high - low) & (high > low)
    if two_sided.any():
        z = first.z + REACH[0] * rng.standard_normal((TRIED, k)) @ first.half.T
        share = rng.uniform(size=(TRIED, int(two_sided.sum())))
        z[:, two_sided] = low[two_sided] + share * (high - low)[two_sided]
        found += _lowest(target, first, np.clip(z, low, high))
    return found, SearchExtent(len(found), farthest, int(two_sided.sum()))


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
    value = target(z)
    known = np.isfinite(value)
    if not known.any():
        return []
    best = int(np.argmax(value))
    ways = np.linalg.solve(first.half, (z - first.z).T).T
    other = known & (ways @ ways[best] < 0)
    if not other.any():
        return [z[best]]
    return [z[best], z[int(np.argmax(np.where(other, value, -np.inf)))]]
