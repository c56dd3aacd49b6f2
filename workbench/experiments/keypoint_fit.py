"""Fitting a body to keypoints in one or several images: the problem, its start, its measures."""

from collections.abc import Sequence
from importlib.resources import as_file, files

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.blocks import Block, Values
from workbench.bodies import SkinnedBody
from workbench.experiments.arguments import names
from workbench.experiments.detector_layouts import gathered
from workbench.experiments.experiment import Measure, Setup, View
from workbench.experiments.keypoint_start import place_body
from workbench.experiments.observations import COCO, BadObservation, Observations
from workbench.geometry.camera import Camera, triangulate
from workbench.problem import Problem
from workbench.reading.archive import open_arrays
from workbench.reading.damage import taken_for
from workbench.reading.expected import read_expected, reals
from workbench.residuals import Residual, gaussian, keypoints
from workbench.residuals.kernels import Kernel, quadratic

Array = NDArray[np.float64]
SEEN = 0.2  # the confidence above which a keypoint counts in a mean
SEEN_WELL = f"keypoints with a confidence above {SEEN}"
FOCAL_SIGMA = 0.3  # of log f, for a camera of unknown focal length


def keypoint_fit(
    observations: Observations,
    body: SkinnedBody,
    question: str,
    *,
    sigma: float = 4.0,
    kernel: Kernel = quadratic,
    held_out: Sequence[str] = (),
    reference: Array | None = None,
    compared: tuple[str, ...] = (),
) -> Setup:
    """Pose, betas and trans of a body from its keypoints in photographs; `sigma` in px.

    A detector's confidence c counts as the weight c^2, outside of the kernel, as in SPIN
    (Kolotouros et al. 2019): without a robust kernel that keypoint is ordinary at sigma / c.
    A prior on the pose (`pose_prior`) and on betas (standard normal) decides what the keypoints
    do not. Photographs in `held_out` are drawn and measured, not fitted. `reference` (M, 3) m,
    in the order of the body's landmarks and NaN where unknown, is what others published about
    where the points are. A single camera without K gets a free focal length.
    """
    kind, held_out = landmark_set(body), names(held_out)
    landmarks = body.landmark_names(kind)
    seen = observations.ordered(landmarks)
    pose, betas, trans = body.blocks()
    points = body.landmark_points(kind, pose.symbol, betas.symbol, trans.symbol)
    start, residuals, views, cameras = body.start(), [], [], []
    for photo in seen.photographs:
        camera = Camera(photo.name + "/")
        observed = Block(photo.name + "/observed", photo.pixels.shape, "px", landmarks)
        confidence = Block(photo.name + "/confidence", photo.confidence.shape, "1", landmarks)
        start |= camera_values(camera, photo.size, photo.K, photo.R, photo.t, photo.distortion)
        start |= {observed.name: photo.pixels, confidence.name: photo.confidence}
        out = photo.name in held_out
        if not out:
            residuals.append(
                keypoints(
                    points, camera, observed.symbol, confidence.symbol**2, sigma=sigma,
                    kernel=kernel, name=f"keypoints({photo.name})",
                )
            )  # fmt: skip
            cameras.append(camera)
        views.append(
            View(photo.name, camera, photo.size, kind, photo.pixels, photo.confidence, out)
        )
    fitted = [view for view in views if not view.held_out]
    try:
        with np.errstate(divide="raise", invalid="raise", over="raise"):
            start |= place_body(body, fitted, start)
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        raise BadObservation(
            "the keypoints tell no place for the body: those of its torso, or all of them, "
            "coincide or lie absurdly far out; look at their coordinates, which are px"
        ) from error
    priors = [pose_prior(body), gaussian(betas.symbol, name="shape prior")]
    free = ["pose", "betas", "trans"]
    for camera, photo in zip((v.camera for v in views), seen.photographs, strict=True):
        if photo.K is None and photo.name not in held_out:
            priors.append(focal_prior(camera, start))
            free.append(camera.focal.name)
    blocks = [block for camera in cameras for block in camera.blocks]
    return Setup(
        problem=Problem([*residuals, *priors], free, blocks=blocks),
        start=start,
        question=question,
        body=body,
        views=tuple(views),
        measures=lambda values: measures(body, views, values, reference),
        priors=tuple(prior.name for prior in priors),
        compared=compared,
        notes=(*observations.notes, *unused(observations, body)),
    )


def unused(observations: Observations, body: SkinnedBody) -> tuple[str, ...]:
    """A sentence on the keypoints that were seen and have no landmark on the body."""
    kind = landmark_set(body)
    landmarks, seen = body.landmark_names(kind), observations.seen()
    others = [name for name in seen if name not in landmarks]
    if not others:
        return ()
    return (
        f"Of {len(seen)} keypoints that were seen, {len(seen) - len(others)} are fitted; the "
        f"landmarks {kind!r} of body {body.name!r} have no place for the others: "
        f"{gathered(others)}",
    )


