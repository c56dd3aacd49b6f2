"""Where a body is put before a fit: moved rigidly to points or meshes, by rays, by a regressor."""

from collections.abc import Sequence

import numpy as np

from workbench.arrays import Array, Mask
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.errors import BadArgument
from workbench.fitting.observations import BadObservation
from workbench.fitting.pose_regressor import FEWEST_KEYPOINTS, PoseRegressor, shipped_regressor
from workbench.fitting.setup import View
from workbench.geometry.camera import triangulate
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix

TORSO = ("left_shoulder", "right_shoulder", "left_hip", "right_hip")
FAR_FROM_KEYPOINT = 0.25  # m, at the depth of the body: farther away, a keypoint disagrees
SUBSETS, LEFT_OUT_SHARE = 64, 0.35  # of the keypoints; the share that each leaves out
REGRESSION_ROUNDS = 2  # of regressing without the keypoints that disagree
REWEIGHTINGS = 6  # times, when a body is placed
NEAREST_DEPTH = 0.1  # m, the depth of a body in front of the camera
MOST_STARTS = 8  # directions in which a body may face
TURNS = (0, 4, 2, 6, 1, 3, 5, 7)  # eighths of a turn: the other way, and then far from both first


def place_body(body: Body, views: Sequence[View], values: Values) -> Values:
    """The root's rotation and the translation, by triangulation or from a single image.

    Raises BadObservation if fewer than three keypoints are known, or there is no image.
    """
    if len(views) >= 2:
        return _from_several(body, views, values)
    if not views:
        raise BadObservation("there is no image to fit; hold out fewer")
    return _from_one(body, views[0], values)


def _rest(body: Body, view: View, known: Mask, seen: str) -> tuple[Array, Mask]:
    """The landmarks (M, 3) m of the body at rest, and by which of those known (M,) it is placed:
    by those of the torso if they suffice. `seen` begins the error's sentence: `camera 1 shows`.
    """
    torso = known & np.isin(body.landmark_names(view.landmarks), TORSO)
    chosen = torso if torso.sum() >= 3 else known
    if chosen.sum() < 3:
        raise BadObservation(
            f"{seen} only {int(chosen.sum())} keypoints; 3 are needed to place the body"
        )
    return body.landmark(view.landmarks), chosen


def _from_several(body: Body, views: Sequence[View], values: Values) -> Values:
    """The rest body moved rigidly onto triangulated keypoints, of the torso if these suffice."""
    places = triangulate(
        [v.camera for v in views],
        values,
        [v.observed for v in views],
        [v.confidence for v in views],
    )
    known: Mask = np.asarray(np.isfinite(places).all(axis=1))
    rest, chosen = _rest(body, views[0], known, "two cameras or more show")
    motion = procrustes(rest[chosen], places[chosen])
    return moved(body, motion.R, motion.t)


def _from_one(body: Body, view: View, values: Values) -> Values:
    """The place of the rest body by similar triangles, as SMPLify begins (Bogo et al. 2016).

    The body is turned about its own axis and in the image plane, and scaled to the keypoints; the
    scale is the focal length over the depth. Of eight directions in which it may face, the one
    that fits best is taken.
    """
    rest, chosen = _rest(body, view, view.confidence > 0, f"{view.name} shows")
    f, c = values[view.camera.focal.name], values[view.camera.centre.name]
    x = (view.observed - c) / f  # (M, 2), where the rays meet the plane at depth 1
    w = view.confidence * chosen
    upright = np.diag([1.0, -1.0, -1.0])  # y up, facing the camera, whose y is down
    best = None
    for angle in np.arange(8) * np.pi / 4:
        turn = upright @ matrix_from_vector([0.0, angle, 0.0])
        flat = rest @ turn.T
        z, error = _similarity(flat[:, :2], x, w)
        if best is None or error < best[0]:
            best = error, z, turn
    assert best is not None
    _, (a, b, shift), turn = best
    scale = float(np.hypot(a, b))  # 1 / m
    in_plane = np.array([[a, -b, 0], [b, a, 0], [0, 0, scale]]) / scale
    depth = 1 / scale
    to_camera = in_plane @ turn
    t_camera = np.array([shift[0] * depth, shift[1] * depth, depth])
    R = matrix_from_vector(values[view.camera.rotation.name])  # world -> camera
    t = values[view.camera.translation.name]
    return moved(body, R.T @ to_camera, R.T @ (t_camera - t))


