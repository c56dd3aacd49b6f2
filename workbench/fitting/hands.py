"""Fitting a hand to the positions of its joints and finger tips in space.

The energy is E_J + E_theta + E_beta + E_L: squared distances of 16 or 21 points, the prior on the
pose, the prior on the shape, and what is beyond the limits of joints. The palm places the hand
closely enough that one stage suffices.
"""

from collections.abc import Sequence
from dataclasses import replace

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Mask
from workbench.blocks import Block, Values
from workbench.blocks.checks import reals
from workbench.bodies import HAND_POINTS, SkinnedBody, hand_points
from workbench.bodies.body import Body
from workbench.bodies.hands import FINGERS, TIPS, is_hand
from workbench.errors import BadBody
from workbench.fitting.body_priors import pose_gaussian, usual_priors
from workbench.fitting.observations import BadObservation
from workbench.fitting.placing import moved
from workbench.geometry.rigid import procrustes
from workbench.problem import Problem
from workbench.residuals import Residual, landmarks
from workbench.residuals.kernels import Kernel, quadratic

SIGMA = 0.002  # m along each axis, of an observed point
FEWEST_POINTS = 3  # points that place a hand
PALM = ("wrist", *(f"{finger}1" for finger in FINGERS))  # which hardly move against each other
OBSERVED, SEEN = "observed", "seen"


def hand_landmarks(
    body: SkinnedBody, observed: ArrayLike, *, sigma: float = SIGMA, kernel: Kernel = quadratic
) -> Residual:
    """The residual of 16 or 21 points of a hand in m, `sigma` along each axis.

    `observed` is as for `hand_start`. Joints and finger tips, which are vertices, are rows of this
    one residual; points that were not seen have the weight 0. It is a term beside others, such as
    that of a scan. Raises BadBody and BadObservation.
    """
    checked_hand(body)
    places, known = _seen(body, observed)
    return _landmarks(body, places, known, sigma, kernel)


def hand_problem(
    body: SkinnedBody,
    *,
    sigma: float = SIGMA,
    kernel: Kernel = quadratic,
    priors: Sequence[Residual] | None = None,
) -> Problem:
    """Pose, betas and trans of a hand from its points; one problem serves for many hands.

    What was observed is in two fixed blocks: `observed` (21, 3) m in the order of `HAND_POINTS`,
    and `seen` (21,), the weight of each point, 0 where it was not observed. So one problem serves
    for 16 points and for 21. `sigma` is in m along each axis. The priors are those of
    `usual_priors` unless others are given. Raises BadBody for a body that is no hand.
    """
    checked_hand(body)
    places = Block(OBSERVED, (len(HAND_POINTS), 3), "m", HAND_POINTS)
    seen = Block(SEEN, (len(HAND_POINTS),), "1", HAND_POINTS)
    data = _landmarks(body, places.symbol, seen.symbol, sigma, kernel)
    priors = usual_priors(body) if priors is None else priors
    return Problem((data, *priors), [block.name for block in body.blocks()], blocks=(places, seen))


def hand_start(body: SkinnedBody, observed: ArrayLike) -> Values:
    """Where a fit to 16 or 21 points begins: the mean pose, placed by the points of the palm.

    `observed` are (16, 3) m in the order of the body's joints or (21, 3) m in that of
    `HAND_POINTS`, NaN where a point was not seen. The values hold the observation too. Raises
    BadObservation for another shape, or fewer than three points.
    """
    checked_hand(body)
    places, seen = _seen(body, observed)
    known: Mask = np.asarray(seen > 0)
    if known.sum() < FEWEST_POINTS:
        raise BadObservation(
            f"{int(known.sum())} points of a hand are known, and at least {FEWEST_POINTS} place it"
        )
    mean = mean_hand(body)
    own = points_of(body, mean)
    palm = known & np.isin(HAND_POINTS, PALM)
    used = palm if palm.sum() > FEWEST_POINTS else known
    motion = procrustes(own[used], places[used])
    pose, betas, _ = (mean[block.name] for block in body.blocks())
    return mean | moved(body, motion.R, motion.t, pose, betas) | {OBSERVED: places, SEEN: seen}


def mean_hand(body: Body) -> Values:
    """The mean pose of the prior, the mean shape, at the origin, the wrist not turned."""
    pose = np.concatenate([np.zeros((1, 3)), pose_gaussian(body)[0].reshape(-1, 3)])
    return body.start() | {body.blocks()[0].name: pose}


def checked_hand(body: Body) -> SkinnedBody:
    """The body itself. Raises BadBody for one that is no hand."""
    if not isinstance(body, SkinnedBody) or not is_hand(body):
        raise BadBody(
            f"body {body.name!r} is no hand, whose joints are wrist and index1 to thumb3; take the "
            "embedded body 'hand' or 'hand-left', or one of MANO's"
        )
    return body


def points_of(body: Body, values: Values) -> Array:
    """The points `HAND_POINTS` (..., 21, 3) m of a hand in numbers."""
    numbers = [values[block.name] for block in body.blocks()]
    every = np.concatenate([body.joints(*numbers), body.landmark(TIPS, *numbers)], axis=-2)
    names = [*body.joint_names, *body.landmark_names(TIPS)]
    return np.asarray(every[..., [names.index(name) for name in HAND_POINTS], :])


def _landmarks(
    body: SkinnedBody, observed: cs.MX | Array, seen: cs.MX | Array, sigma: float, kernel: Kernel
) -> Residual:
    points = hand_points(body, *(block.symbol for block in body.blocks()))
    data = landmarks(points, observed, sigma=sigma, kernel=kernel, name="hand points")
    return replace(data, weights=seen)


def _seen(body: SkinnedBody, observed: ArrayLike) -> tuple[Array, Array]:
    """The points (21, 3) m in the order of `HAND_POINTS`, and the weight (21,) of each: 0 or 1."""
    points = reals("points of a hand", observed)
    places = np.full((len(HAND_POINTS), 3), np.nan)
    if points.shape == places.shape:
        places = points
    elif points.shape == (body.n_joints, 3):
        places[[HAND_POINTS.index(name) for name in body.joint_names]] = points
    else:
        raise BadObservation(
            f"points of a hand have the shape (21, 3) in the order of HAND_POINTS, or "
            f"({body.n_joints}, 3) in that of the body's joints, not {points.shape}"
        )
    known = np.isfinite(places).all(axis=1)
    return np.where(known[:, None], places, 0.0), known.astype(np.float64)