def landmark_set(body: SkinnedBody) -> str:
    """COCO's keypoints, where the body knows them; else the joints, of which limbs' names agree."""
    return "coco" if "coco" in body.landmarks else "joints"


def camera_values(
    camera: Camera, size: tuple[int, int], K: Array | None, R: Array | None, t: Array | None,
    distortion: Array | None,
) -> Values:  # fmt: skip
    """Numbers for a camera; without K, the focal length is guessed at the image's longer side."""
    if K is None:
        width, height = size
        f = float(max(size))
        K = np.array([[f, 0, width / 2], [0, f, height / 2], [0, 0, 1]])
    return camera.values(
        K=K,
        R=np.eye(3) if R is None else R,
        t=np.zeros(3) if t is None else t,
        distortion=() if distortion is None else distortion,
    )


def pose_prior(body: SkinnedBody) -> Residual:
    """All rotations but the root's, as a Gaussian learned from real motion capture has them.

    `data/poses/cmu_gaussian.npz` holds it, and PROVENANCE.md beside it says where it is from. A
    body with other joints than SMPL's 24 gets half a radian about the rest pose instead.
    """
    pose = body.blocks()[0].symbol
    if body.n_joints != 24:
        rest = body.bind_pose[1:]
        return gaussian(pose[:, 1:], mean=rest, covariance=0.25, unit="rad", name="pose prior")
    mean, covariance = learned_poses()
    return gaussian(pose[:, 1:], mean=mean, covariance=covariance, name="pose prior")


def learned_poses() -> tuple[Array, Array]:
    """Mean (69,) rad and covariance (69, 69) rad^2 of the rotations of SMPL's joints 1 to 23."""
    with (
        as_file(files("workbench") / "data" / "poses" / "cmu_gaussian.npz") as path,
        taken_for(path, "pose prior", "install the workbench again"),
        open_arrays(path) as archive,
    ):
        learned = read_expected(archive, {"mean": reals(69), "covariance": reals(69, 69)})
    return learned["mean"], learned["covariance"]


def focal_prior(camera: Camera, start: Values) -> Residual:
    """log f_x, give or take 30 %, and square pixels to 1 %."""
    f = camera.focal.symbol
    guess = np.log(start[camera.focal.name][0])
    logs = cs.vertcat((cs.log(f[0]) - guess) / FOCAL_SIGMA, (cs.log(f[1]) - cs.log(f[0])) / 0.01)
    return Residual(f"focal prior({camera.prefix.rstrip('/')})", logs, 1.0)


def measures(
    body: SkinnedBody, views: Sequence[View], values: Values, reference: Array | None
) -> tuple[Measure, ...]:
    """The mean reprojection error of every view, over the keypoints that `seen_well` counts, and
    the distances of COCO's 17 keypoints to where others place them.
    """
    arguments = [values[block.name] for block in body.blocks()]
    kind = landmark_set(body)
    found = body.landmark(kind, *arguments)  # (M, 3) m
    coco = np.isin(body.landmark_names(kind), COCO)
    result = []
    fitted: list[float] = []
    for view in views:
        error = seen_well(view.observed, view.camera.pixels(found, values), view.confidence)
        if not view.held_out:
            fitted += error.tolist()
        what = f"reprojection, {view.name}{' (held out)' if view.held_out else ''}"
        result.append(_mean(what, error, "px", SEEN_WELL))
    result.insert(0, _mean("reprojection, mean of the fitted", fitted, "px", SEEN_WELL))
    fitting = [view for view in views if not view.held_out]
    if len(fitting) > 1:
        places = triangulate(
            [view.camera for view in fitting], values, [view.observed for view in fitting],
            [np.where(view.confidence > SEEN, view.confidence, 0.0) for view in fitting],
        )  # fmt: skip
        off = np.linalg.norm(found - places, axis=1)[coco]
        result.append(
            _mean(
                "distance to triangulated keypoints",
                1e3 * off,
                "mm",
                f"COCO {SEEN_WELL} in 2 views",
            )
        )
    if reference is not None:
        off = np.linalg.norm(found - reference, axis=1)[coco]
        result.append(_mean("distance to published keypoints", 1e3 * off, "mm", "COCO keypoints"))
    betas = values[body.blocks()[1].name]
    result.append(Measure("largest |beta|", float(np.max(np.abs(betas), initial=0.0)), "sd"))
    return tuple(result)


def seen_well(observed: Array, projected: Array, confidence: Array) -> Array:
    """The reprojection errors of one view, px: of every keypoint of the body, feet and hands too,
    that was seen there with a confidence above `SEEN`. What is said of a camera, anywhere, is said
    of these.
    """
    well = confidence > SEEN
    return np.asarray(np.linalg.norm((projected - observed)[well], axis=1))


def _mean(name: str, numbers: ArrayLike, unit: str, what: str) -> Measure:
    """The mean of those that are known; `what` they are."""
    known = np.asarray(numbers, dtype=float)
    known = known[np.isfinite(known)]
    value = float(np.mean(known)) if known.size else np.nan
    return Measure(name, value, unit, f"{known.size} {what}")
