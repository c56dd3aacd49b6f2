"""Fitting a body to keypoints in one or several images: the problem, its start, its measures."""

from collections.abc import Sequence

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Block, Points, Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.triangles import TriangleBody
from workbench.fitting.body_priors import pose_prior, shape_prior
from workbench.fitting.detector_layouts import counted_by_part
from workbench.fitting.keypoint_start import place_body
from workbench.fitting.observations import COCO, BadObservation, Observations, Photograph, pinhole
from workbench.fitting.setup import Measure, Setup, View, names
from workbench.geometry.camera import Camera, triangulate
from workbench.problem import Problem
from workbench.residuals import Residual, keypoints
from workbench.residuals.kernels import Kernel, quadratic

LEAST_CONFIDENCE = 0.2  # above which a keypoint counts in a mean
COUNTED = f"keypoints with a confidence above {LEAST_CONFIDENCE}"
FOCAL_SIGMA = 0.3  # of log f, for a camera of unknown focal length


def keypoint_fit(
    observations: Observations,
    body: SkinnedBody | TriangleBody,
    question: str,
    *,
    sigma: float = 4.0,
    kernel: Kernel = quadratic,
    held_out: Sequence[str] = (),
    reference: Array | None = None,
    compared: tuple[str, ...] = (),
) -> Setup:
    """Pose, betas and trans of a body from its keypoints in photographs; `sigma` in px.

    A detector's confidence c enters as the weight c^2, outside of the kernel, as in SPIN
    (Kolotouros et al. 2019): without a robust kernel, that keypoint has the standard deviation
    sigma / c. Priors on the pose (`pose_prior`) and the shape (`shape_prior`) determine what the
    keypoints do not. Photographs in `held_out` are not fitted, but drawn and measured. `reference`
    (M, 3) m holds published positions of the body's landmarks, NaN where there is none. A camera
    without K gets a free focal length.

    Raises BadObservation if the keypoints cannot place the body.
    """
    kind, held_out = landmark_set(body), names(held_out)
    landmarks = body.landmark_names(kind)
    photographs = observations.ordered(landmarks).photographs
    pose, betas, trans = body.blocks()
    points = body.landmark_points(kind, pose.symbol, betas.symbol, trans.symbol)
    start, residuals, views, cameras = body.start(), [], [], []
    for photo in photographs:
        camera = Camera(photo.name + "/")
        residual, (observed, confidence) = camera_residual(points, camera, landmarks, sigma, kernel)
        start |= camera_values(camera, photo) | {
            observed.name: photo.pixels,
            confidence.name: photo.confidence,
        }
        out = photo.name in held_out
        if not out:
            residuals.append(residual)
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
            "the keypoints do not determine the place of the body: those of its torso, or all of "
            "them, coincide or lie absurdly far out; check their coordinates, which are px"
        ) from error
    priors = [pose_prior(body), shape_prior(body)]
    free = ["pose", "betas", "trans"]
    for camera, photo in zip((v.camera for v in views), photographs, strict=True):
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


def camera_residual(
    points: Points, camera: Camera, landmarks: tuple[str, ...], sigma: float, kernel: Kernel
) -> tuple[Residual, tuple[Block, Block]]:
    """The residual of M landmarks in one camera, and the blocks of what the camera observed.

    These are `observed` (M, 2) px and `confidence` (M,), whose square is the residual's weight.
    """
    observed = Block(camera.prefix + "observed", (len(landmarks), 2), "px", landmarks)
    confidence = Block(camera.prefix + "confidence", (len(landmarks),), "1", landmarks)
    residual = keypoints(
        points,
        camera,
        observed.symbol,
        confidence.symbol**2,
        sigma=sigma,
        kernel=kernel,
        name=f"keypoints({camera.prefix.rstrip('/')})",
    )
    return residual, (observed, confidence)


def unused(observations: Observations, body: Body) -> tuple[str, ...]:
    """A sentence on the observed keypoints that have no landmark on the body, if there are any."""
    kind = landmark_set(body)
    landmarks, observed = body.landmark_names(kind), observations.observed()
    others = [name for name in observed if name not in landmarks]
    if not others:
        return ()
    return (
        f"Of {len(observed)} observed keypoints, {len(observed) - len(others)} are fitted; "
        f"the landmarks {kind!r} of the body {body.name!r} do not include the others: "
        f"{counted_by_part(others)}",
    )


