"""Where a posterior has its modes: minima of the cost, looked for from many places."""

from dataclasses import dataclass

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from workbench.sampling.subspace import Improper
from workbench.sampling.target import Target

Array = NDArray[np.float64]
SPREAD = (3.0, 30.0)  # standard deviations of Laplace's approximation that searches begin away
APART = 1.0  # of them: minima that are nearer to each other are one
NEGLIGIBLE = 1e-4  # of the largest mass
SETTLED = 0.01  # of the mass of all: in smaller modes no walker begins, for it would never leave


@dataclass(frozen=True, eq=False)
class Mode:
    """A minimum of the cost in z, and Laplace's approximation there."""

    z: Array  # (k,)
    cost: float
    half: Array  # (k, k): half @ half.T is the covariance
    log_mass: float  # log of its integral, up to the constant that all share
    share: float = 1.0  # of the mass of all modes
    found: int = 1  # how many searches ended here

    def away(self, z: Array) -> float:
        """How many standard deviations a point is away, as a root mean square over entries."""
        return float(np.linalg.norm(np.linalg.solve(self.half, z - self.z)) / np.sqrt(len(z)))


def modes(target: Target, rng: np.random.Generator, searches: int = 12) -> tuple[Mode, ...]:
    """The modes that least squares finds from the centre and from places around it, best first.

    The places come in pairs, on both sides of the first mode, some near and some far away. That
    there are no other modes is not known. Raises Improper where a direction is held by nothing.
    """
    first = _descended(target, target.subspace.centre)
    found = [first]
    away = np.zeros(target.subspace.size)
    for i in range(searches):
        if i % 2:
            away = -away
        else:
            far = SPREAD[0] * (SPREAD[1] / SPREAD[0]) ** rng.uniform()
            away = far * (first.half @ rng.standard_normal(len(away)))
        start = _into_bounds(target, first.z, first.z + away)
        try:
            mode = _descended(target, start)
        except (Improper, np.linalg.LinAlgError, ValueError):
            continue
        same = [
            j for j, known in enumerate(found)
            if abs(known.cost - mode.cost) < 0.1 and known.away(mode.z) < APART
        ]  # fmt: skip
        if same:
            j = same[0]
            best = min(found[j], mode, key=lambda m: m.cost)
            found[j] = _counted(best, found[j].found + 1, best.share)
        else:
            found.append(mode)
    masses = np.array([mode.log_mass for mode in found])
    shares = np.exp(masses - masses.max())
    kept = [
        _counted(mode, mode.found, share)
        for mode, share in zip(found, shares / shares.sum(), strict=True)
        if share > NEGLIGIBLE * shares.max()
    ]
    return tuple(sorted(kept, key=lambda mode: -mode.share))


def walkers_at(
    target: Target, found: tuple[Mode, ...], count: int, rng: np.random.Generator
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
            z[i] = _into_bounds(target, mode.z, z[i])
    return z


def _counted(mode: Mode, found: int, share: float) -> Mode:
    return Mode(mode.z, mode.cost, mode.half, mode.log_mass, share, found)


def _descended(target: Target, start: Array) -> Mode:
    problem, space = target.problem, target.subspace

    def x_at(z: Array) -> Array:
        return np.asarray(space.points(z[None])[0])

    def residual(z: Array) -> Array:
        return problem.residual(x_at(z), target.fixed)

    def jacobian(z: Array) -> Array:
        return problem.linearize_at(x_at(z), target.fixed).jacobian @ space.along

    low, high = np.full(space.size, -np.inf), np.full(space.size, np.inf)
    if space.entries is not None:
        low, high = problem.lower[space.entries], problem.upper[space.entries]
        gap = 1e-10 * np.maximum(1.0, abs(start))
        thin = high - low <= 4 * gap  # trf wants room
        start = np.where(thin, start, np.clip(start, low + gap, high - gap))
        low, high = np.where(thin, -np.inf, low), np.where(thin, np.inf, high)
    ended = scipy.optimize.least_squares(
        residual, start, jacobian, bounds=(low, high), x_scale="jac", max_nfev=200
    )
    half = _half(target, jacobian(ended.x))
    log_det = np.linalg.slogdet(half)[1]
    return Mode(ended.x, float(ended.cost), half, float(log_det - ended.cost))


def _half(target: Target, J: Array) -> Array:
    """Of (J'J)^-1; a bound on both sides counts as a uniform distribution's variance."""
    space, problem = target.subspace, target.problem
    if space.entries is not None:
        width = (problem.upper - problem.lower)[space.entries]
        known = np.isfinite(width) & (width > 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            J = np.vstack([J, np.diag(np.where(known, np.sqrt(12) / width, 0.0))[known]])
    _, s, Vt = np.linalg.svd(J, full_matrices=False)
    if len(s) < space.size or s.min() <= np.finfo(float).eps * max(J.shape) * s.max():
        label = space.labels[int(np.argmax(abs(Vt[-1])))]
        raise Improper(
            f"nothing holds a direction with {label}: its posterior has no width. Add a prior or "
            "bounds, or fix it; `workbench diagnose` names all such directions"
        )
    return np.asarray(Vt.T / s)


def _into_bounds(target: Target, inside: Array, z: Array) -> Array:
    """z, or so much of the way to it from a point inside that it has a density."""
    for _ in range(60):
        if np.isfinite(target(z[None])[0]):
            return z
        z = inside + 0.5 * (z - inside)
    return inside.copy()