def _similarity(p: Array, q: Array, w: Array) -> tuple[tuple[float, float, Array], float]:
    """The similarity [a -b; b a] p + shift that takes p nearest to q, both (M, 2), and its error.

    `w` (M,) are the weights of the points; the error is the weighted mean of squares.
    """
    w = w / w.sum()
    p0, q0 = w @ p, w @ q
    dp, dq = p - p0, q - q0
    size = float(w @ (dp**2).sum(axis=1))
    a = float(w @ (dp * dq).sum(axis=1)) / size
    b = float(w @ (dp[:, 0] * dq[:, 1] - dp[:, 1] * dq[:, 0])) / size
    M = np.array([[a, -b], [b, a]])
    error = float(w @ ((dq - dp @ M.T) ** 2).sum(axis=1))
    return (a, b, q0 - M @ p0), error


def placed(body: Body, observed: Array) -> Values:
    """The root's rotation and the translation of the rest body moved rigidly onto a mesh."""
    motion = procrustes(body.vertices(), observed)
    return moved(body, motion.R, motion.t)


def moved(
    body: Body, R: Array, t: Array, pose: Array | None = None, betas: Array | None = None
) -> Values:
    """Pose and trans of a body that was moved as a whole by p -> R p + t; the root turns about its
    own joint. Before, it has `pose` (K, 3) rad, the bind pose if there is none, and trans zero.
    """
    turned = (body.bind_pose if pose is None else pose).copy()
    turned[0] = vector_from_matrix(R @ matrix_from_vector(turned[0]))
    root = body.joints(betas=betas)[0]
    names = [block.name for block in body.blocks()]
    return {names[0]: turned, names[2]: R @ root + t - root}


def regressed_start(regressor: PoseRegressor, body: Body, view: View, values: Values) -> Values:
    """Pose, betas (zero) and trans of a body that one camera observed.

    `values` hold the camera's numbers; the distortion of its lens is ignored. Raises
    BadObservation if the view shows fewer than three of the regressor's keypoints or they
    coincide, and BadArgument for a body that lacks one of them or has other joints.
    """
    rays, confidence, rows = seen_by(regressor, body, view, values)

    def regressed(confidence: Array) -> tuple[Array, Array, Array, Array]:
        """Bodies from keypoints trusted in several ways (N, M): the root's rotations (N, 3, 3) in
        the camera's frame, poses (N, K, 3) rad without it, where the root is (N, 3) m, and the
        distances (N, M) m of keypoints at the depth of the body.
        """
        several = np.broadcast_to(rays, (*confidence.shape, 2))
        facing, pose = regressor.regress(several, confidence)
        places = body.landmark(view.landmarks, pose)[:, rows] - body.joints(pose)[:, :1]
        points = np.einsum("nij,nmj->nmi", facing, places)
        return facing, pose, *placed_by_rays(points, rays, confidence)

    known = confidence > 0
    best = regressed(confidence[None])
    close = best[3][0] < FAR_FROM_KEYPOINT
    if not close[known].all():
        distances = regressed(confidence * _subsets(known))[3]
        losses = np.minimum(distances / FAR_FROM_KEYPOINT, 1.0) ** 2 @ known
        close = distances[losses.argmin()] < FAR_FROM_KEYPOINT
        for _ in range(REGRESSION_ROUNDS):
            agreed = confidence * close
            if (agreed > 0).sum() < FEWEST_KEYPOINTS:
                break
            best = regressed(agreed[None])
            close = best[3][0] < FAR_FROM_KEYPOINT
    facing, pose, root, _ = (array[0] for array in best)
    if not root[2] > NEAREST_DEPTH:
        raise BadObservation(
            f"{view.name}: the keypoints place the body behind the camera; check that they are "
            "px, and that the camera's focal length is right"
        )
    R = matrix_from_vector(values[view.camera.rotation.name])  # world -> camera
    turned = np.concatenate([vector_from_matrix(R.T @ facing)[None], pose[1:]])
    place = R.T @ (root - values[view.camera.translation.name]) - body.joints()[0]
    at = turned, np.zeros(body.n_betas), place
    return {block.name: value for block, value in zip(body.blocks(), at, strict=True)}