def landmark_set(body: Body) -> str:
    """The landmark set that is fitted: `coco` where the body has it, or else its joints."""
    return "coco" if "coco" in body.landmarks else "joints"


def camera_values(camera: Camera, photo: Photograph) -> Values:
    """The camera's numbers; without K, the focal length is guessed as the longer side in px."""
    width, height = photo.size
    return camera.values(
        K=pinhole(max(photo.size), width, height) if photo.K is None else photo.K,
        R=np.eye(3) if photo.R is None else photo.R,
        t=np.zeros(3) if photo.t is None else photo.t,
        distortion=() if photo.distortion is None else photo.distortion,
    )


def focal_prior(camera: Camera, start: Values) -> Residual:
    """A prior on log f_x with a standard deviation of 0.3, and one on log f_y - log f_x of 0.01.

    The first is centred on the focal length of the start, the second on square pixels.
    """
    f = camera.focal.symbol
    guess = np.log(start[camera.focal.name][0])
    logs = cs.vertcat((cs.log(f[0]) - guess) / FOCAL_SIGMA, (cs.log(f[1]) - cs.log(f[0])) / 0.01)
    return Residual(f"focal prior({camera.prefix.rstrip('/')})", logs, 1.0)


def measures(
    body: Body, views: Sequence[View], values: Values, reference: Array | None
) -> tuple[Measure, ...]:
    """The mean reprojection error of every view, by `reprojection_errors`, and the mean distances
    of COCO's 17 keypoints to their triangulated and published positions.
    """
    arguments = [values[block.name] for block in body.blocks()]
    kind = landmark_set(body)
    found = body.landmark(kind, *arguments)  # (M, 3) m
    coco = np.isin(body.landmark_names(kind), COCO)
    result = []
    fitted: list[float] = []
    for view in views:
        error = reprojection_errors(
            view.observed, view.camera.pixels(found, values), view.confidence
        )
        if not view.held_out:
            fitted += error.tolist()
        what = f"reprojection, {view.name}{' (held out)' if view.held_out else ''}"
        result.append(_mean(what, error, "px", COUNTED))
    result.insert(0, _mean("reprojection, mean of the fitted", fitted, "px", COUNTED))
    fitting = [view for view in views if not view.held_out]
    if len(fitting) > 1:
        places = triangulate(
            [view.camera for view in fitting],
            values,
            [view.observed for view in fitting],
            [
                np.where(view.confidence > LEAST_CONFIDENCE, view.confidence, 0.0)
                for view in fitting
            ],
        )
        off = np.linalg.norm(found - places, axis=1)[coco]
        result.append(
            _mean(
                "distance to triangulated keypoints",
                1e3 * off,
                "mm",
                f"COCO {COUNTED} in 2 views",
            )
        )
    if reference is not None:
        off = np.linalg.norm(found - reference, axis=1)[coco]
        result.append(_mean("distance to published keypoints", 1e3 * off, "mm", "COCO keypoints"))
    betas = values[body.blocks()[1].name]
    result.append(Measure("largest |beta|", float(np.max(np.abs(betas), initial=0.0)), "sd"))
    return tuple(result)


def reprojection_errors(observed: Array, projected: Array, confidence: Array) -> Array:
    """The reprojection errors of one view in px, of all keypoints of the body, feet and hands too,
    that were observed there with a confidence above `LEAST_CONFIDENCE`.

    All statistics of a camera, in tables and on figures, are of these errors.
    """
    well = confidence > LEAST_CONFIDENCE
    return np.asarray(np.linalg.norm((projected - observed)[well], axis=1))


def _mean(name: str, numbers: ArrayLike, unit: str, what: str) -> Measure:
    """The mean of the finite numbers; `what` says what they are."""
    known = np.asarray(numbers, dtype=float)
    known = known[np.isfinite(known)]
    value = float(np.mean(known)) if known.size else np.nan
    return Measure(name, value, unit, f"{known.size} {what}")
