"""Hands from 16 joints and from 21 points: errors, seconds, and what the points leave open."""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.hands.strangers import Stranger, noisy
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import HAND_POINTS, SkinnedBody
from workbench.fitting import hand_problem, hand_start, pose_prior, shape_prior
from workbench.priors.joint_limits import hand_limits
from workbench.problem import Problem
from workbench.residuals import Residual, gaussian
from workbench.solvers import TrustRegion

NOISE = 0.002  # m along each axis
FAR = 6.0  # mm
MM = 1e3
TIPS = np.array([name.endswith("_tip") for name in HAND_POINTS])


def wide_prior(body: SkinnedBody) -> Residual:
    """What a body without a pose space gets: 0.5 rad about its rest pose."""
    pose = body.blocks()[0].symbol
    return gaussian(pose[:, 1:], covariance=0.25, unit="rad", name="pose prior")


def fits(
    body: SkinnedBody,
    hands: Sequence[Stranger],
    *,
    tips: bool = True,
    limited: bool = True,
    wide: bool = False,
    seed: int = 0,
) -> dict[str, Any]:
    """The errors of fits to noisy points of all hands, and their CPU seconds."""
    priors = [wide_prior(body) if wide else pose_prior(body), shape_prior(body)]
    if limited:
        priors.append(hand_limits().residual(body))
    problem, solver = hand_problem(body, sigma=NOISE, priors=priors), TrustRegion()
    off, seconds, beyond, converged = [], [], [], 0
    for i, hand in enumerate(hands):
        seen = noisy(hand.points, NOISE, (seed, i))
        begin = time.process_time()
        if not tips:
            seen[TIPS] = np.nan
        solution = solver.solve(problem, hand_start(body, seen))
        seconds.append(time.process_time() - begin)
        at = [solution.values[block.name] for block in body.blocks()]
        off.append(MM * np.linalg.norm(body.vertices(*at) - hand.vertices, axis=1))
        beyond.append(np.degrees(np.abs(hand_limits().beyond(body, at[0]))).max())
        converged += solution.converged
    return summary(body, np.array(off)) | {
        "hands": len(hands),
        "converged": converged,
        "beyond_limits_degrees": float(np.max(beyond)),
        "seconds": float(np.median(seconds)),
        "slowest": float(np.max(seconds)),
    }


def summary(body: SkinnedBody, off: Array) -> dict[str, float]:
    """Errors (hands, vertices) in mm by hand and by vertex, also without those behind the wrist."""
    stump = behind_the_wrist(body)
    medians, means, largest = np.median(off, axis=1), off.mean(axis=1), off.max(axis=1)
    return {
        "median": float(np.median(medians)),
        "worst_median": float(medians.max()),
        "worst_mean": float(means.max()),
        "largest": float(off.max()),
        "largest_before_the_wrist": float(off[:, ~stump].max()),
        "share_beyond_6_mm": float((off > FAR).mean()),
        "of_them_behind_the_wrist": float((off > FAR)[:, stump].sum() / max(1, (off > FAR).sum())),
        "hands_within_6_mm": float((largest <= FAR).mean()),
    }


def behind_the_wrist(body: SkinnedBody) -> Array:
    """Which vertices (N,) are behind the wrist joint, or less than 2 cm in front of it."""
    along = body.joints()[body.joint_names.index("middle1")] - body.joints()[0]
    ahead = (body.template - body.joints()[0]) @ along / np.linalg.norm(along)
    return np.asarray(ahead < 0.02)


def predicted(body: SkinnedBody, hands: Sequence[Stranger], seed: int = 0) -> dict[str, Any]:
    """What errors 21 points leave, by Laplace's approximation, in mm (root mean square): behind
    the wrist and elsewhere; with everything free, with the shape known, and with the pose known.
    """
    problem, stump = hand_problem(body, sigma=NOISE), behind_the_wrist(body)
    names = [block.name for block in problem.free.blocks]
    found: dict[str, list[Array]] = {"all": [], "shape known": [], "pose known": []}
    for i, hand in enumerate(hands):
        start = hand_start(body, noisy(hand.points, NOISE, (seed, i)))
        values = start | TrustRegion().solve(problem, start).values
        for what, known in (("all", ()), ("shape known", (1,)), ("pose known", (0,))):
            kept = [n for n in names if n not in {body.blocks()[k].name for k in known}]
            found[what].append(_spread(body, problem, values, kept))
    return {
        what: [float(np.sqrt(np.mean(np.array(sd)[:, side] ** 2))) for side in (stump, ~stump)]
        for what, sd in found.items()
    }


def _spread(body: SkinnedBody, problem: Problem, values: Values, kept: list[str]) -> Array:
    """The standard deviation (N,) mm of each vertex if the other blocks are known."""
    part = problem.freeing(*kept)
    here = part.linearize({name: values[name] for name in part.known})
    normal = np.asarray(here.normal)
    into = {name: np.zeros((part.free[name].size, 3 * body.n_vertices)) for name in kept}
    numeric = body.points(*(block.symbol for block in body.blocks())).source.numeric
    assert numeric is not None  # of every body
    numeric.evaluate(values).write_jacobian(into, None)
    V = np.concatenate([into[block.name] for block in part.free.blocks])
    squares = np.sum(V * np.linalg.solve(normal, V), axis=0)
    return np.asarray(MM * np.sqrt(squares.reshape(-1, 3).sum(axis=1)))
