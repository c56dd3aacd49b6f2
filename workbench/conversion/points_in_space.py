"""A motion from named points in space, such as triangulated keypoints or joints of a skeleton."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Points, Values
from workbench.blocks.checks import reals
from workbench.bodies.body import Body
from workbench.bodies.hands import HAND_POINTS, TIPS, hand_points
from workbench.errors import BadArgument, UnknownName, some_of
from workbench.fitting.body_priors import pose_prior
from workbench.fitting.placing import moved
from workbench.fitting.tracking import QUICK, PointTracker, Progress, quiet, solved
from workbench.fitting.videos import PLACE_SIGMA, POSE_SIGMA
from workbench.geometry.rigid import procrustes
from workbench.motions import Motion
from workbench.motions.motion import without_gaps
from workbench.problem import sequence
from workbench.residuals import smooth

SIGMA = 0.01  # m, of a point beside that of the body
WIDE = (0.2, 0.05)  # m, sigmas of a frame by itself in turn: no arm is twisted
FREELY = 1e3  # rad, of the root's turns: they are not smoothed
LEAST = 4  # points that place a body
JOINTS, HAND = "joints", "hand"
Placed = Callable[[cs.MX, cs.MX, cs.MX], Points]


@dataclass(frozen=True, eq=False)
class PointFit:
    """The motion of a body whose points are closest to observed ones.

    Attributes:
        motion: the motion.
        names: (L,) the body's points that were observed.
        errors: (T, L) m from each to where it was observed; NaN where it was not seen.
    """

    motion: Motion
    names: tuple[str, ...]
    errors: Array


def point_sets(body: Body) -> dict[str, tuple[str, ...]]:
    """The sets of points of a body that can be observed, with their names.

    They are its joints, its landmark sets, and the 21 points of a `hand` if it is one.
    """
    found = {JOINTS: tuple(body.joint_names)}
    found |= {name: of.names for name, of in body.landmarks.items()}
    tips = body.landmarks[TIPS].names if TIPS in body.landmarks else ()
    if {*HAND_POINTS} <= {*body.joint_names, *tips}:
        found[HAND] = HAND_POINTS
    return found


def plain_name(label: str) -> str:
    """A label as bodies spell it: `RBigToe` and `right big toe` are `right_big_toe`."""
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[RL])(?=[A-Z][a-z])", "_", label.strip())
    plain = re.sub(r"[^a-z0-9]+", "_", words.lower()).strip("_")
    for short, side in (("r_", "right_"), ("l_", "left_")):
        plain = side + plain[2:] if plain.startswith(short) else plain
    return plain


def motion_from_points(
    observed: ArrayLike,
    names: Sequence[str],
    body: Body,
    fps: float,
    *,
    kind: str | None = None,
    sigma: float = SIGMA,
    progress: Progress = quiet,
) -> PointFit:
    """The motion of a body from points (T, M, 3) m with names (M,), NaN where one was not seen.

    `kind` is the set of the body's points that they are (`point_sets`): a joint and a keypoint of
    one name are different places. None takes the set that has most of the names. `sigma` is in m.
    One shape is found for all frames, and what the points leave open follows the priors on pose and
    shape. All frames are found together in the end, with joints at nearly constant speed, so that
    points that some frames do not show are where the motion leads. Frames that show fewer than four
    points follow from the others, or are left out at the beginning and the end. Points that the
    body does not have are left out. The motion's `notes` say both. Raises BadArgument for other
    arrays and if no frame shows four points, UnknownName for a set, and NotNumbers.
    """
    given = reals("the observed points", observed)
    labels = [plain_name(name) for name in names]
    if given.ndim != 3 or given.shape[1:] != (len(labels), 3):
        raise BadArgument(
            f"points with {len(labels)} names have the shape (T, {len(labels)}, 3), not "
            f"{given.shape}"
        )
    if not 0 < sigma < np.inf:
        raise BadArgument(f"sigma is a standard deviation in m, above 0, not {sigma:g}")
    kind, own, notes = _matched(labels, names, body, kind)
    places = np.full((len(given), len(own), 3), np.nan)
    for i, name in enumerate(own):
        if name in labels:
            places[:, i] = given[:, labels.index(name)]
    seen: Mask = np.asarray(np.isfinite(places).all(axis=2))
    usable = np.flatnonzero(seen.sum(axis=1) >= LEAST)
    if not len(usable):
        raise BadArgument(f"no frame shows {LEAST} of the points {some_of(own)}")
    pose, betas, trans = (block.symbol for block in body.blocks())
    tracker = PointTracker(
        body,
        _points(body, kind)(pose, betas, trans),
        places[usable],
        np.ones(len(own)),
        sigma,
        pose_prior(body),
        lambda t, before: [
            placed_by_points(body, kind, places[usable[t]]) if before is None else before
        ],
        WIDE,
    )
    shape = tracker.shape(np.zeros(body.n_betas), progress)
    found = tracker.poses(shape, progress)
    turned, where = _spread(found, usable, len(given), body)
    turned, lines, filled = without_gaps(turned, {"trans": where})
    whole = slice(int(usable[0]), int(usable[-1]) + 1)
    turned, shape, where = _smoothed(
        replace(tracker, observed=places[whole]), turned, shape, lines["trans"], fps, progress
    )
    motion = Motion(
        turned, where, fps, tuple(body.joint_names), shape, origin="points", notes=(*notes, *filled)
    )
    at = body_points(body, kind, turned, shape, where)
    errors = np.full(places.shape[:2], np.nan)
    errors[whole] = np.linalg.norm(at - places[whole], axis=2)
    some: Mask = np.asarray(seen.any(axis=0))
    return PointFit(motion, tuple(n for n, s in zip(own, some, strict=True) if s), errors[:, some])


def _smoothed(
    tracker: PointTracker,
    pose: Array,
    betas: Array,
    trans: Array,
    fps: float,
    progress: Progress,
) -> tuple[Array, Array, Array]:
    """Pose, betas and trans of all frames together, from where they were found one by one.

    Joints and root move at nearly constant speed, which places what some frames do not show; the
    root turns freely, because a person who turns round passes half a turn.
    """
    T, names = len(pose), [block.name for block in tracker.body.blocks()]
    if T < 3:
        return pose, betas, trans
    sigma = np.full((tracker.body.n_joints, 3), POSE_SIGMA / fps**2)
    sigma[0] = FREELY
    between = [
        smooth(names[0], sigma=sigma, order=2),
        smooth(names[2], sigma=PLACE_SIGMA / fps**2, order=2),
    ]
    together = sequence([tracker.frame] * T, shared=(names[1],), between=between)
    data = [tracker.data(t) for t in range(T)]
    start = {n: np.array([d[n] for d in data]) for n in data[0]}
    progress("all frames together", 0, 1)
    found = solved(
        QUICK, together, {**start, **dict(zip(names, (pose, betas, trans), strict=True))}
    )
    progress("all frames together", 1, 1)
    found_pose, found_betas, found_trans = (found.values[name] for name in names)
    return found_pose, found_betas, found_trans


def body_points(body: Body, kind: str, pose: Array, betas: Array, trans: Array) -> Array:
    """The points (T, L, 3) m of a set of the body in numbers."""
    if kind != HAND:
        return body.landmark(kind, pose, betas, trans)
    joints, tips = (body.landmark(name, pose, betas, trans) for name in (JOINTS, TIPS))
    labels = (*body.joint_names, *body.landmarks[TIPS].names)
    both = np.concatenate([joints, tips], axis=1)
    return np.asarray(both[:, [labels.index(name) for name in HAND_POINTS]])


def _points(body: Body, kind: str) -> Placed:
    if kind == HAND:
        return lambda pose, betas, trans: hand_points(body, pose, betas, trans)
    if kind == JOINTS:
        return body.joint_points
    return lambda pose, betas, trans: body.landmark_points(kind, pose, betas, trans)


def _matched(
    labels: list[str], given: Sequence[str], body: Body, kind: str | None
) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """The set of the body's points, their names, and what is to be said about them."""
    sets = point_sets(body)
    if len({*labels}) < len(labels):
        twice = [n for n in dict.fromkeys(labels) if labels.count(n) > 1]
        raise BadArgument(f"two points are called {some_of(twice)}; each needs its own name")
    if kind is None:
        kind = max(sets, key=lambda name: len({*sets[name]} & {*labels}))
    if kind not in sets:
        raise UnknownName("set of points", kind, sets)
    own = sets[kind]
    known = [name for name in own if name in labels]
    if len(known) < LEAST:
        raise BadArgument(
            f"of the points {some_of(given)}, body {body.name!r} has {len(known)} among its "
            f"{kind!r}, and {LEAST} are needed to place it; they are called {some_of(own)}"
        )
    notes = [f"{len(known)} of {len(labels)} points are {kind} of body {body.name!r}"]
    if lost := [name for name, label in zip(given, labels, strict=True) if label not in own]:
        notes.append(f"points that are not among them are left out: {some_of(lost)}")
    return kind, own, tuple(notes)


def placed_by_points(body: Body, kind: str, places: Array) -> Values:
    """The body at rest where a rigid motion brings its points nearest to the observed ones."""
    rest = body_points(body, kind, body.bind_pose[None], np.zeros(body.n_betas), np.zeros((1, 3)))
    seen = np.isfinite(places).all(axis=1)
    motion = procrustes(rest[0, seen], places[seen])
    return moved(body, motion.R, motion.t)


def _spread(found: Values, usable: Index, count: int, body: Body) -> tuple[Array, Array]:
    """Pose and trans of all frames, NaN where there are none."""
    pose, _, trans = (block.name for block in body.blocks())
    moved = np.full((count, body.n_joints, 3), np.nan)
    where = np.full((count, 3), np.nan)
    moved[usable], where[usable] = found[pose], found[trans]
    return moved, where
