"""Laplace's Gaussian, cut off by bounds and by inequality constraints."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.sampling.descent import Mode, bound_rows, box, carried, inverse_half
from workbench.sampling.target import Target
from workbench.sampling.truncated import truncated

Array = NDArray[np.float64]
TRIED = 2000  # draws that are looked at for what linear constraints cut away
ENOUGH = 100  # of them that must be allowed, so that a share of 0.05 is seen
REACHED = 1e-6  # of the largest value of a linear limit: on it
WIDE = 1 / 30  # over the distance of two bounds: a Gaussian that is flat between them to 0.06 %


@dataclass(frozen=True, eq=False)
class Cut:
    """z = mean + half w, w standard normal where F w + g >= 0; `start` is a w that meets it."""

    mean: Array  # (k,)
    half: Array  # (k, k)
    F: Array  # (c, k)
    g: Array  # (c,)
    start: Array  # (k,)
    cost: float  # at the start
    boxed: int = 0  # rows of F that are bounds; the others are linearized constraints


def cut(target: Target, mode: Mode) -> Cut:
    """The linear model at a mode, r + J (z - z*), restricted to bounds and linearized constraints.

    Its mean is the point where the model is least, z* - (J'J)^-1 J'r, wherever that lies: at a
    minimum on a bound it is beyond the bound. An entry that bounds alone hold is uniform there.
    """
    k, there = len(mode.z), target.problem.stacked_constraints
    own, moved_along = box(target), carried(target)
    B = np.vstack([np.eye(k), moved_along[0]])
    low, high = (np.concatenate([own[i], moved_along[1 + i]]) for i in (0, 1))
    below, above = np.isfinite(low), np.isfinite(high)
    if there is None and not (below.any() or above.any()):
        return Cut(mode.z, mode.half, np.empty((0, k)), np.empty(0), np.zeros(k), mode.cost)
    space = target.subspace
    x = space.points(mode.z[None])[0]
    here = target.problem.linearize_at(x, target.fixed)
    J = here.jacobian @ space.along
    half = inverse_half(target, np.vstack([J, bound_rows(target, WIDE)]))
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
    return Cut(mean, half, np.vstack(rows), np.concatenate(margins), start, mode.cost,
               int(below.sum() + above.sum()))  # fmt: skip


def cut_away(target: Target, cut: Cut, rng: np.random.Generator) -> float:
    """The share of the Gaussian that constraints allow and their linearization does not.

    0 where constraints are linear. Importance weights cannot see it: no draw is there to weigh.
    1 where bounds alone leave too few allowed draws to tell.
    """
    there = target.problem.stacked_constraints
    if there is None or cut.boxed == len(cut.F):
        return 0.0
    free = replace(cut, F=cut.F[: cut.boxed], g=cut.g[: cut.boxed])
    drawn, along = drawn_from(free, TRIED, rng)[0], np.linalg.inv(cut.half).T
    x = target.subspace.points(drawn)
    linear = (drawn - cut.mean) @ along @ cut.F[cut.boxed :].T + cut.g[cut.boxed :]
    allowed, kept = target.allows(x), (linear >= -REACHED * abs(linear).max()).all(axis=1)
    if not (allowed & ~kept).any() and not (kept & ~allowed).any():
        return 0.0
    if allowed.sum() < ENOUGH:
        return 1.0
    return float(np.mean(~kept[allowed]))


def drawn_from(cut: Cut, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Draws z (count, k), and their log density up to a constant, (count,)."""
    w = rng.standard_normal((count, len(cut.mean)))
    if not (w @ cut.F.T + cut.g >= 0).all():
        w = truncated(cut.F, cut.g, cut.start, count, rng)
    log_q = -cut.cost - 0.5 * (np.sum(w**2, axis=1) - np.sum(cut.start**2))
    return cut.mean + w @ cut.half.T, log_q
