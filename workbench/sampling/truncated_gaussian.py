"""Laplace's Gaussian, cut off by bounds and by inequality constraints."""

from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Array
from workbench.sampling.descent import Mode, bounds_of, dependent_bounds, inverse_half, rows_between
from workbench.sampling.log_density import LogDensity
from workbench.sampling.truncated_normal import truncated_normal

TRIED = 2000  # draws that are looked at for what linear constraints cut away
ENOUGH = 100  # of them that must be allowed, so that a share of 0.05 is seen
REACHED = 1e-6  # of the largest value of a linear limit: on it
WIDE = 1 / 30  # over the distance of two bounds: a Gaussian that is flat between them to 0.06 %


@dataclass(frozen=True, eq=False)
class TruncatedGaussian:
    """z = mean + half w, w standard normal where F w + g >= 0; `start` is a w that meets it.

    Attributes:
        mean: (k,).
        half: (k, k) a square root of the covariance.
        F: (c, k) the gradients of the limits.
        g: (c,) their offsets.
        start: (k,) a w that meets all limits.
        cost: the cost at the start.
        boxed: how many rows of F are bounds; the others are linearized constraints.
    """

    mean: Array
    half: Array
    F: Array
    g: Array
    start: Array
    cost: float
    boxed: int = 0


def truncated_laplace(target: LogDensity, mode: Mode) -> TruncatedGaussian:
    """The linear model at a mode, r + J (z - z*), restricted to bounds and linearized constraints.

    Its mean is the point where the model is least, z* - (J'J)^-1 J'r, wherever that lies: at a
    minimum on a bound it is beyond the bound. An entry that bounds alone hold is uniform there.
    """
    k, there = len(mode.z), target.problem.stacked_constraints
    own, moved_along = bounds_of(target), dependent_bounds(target)
    B = np.vstack([np.eye(k), moved_along[0]])
    low, high = (np.concatenate([own[i], moved_along[1 + i]]) for i in (0, 1))
    below, above = np.isfinite(low), np.isfinite(high)
    if there is None and not (below.any() or above.any()):
        return TruncatedGaussian(
            mode.z, mode.half, np.empty((0, k)), np.empty(0), np.zeros(k), mode.cost
        )
    space = target.subspace
    x = space.points(mode.z[None])[0]
    here = target.problem.linearize_at(x, target.fixed)
    J = here.jacobian @ space.along
    half = inverse_half(target, np.vstack([J, rows_between(*bounds_of(target), WIDE)]))
    mean = mode.z - half @ (half.T @ (J.T @ here.residual))
    rows = [(B @ half)[below], -(B @ half)[above]]
    margins = [(B @ mean - low)[below], (high - B @ mean)[above]]
    if there is not None:
        seen = there.linearize(x, target.fixed)
        A = seen.along(space.along)
        moved = A @ (mean - mode.z)
        for side, limit in ((1.0, seen.lower), (-1.0, seen.upper)):
            some = np.isfinite(limit) & ~there.equal
            rows.append(side * (A @ half)[some])
            margins.append(side * (seen.values + moved - limit)[some])
    start = np.asarray(np.linalg.solve(half, mode.z - mean), dtype=float)
    return TruncatedGaussian(
        mean,
        half,
        np.vstack(rows),
        np.concatenate(margins),
        start,
        mode.cost,
        int(below.sum() + above.sum()),
    )


def share_cut_off(
    target: LogDensity, gaussian: TruncatedGaussian, rng: np.random.Generator
) -> float:
    """The share of the Gaussian that constraints allow and their linearization does not.

    0 where constraints are linear. Importance weights cannot see it: no draw is there to weigh.
    1 where bounds alone leave too few allowed draws to tell.
    """
    there = target.problem.stacked_constraints
    if there is None or gaussian.boxed == len(gaussian.F):
        return 0.0
    free = replace(
        gaussian,
        F=gaussian.F[: gaussian.boxed],
        g=gaussian.g[: gaussian.boxed],
    )
    drawn, along = draws_from(free, TRIED, rng)[0], np.linalg.inv(gaussian.half).T
    x = target.subspace.points(drawn)
    linear = (drawn - gaussian.mean) @ along @ gaussian.F[gaussian.boxed :].T + gaussian.g[
        gaussian.boxed :
    ]
    allowed, kept = target.allows(x), (linear >= -REACHED * abs(linear).max()).all(axis=1)
    if not (allowed & ~kept).any() and not (kept & ~allowed).any():
        return 0.0
    if allowed.sum() < ENOUGH:
        return 1.0
    return float(np.mean(~kept[allowed]))


def draws_from(
    gaussian: TruncatedGaussian, count: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Draws z (count, k), and their log density up to a constant, (count,)."""
    w = rng.standard_normal((count, len(gaussian.mean)))
    if not (w @ gaussian.F.T + gaussian.g >= 0).all():
        w = truncated_normal(gaussian.F, gaussian.g, gaussian.start, count, rng)
    log_q = -gaussian.cost - 0.5 * (np.sum(w**2, axis=1) - np.sum(gaussian.start**2))
    return gaussian.mean + w @ gaussian.half.T, log_q
