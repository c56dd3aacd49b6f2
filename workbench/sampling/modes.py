"""Where a posterior has its modes: minima of the cost, looked for from many places."""

from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Array
from workbench.sampling.descent import Mode, NoMinimum, into_bounds, mode_from
from workbench.sampling.log_density import LogDensity
from workbench.sampling.rotations import shortest_rotations
from workbench.sampling.starts import SearchExtent, wide_starts
from workbench.sampling.subspace import Improper

APART = 1.0  # standard deviations: minima that are nearer to each other are one
NEGLIGIBLE = 1e-4  # of the largest mass
SETTLED = 0.01  # of the mass of all: in smaller modes no walker begins, for it would never leave
COMPARABLE = 0.05  # of the mass of all: a mode that draws have to visit
VISITED = 0.2  # of a mode's share: fewer of the draws are there, and it counts as missed
ASSIGNED = 20_000  # draws that are looked at


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
    finds.
    """
    found = [first]
    starts, search = wide_starts(target, first, rng)
    for start in starts:
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
    return ModeSearch(tuple(sorted(kept, key=lambda mode: -mode.share)), search)


def search_in_words(found: ModeSearch) -> str:
    """How widely other modes were looked for, and how many modes are known."""
    count = len(found.modes)
    if not found.extent.starts:
        return str(found.extent)
    return f"{found.extent}, {'found none' if count == 1 else f'led to {count} modes in all'}"


def missed_mode(known: tuple[Mode, ...], draws: Array) -> tuple[float, float] | None:
    """The largest mode of comparable mass that draws (N, k) hardly visit, or None.

    It is said by its share of the mass of all modes and of the draws. A draw belongs to the mode
    whose Laplace approximation, weighed by its share, is the most probable to have made it.
    """
    if len(known) < 2:
        return None
    some = draws[:: max(1, len(draws) // ASSIGNED)]
    likely = [
        np.log(mode.share)
        - np.linalg.slogdet(mode.half)[1]
        - 0.5 * np.sum(np.linalg.solve(mode.half, (some - mode.z).T) ** 2, axis=0)
        for mode in known
    ]
    which = np.argmax(likely, axis=0)
    for i, mode in enumerate(known):
        here = float(np.mean(which == i))
        if mode.share >= COMPARABLE and here < VISITED * mode.share:
            return mode.share, here
    return None


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
