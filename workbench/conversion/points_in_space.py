"""A motion from named points in space, such as triangulated keypoints or joints of a skeleton."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Points, Values
from workbench.blocks.checks import reals
from workbench.bodies.body import Body
from workbench.bodies.hands import HAND_POINTS, TIPS, hand_points
from workbench.errors import BadArgument, UnknownName, some_of
from workbench.fitting.body_priors import pose_prior
from workbench.fitting.hands import points_of
from workbench.fitting.placing import moved
from workbench.fitting.tracking import QUICK_SOLVER, PointTracker, Progress, quiet, solved
from workbench.fitting.videos import PLACE_SIGMA, POSE_SIGMA
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.motions import Motion
from workbench.motions.motion import without_gaps
from workbench.motions.skeleton_names import is_elsewhere, reading, readings, skeletons, words_of
from workbench.problem import sequence
from workbench.residuals import smooth

SIGMA = 0.01  # m, of a point beside that of the body
LOOSE_SIGMA = 0.025  # m, of joints that each kind of skeleton has in other places
WIDE_SIGMAS = (0.2, 0.05)  # m, sigmas of a frame by itself in turn: no arm is twisted
FREE_TURN_SIGMA = 1e3  # rad, of the root's turns: they are not smoothed
FEWEST_POINTS = 4  # points that place a body
FEWEST_JOINTS = 8  # joints of a skeleton, with which a body is no statue
JOINTS, HAND = "joints", "hand"


@dataclass(frozen=True, eq=False)
class PointFit:
    """The motion of a body whose points are closest to observed ones.

    Attributes:
        motion: the motion.
        names: (L,) the body's points that were observed.
        errors: (T, L) m from each to where it was observed; NaN where it was not seen.
        labels: (L,) what they were called.
    """

    motion: Motion
    names: tuple[str, ...]
    errors: Array
    labels: tuple[str, ...]


def point_sets(body: Body) -> dict[str, tuple[str, ...]]:
    """The sets of points of a body that can be observed, with their names.

    They are its joints, its landmark sets, and the 21 points of a `hand` if it is one.
    """
    sets = {JOINTS: tuple(body.joint_names)}
    sets |= {name: of.names for name, of in body.landmarks.items()}
    tips = body.landmarks[TIPS].names if TIPS in body.landmarks else ()
    if {*HAND_POINTS} <= {*body.joint_names, *tips}:
        sets[HAND] = HAND_POINTS
    return sets


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
    one name are different places. None takes the set that has most of the names, or the kind of
    skeleton (`skeleton_names.skeletons`) whose names for joints of SMPL they are; those of trunk
    and feet then count less, sigma 2.5 cm, for there skeletons differ. `sigma` is in m.
    One shape is found for all frames, and what the points leave open follows the priors on pose and
    shape. All frames are found together in the end, with joints at nearly constant speed, so that
    points that some frames do not show are where the motion leads. Frames that show fewer than four
    points follow from the others, or are left out at the beginning and the end. Points that the
    body does not have are left out. The motion's `notes` say both. Raises BadArgument for other
    arrays and if no frame shows four points, UnknownName for a set, and NotNumbers.
    """
    return _from_places(observed, names, body, fps, kind, sigma, progress, together=True)


