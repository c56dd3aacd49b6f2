"""Where to put a body before fitting it to keypoints: closed forms, no iteration."""

from collections.abc import Sequence

import numpy as np

from workbench.arrays import Array, Mask
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.fitting.mesh_start import moved
from workbench.fitting.observations import BadObservation
from workbench.fitting.setup import View
from workbench.geometry.camera import triangulate
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import matrix_from_vector

TORSO = ("left_shoulder", "right_shoulder", "left_hip", "right_hip")


def place_body(body: Body, views: Sequence[View], values: Values) -> Values:
    """The root's rotation and the translation, by triangulation or from a single image.

    Raises BadObservation if fewer than three keypoints are known, or there is no image.
    """
    if len(views) >= 2:
        return _from_several(body, views, values)
    if not views:
        raise BadObservation("there is no image to fit; hold out fewer")
    return _from_one(body, views[0], values)


def _rest(body: Body, views: Sequence[View]) -> tuple[Array, Mask]:
    """The landmarks (M, 3) m of the body at rest, and which of them are on the torso (M,)."""
    names = body.landmark_names(views[0].landmarks)
    return body.landmark(views[0].landmarks), np.isin(names, TORSO)


def _from_several(body: Body, views: Sequence[View], values: Values) -> Values:
    """The rest body moved rigidly onto triangulated keypoints, of the torso if these suffice."""
    rest, torso = _rest(body, views)
    places = triangulate(
        [v.camera for v in views],
        values,
        [v.observed for v in views],
        [v.confidence for v in views],
    )
    known = np.isfinite(places).all(axis=1)
    chosen = known & torso if (known & torso).sum() >= 3 else known
    if chosen.sum() < 3:
        raise BadObservation(
            f"only {int(chosen.sum())} keypoints are seen by two cameras or more; 3 are needed to "
            "place the body"
        )
    motion = procrustes(rest[chosen], places[chosen])
    return moved(body, motion.R, motion.t)


def _from_one(body: Body, view: View, values: Values) -> Values:
    """The place of the rest body by similar triangles, as SMPLify begins (Bogo et al. 2016).

    The body is turned about its own axis and in the image plane, and scaled to the keypoints; the
    scale is the focal length over the depth. Of eight directions in which it may face, the one
    that fits best is taken.
    """
    rest, torso = _rest(body, [view])
    known = view.confidence > 0
    chosen = known & torso if (known & torso).sum() >= 3 else known
    if chosen.sum() < 3:
        raise BadObservation(
            f"{view.name} shows only {int(chosen.sum())} keypoints; 3 are needed to place the body"
        )
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