def placed_by_rays(points: Array, rays: Array, confidence: Array) -> tuple[Array, Array]:
    """The translations T (N, 3) m of points (N, M, 3) m onto rays (M, 2), and distances (N, M) m.

    A ray x meets the point p if x (p_z + T_z) = (p_x + T_x, p_y + T_y), which is linear in T. The
    distances from these equations are lengths at the depth of the points; they are weighted by the
    squares of the confidences (N, M), and again and again by 1 / (1 + (d / s)^2)^2 with
    s = FAR_FROM_KEYPOINT, so that few that are far off hardly count (Geman and McClure). Raises
    BadObservation if T is not determined or behind the camera.
    """
    M = points.shape[1]
    A = np.zeros((M, 2, 3))
    A[:, :, :2], A[:, :, 2] = np.eye(2), -rays
    b = rays * points[..., 2:] - points[..., :2]  # (N, M, 2)
    w = confidence**2
    for _ in range(REWEIGHTINGS):
        H = np.einsum("nm,mai,maj->nij", w, A, A)
        g = np.einsum("nm,mai,nma->ni", w, A, b)
        if not (np.linalg.cond(H) < 1e12).all():
            raise BadObservation(
                "the keypoints do not determine the place of the body: nearly all of them "
                "coincide; check their coordinates, which are px"
            )
        T = np.linalg.solve(H, g[..., None])[..., 0]
        d = np.linalg.norm(np.einsum("mai,ni->nma", A, T) - b, axis=2)
        w = confidence**2 / (1 + (d / FAR_FROM_KEYPOINT) ** 2) ** 2
    return T, d


def seen_by(
    regressor: PoseRegressor, body: Body, view: View, values: Values
) -> tuple[Array, Array, list[int]]:
    """Rays (M, 2) and confidences (M,) of the regressor's keypoints, and the landmarks' numbers."""
    names = body.landmark_names(view.landmarks)
    missing = [name for name in regressor.keypoint_names if name not in names]
    if missing or body.joint_names != regressor.joint_names:
        raise BadArgument(
            f"the body {body.name!r} is not of the kind that the regressor was trained for: it "
            + (f"lacks the landmarks {', '.join(missing)}" if missing else "has other joints")
            + "; give one with SMPL's 24 joints and COCO's keypoints"
        )
    rows = [names.index(name) for name in regressor.keypoint_names]
    confidence = np.clip(view.confidence[rows], 0.0, 1.0)
    if (confidence > 0).sum() < FEWEST_KEYPOINTS:
        raise BadObservation(
            f"{view.name} shows only {int((confidence > 0).sum())} keypoints of the regressor; "
            f"{FEWEST_KEYPOINTS} are needed to place the body"
        )
    f, c = values[view.camera.focal.name], values[view.camera.centre.name]
    rays = np.where(confidence[:, None] > 0, (view.observed[rows] - c) / f, 0.0)
    return rays, confidence, rows


def _subsets(known: Mask) -> Mask:
    """Which keypoints are kept, (SUBSETS, M), each time without a share of those known."""
    rng = np.random.default_rng(len(known))
    order = np.where(known, rng.random((SUBSETS, len(known))), 2.0).argsort(axis=1).argsort(axis=1)
    count = int(known.sum())
    kept = max(FEWEST_KEYPOINTS, count - round(LEFT_OUT_SHARE * count))
    return np.asarray((order < kept) & known)


def image_starts(body: Body, view: View, placed: Values, count: int) -> list[Values]:
    """`count` starts of a body in one image, the likeliest first.

    The first is what the regressor makes of the keypoints, the second the resting body where its
    torso was seen, which is in the values `placed`; the others are the first one turned about its
    own axis. A body that the regressor does not know begins at rest. Raises BadArgument for fewer
    than 1 or more than 8 starts.
    """
    at_rest = {block.name: placed[block.name] for block in body.blocks()}
    try:
        first = regressed_start(shipped_regressor(), body, view, placed)
    except (BadArgument, BadObservation):
        return turned_about(body, at_rest, count)
    turned = turned_about(body, first, count)
    return [turned[0], at_rest, *turned[1:]][:count]


def turned_about(body: Body, values: Values, count: int) -> list[Values]:
    """`count` starts: the given one first, then the same body turned about its own axis.

    The second faces the other way, for the keypoints of a person seen from the front and of one
    seen from the back differ least, and the others face between. The middle of the body's joints
    stays where it is. Raises BadArgument for fewer than 1 or more than 8 starts.
    """
    if not 1 <= count <= MOST_STARTS:
        raise BadArgument(f"a fit begins at 1 to {MOST_STARTS} starts, not at {count}")
    first = {block.name: values[block.name] for block in body.blocks()}
    pose, betas, trans = first.values()
    middle: Array = body.joints(pose, betas, trans).mean(axis=0)
    own = matrix_from_vector(pose[0]) @ matrix_from_vector(body.bind_pose[0]).T
    starts = [first]
    for k in TURNS[1:count]:
        turn = own @ matrix_from_vector([0.0, 2 * np.pi * k / MOST_STARTS, 0.0]) @ own.T
        away = middle - turn @ (middle - trans)
        starts.append(first | moved(body, turn, away, pose, betas))
    return starts