def _from_places(
    observed: ArrayLike,
    names: Sequence[str],
    body: Body,
    fps: float,
    kind: str | None,
    sigma: float,
    progress: Progress,
    together: bool,
) -> PointFit:
    """`motion_from_points`, whose frames are smoothed together or stay as they were found."""
    points = reals("the observed points", observed)
    labels = tuple(map(str, names))
    if points.ndim != 3 or points.shape[1:] != (len(labels), 3):
        raise BadArgument(
            f"points with {len(labels)} names have the shape (T, {len(labels)}, 3), not "
            f"{points.shape}"
        )
    if not 0 < sigma < np.inf:
        raise BadArgument(f"sigma is a standard deviation in m, above 0, not {sigma:g}")
    kind, columns, loose, notes = _matched(labels, body, kind)
    own = point_sets(body)[kind]
    places = np.full((len(points), len(own), 3), np.nan)
    for i, name in enumerate(own):
        if name in columns:
            places[:, i] = points[:, columns[name]]
    seen: Mask = np.asarray(np.isfinite(places).all(axis=2))
    usable = np.flatnonzero(seen.sum(axis=1) >= FEWEST_POINTS)
    if not len(usable):
        raise BadArgument(f"no frame shows {FEWEST_POINTS} of the points {some_of(own)}")
    counts = [(sigma / LOOSE_SIGMA) ** 2 if loose and is_elsewhere(name) else 1.0 for name in own]
    tracker = PointTracker(
        body,
        _symbolic_points(body, kind),
        places[usable],
        np.minimum(counts, 1.0),
        sigma,
        pose_prior(body),
        lambda t, before: [
            placed_by_points(body, kind, places[usable[t]]) if before is None else before
        ],
        WIDE_SIGMAS,
    )
    shape = tracker.shape(np.zeros(body.n_betas), progress)
    pose, trans = _spread(tracker.poses(shape, progress), usable, len(points), body)
    pose, lines, filled = without_gaps(pose, {"trans": trans})
    whole = slice(int(usable[0]), int(usable[-1]) + 1)
    trans = lines["trans"]
    if together and len(pose) > 2:
        tracker = replace(tracker, observed=places[whole])
        pose, shape, trans = _smoothed(tracker, pose, shape, trans, fps, progress)
    motion = Motion(
        pose, trans, fps, tuple(body.joint_names), shape, origin="points", notes=(*notes, *filled)
    )
    own_points = body_points(body, kind, pose, shape, trans)
    errors = np.full(places.shape[:2], np.nan)
    errors[whole] = np.linalg.norm(own_points - places[whole], axis=2)
    shown = [i for i in range(len(own)) if seen[:, i].any()]
    observed_labels = tuple(labels[columns[own[i]]] for i in shown)
    return PointFit(motion, tuple(own[i] for i in shown), errors[:, shown], observed_labels)


def motion_from_skeleton(
    skeleton: Motion,
    body: Body,
    *,
    names: Sequence[str] | None = None,
    sigma: float = SIGMA,
    progress: Progress = quiet,
) -> PointFit:
    """The motion of a body whose joints are closest to those of a skeleton with bones of its own.

    Only places count, because the rest pose and the axes of joints differ from one kind of skeleton
    to the next (`motion_from_points`); each frame stays as it was found, for bones have no noise.
    `names` (K,) take the place of the skeleton's names. Places
    do not show how the last joints of limbs and the head turn: these turn as the skeleton's do,
    R_body(t) = R_skeleton(t) Q, with Q the mean of R_skeleton' R_body over the frames. Raises
    BadArgument for a motion without bones, or if fewer than eight joints are known.
    """
    labels = skeleton.joint_names if names is None else names
    fit = _from_places(
        skeleton.joints(), labels, body, skeleton.fps, None, sigma, progress, together=False
    )
    if len(fit.names) < FEWEST_JOINTS:
        raise BadArgument(
            f"of the {len(labels)} joints only {some_of(fit.names)} are known, and with fewer than "
            f"{FEWEST_JOINTS} the body would be a statue; a table of names says which are which "
            "(--names)"
        )
    assert skeleton.bones is not None  # for it has joints
    theirs = _worlds(skeleton.pose, skeleton.bones.parents)
    pose, parents, turned = fit.motion.pose.copy(), tuple(body.parents), []
    ours = _worlds(pose, parents)
    above = {name: set(_above(body, name)) for name in fit.names if name in body.joint_names}
    for name, label in zip(fit.names, fit.labels, strict=True):
        if name not in above or any(name in others for others in above.values()):
            continue
        k, j = body.joint_names.index(name), [*labels].index(label)
        Q = Rotation.from_matrix(theirs[:, j].swapaxes(1, 2) @ ours[:, k]).mean().as_matrix()
        pose[:, k] = vector_from_matrix(ours[:, parents[k]].swapaxes(1, 2) @ theirs[:, j] @ Q)
        turned.append(name)
    note = f"turned as in the skeleton, where places do not tell: {some_of(turned)}"
    motion = replace(fit.motion, pose=pose, notes=(*fit.motion.notes, *([note] if turned else ())))
    return replace(fit, motion=motion)


def _above(body: Body, joint: str) -> list[str]:
    """The joints between the root and one."""
    k, above = body.parents[body.joint_names.index(joint)], []
    while k >= 0:
        above.append(body.joint_names[k])
        k = body.parents[k]
    return above


