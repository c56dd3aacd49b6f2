"""Where to begin a fit to one image: the pose that a regressor reads off the keypoints.

A few gross outliers among the keypoints hardly matter: if the regressed body is far from some of
them, poses are regressed from subsets as well, and the one with which most keypoints agree is
taken, without the others (RANSAC; Fischler and Bolles, Random Sample Consensus, 1981).
"""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array, Mask
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.errors import BadArgument
from workbench.fitting.observations import BadObservation
from workbench.fitting.pose_regressor import FEWEST, PoseRegressor
from workbench.fitting.setup import View
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix

FAR = 0.25  # m, at the depth of the body: how far a regressed body may be from a keypoint
SUBSETS, LEFT_OUT = 64, 0.35  # how many subsets of keypoints, and the share that is left out
ROUNDS = 2  # of regressing without the keypoints that disagree
REWEIGHTED = 6  # times, when a body is placed
NEAREST = 0.1  # m, the depth of a body in front of the camera


@dataclass(frozen=True, eq=False)
class Regressed:
    """Bodies that were regressed from subsets of the keypoints of one view.

    Attributes:
        facing: (N, 3, 3) the root's rotations in the camera's frame.
        pose: (N, K, 3) rad; the root's rows are zero.
        root: (N, 3) m, where the root joint is in the camera's frame.
        distances: (N, M) m, from each keypoint of the regressor, at the depth of the body.
    """

    facing: Array
    pose: Array
    root: Array
    distances: Array


def regressed_start(regressor: PoseRegressor, body: Body, view: View, values: Values) -> Values:
    """Pose, betas (zero) and trans of a body that one camera observed.

    `values` hold the camera's numbers; the distortion of its lens is ignored. Raises
    BadObservation if the view shows fewer than three of the regressor's keypoints or they
    coincide, and BadArgument for a body that lacks one of them or has other joints.
    """
    rays, confidence, rows = seen_by(regressor, body, view, values)
    known = confidence > 0
    found = regressed(regressor, body, view.landmarks, rows, rays, confidence[None])
    close = found.distances[0] < FAR
    if not close[known].all():
        kept = _subsets(known)
        several = regressed(regressor, body, view.landmarks, rows, rays, confidence * kept)
        cost = (np.minimum(several.distances / FAR, 1.0) ** 2 @ known).argmin()
        close = several.distances[cost] < FAR
        for _ in range(ROUNDS):
            agreed = confidence * close
            if (agreed > 0).sum() < FEWEST:
                break
            found = regressed(regressor, body, view.landmarks, rows, rays, agreed[None])
            close = found.distances[0] < FAR
    return start_of(body, view, values, found, 0)


def regressed(
    regressor: PoseRegressor,
    body: Body,
    kind: str,
    rows: list[int],
    rays: Array,
    confidence: Array,
) -> Regressed:
    """Bodies from the same keypoints (M, 2), trusted in several ways: confidence (N, M)."""
    facing, pose = regressor.regress(np.broadcast_to(rays, (*confidence.shape, 2)), confidence)
    places = body.landmark(kind, pose)[:, rows] - body.joints(pose)[:, :1]
    points = np.einsum("nij,nmj->nmi", facing, places)
    return Regressed(facing, pose, *placed_by_rays(points, rays, confidence))


def placed_by_rays(points: Array, rays: Array, confidence: Array) -> tuple[Array, Array]:
    """The translations T (N, 3) m of points (N, M, 3) m onto rays (M, 2), and distances (N, M) m.

    A ray x meets the point p if x (p_z + T_z) = (p_x + T_x, p_y + T_y), which is linear in T. The
    distances from these equations are lengths at the depth of the points; they are weighted by the
    squares of the confidences (N, M), and again and again by 1 / (1 + (d / FAR)^2)^2, so that few
    that are far off hardly count (Geman and McClure). Raises BadObservation if T is not determined
    or behind the camera.
    """
    M = points.shape[1]
    A = np.zeros((M, 2, 3))
    A[:, :, :2], A[:, :, 2] = np.eye(2), -rays
    b = rays * points[..., 2:] - points[..., :2]  # (N, M, 2)
    w = confidence**2
    for _ in range(REWEIGHTED):
        H = np.einsum("nm,mai,maj->nij", w, A, A)
        g = np.einsum("nm,mai,nma->ni", w, A, b)
        if not (np.linalg.cond(H) < 1e12).all():
            raise BadObservation(
                "the keypoints do not determine the place of the body: nearly all of them "
                "coincide; check their coordinates, which are px"
            )
        T = np.linalg.solve(H, g[..., None])[..., 0]
        d = np.linalg.norm(np.einsum("mai,ni->nma", A, T) - b, axis=2)
        w = confidence**2 / (1 + (d / FAR) ** 2) ** 2
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
    if (confidence > 0).sum() < FEWEST:
        raise BadObservation(
            f"{view.name} shows only {int((confidence > 0).sum())} keypoints of the regressor; "
            f"{FEWEST} are needed to place the body"
        )
    f, c = values[view.camera.focal.name], values[view.camera.centre.name]
    rays = np.where(confidence[:, None] > 0, (view.observed[rows] - c) / f, 0.0)
    return rays, confidence, rows


def start_of(body: Body, view: View, values: Values, found: Regressed, n: int) -> Values:
    """Pose, betas and trans in the world of the n-th regressed body."""
    if not found.root[n, 2] > NEAREST:
        raise BadObservation(
            f"{view.name}: the keypoints place the body behind the camera; check that they are "
            "px, and that the camera's focal length is right"
        )
    pose, betas, trans = (block.name for block in body.blocks())
    R = matrix_from_vector(values[view.camera.rotation.name])  # world -> camera
    turned = found.pose[n].copy()
    turned[0] = vector_from_matrix(R.T @ found.facing[n])
    root = R.T @ (found.root[n] - values[view.camera.translation.name])
    return {pose: turned, betas: np.zeros(body.n_betas), trans: root - body.joints()[0]}


def _subsets(known: Mask) -> Mask:
    """Which keypoints are kept, (SUBSETS, M), each time without a share of those known."""
    rng = np.random.default_rng(len(known))
    order = np.where(known, rng.random((SUBSETS, len(known))), 2.0).argsort(axis=1).argsort(axis=1)
    count = int(known.sum())
    kept = max(FEWEST, count - round(LEFT_OUT * count))
    return np.asarray((order < kept) & known)