def _worlds(pose: Array, parents: Sequence[int]) -> Array:
    """The rotations (T, K, 3, 3) of joints in the world, from poses (T, K, 3) rad."""
    world = matrix_from_vector(pose)
    for k, parent in enumerate(parents):
        if parent >= 0:
            world[:, k] = world[:, parent] @ world[:, k]
    return world


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
    sigma = np.full((tracker.body.n_joints, 3), POSE_SIGMA / fps**2)
    sigma[0] = FREE_TURN_SIGMA
    between = [
        smooth(names[0], sigma=sigma, order=2),
        smooth(names[2], sigma=PLACE_SIGMA / fps**2, order=2),
    ]
    together = sequence([tracker.frame] * T, shared=(names[1],), between=between)
    data = [tracker.data(t) for t in range(T)]
    start = {name: np.array([frame_data[name] for frame_data in data]) for name in data[0]}
    progress("all frames together", 0, 1)
    solution = solved(
        QUICK_SOLVER, together, {**start, **dict(zip(names, (pose, betas, trans), strict=True))}
    )
    progress("all frames together", 1, 1)
    found_pose, found_betas, found_trans = (solution.values[name] for name in names)
    return found_pose, found_betas, found_trans


def body_points(body: Body, kind: str, pose: Array, betas: Array, trans: Array) -> Array:
    """The points (T, L, 3) m of a set of the body in numbers."""
    if kind != HAND:
        return body.landmark(kind, pose, betas, trans)
    names = (block.name for block in body.blocks())
    return points_of(body, dict(zip(names, (pose, betas, trans), strict=True)))


def _symbolic_points(body: Body, kind: str) -> Points:
    """The same points in symbols of the body's blocks."""
    symbols = [block.symbol for block in body.blocks()]
    if kind == HAND:
        return hand_points(body, *symbols)
    if kind == JOINTS:
        return body.joint_points(*symbols)
    return body.landmark_points(kind, *symbols)


def _matched(
    labels: Sequence[str], body: Body, kind: str | None
) -> tuple[str, dict[str, int], bool, tuple[str, ...]]:
    """The set of the body's points, which label each of them is, whether by a kind of skeleton
    whose joints are elsewhere, and what is to be said.
    """
    sets, by_reading = point_sets(body), readings(labels)
    if kind is not None and kind not in sets:
        raise UnknownName("set of points", kind, sets)
    by_set = {}
    for name in sets if kind is None else (kind,):
        spelt = {point: reading(words_of(point))[0] for point in sets[name]}
        by_set[name] = {
            point: by_reading[read][0] for point, read in spelt.items() if read in by_reading
        }
    best = max(by_set, key=lambda name: len(by_set[name]))
    columns, loose, what = by_set[best], False, f"{best} of body {body.name!r}"
    for skeleton in skeletons() if kind is None and JOINTS in sets else ():
        joints = {j: k for j, k in skeleton.matched(by_reading).items() if j in sets[JOINTS]}
        if len(joints) >= FEWEST_JOINTS and len(joints) > len(columns):
            best, columns, loose = JOINTS, joints, True
            what = f"joints of body {body.name!r} by the names of {skeleton.name}"
            if skeleton.signs:
                break
    twice = [ks for ks in by_reading.values() if len(ks) > 1 and {*ks} & {*columns.values()}]
    if twice:
        name = " and ".join(labels[k] for k in twice[0])
        raise BadArgument(f"two points are called {name}; each needs its own name")
    if len(columns) < FEWEST_POINTS:
        raise BadArgument(
            f"of the points {some_of(labels)}, body {body.name!r} has {len(columns)} among its "
            f"{best!r}, and {FEWEST_POINTS} are needed to place it; they are called "
            f"{some_of(sets[best])}; a table of names says which are which (--names)"
        )
    notes = [f"{len(columns)} of {len(labels)} points are {what}"]
    if unused := [label for k, label in enumerate(labels) if label and k not in columns.values()]:
        notes.append(f"points that are not among them are left out: {some_of(unused)}")
    return best, columns, loose, tuple(notes)


def placed_by_points(body: Body, kind: str, places: Array) -> Values:
    """The body at rest where a rigid motion brings its points nearest to the observed ones."""
    rest = body_points(body, kind, body.bind_pose[None], np.zeros(body.n_betas), np.zeros((1, 3)))
    seen = np.isfinite(places).all(axis=1)
    motion = procrustes(rest[0, seen], places[seen])
    return moved(body, motion.R, motion.t)


def _spread(values: Values, usable: Index, count: int, body: Body) -> tuple[Array, Array]:
    """Pose and trans of all frames, NaN where there are none."""
    pose, _, trans = (block.name for block in body.blocks())
    all_pose = np.full((count, body.n_joints, 3), np.nan)
    all_trans = np.full((count, 3), np.nan)
    all_pose[usable], all_trans[usable] = values[pose], values[trans]
    return all_pose, all_trans
