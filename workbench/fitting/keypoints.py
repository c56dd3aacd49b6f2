"""Fitting a body to keypoints in one or several images: the problem, its start, its measures."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.triangles import TriangleBody
from workbench.fitting.detector_layouts import counted_by_part
from workbench.fitting.image_recipe import SIGMA
from workbench.fitting.keypoint_problem import (
    KeypointProblem,
    camera_values,
    landmark_set,
    observed_blocks,
)
from workbench.fitting.keypoint_start import place_body
from workbench.fitting.observations import COCO, BadObservation, Observations
from workbench.fitting.setup import Measure, Setup, View, names
from workbench.geometry.camera import triangulate
from workbench.residuals.kernels import Kernel, quadratic

LEAST_CONFIDENCE = 0.2  # above which a keypoint counts in a mean
COUNTED = f"keypoints with a confidence above {LEAST_CONFIDENCE}"


def keypoint_fit(
    observations: Observations,
    body: SkinnedBody | TriangleBody,
    question: str,
    *,
    sigma: float | None = 4.0,
    kernel: Kernel = quadratic,
    held_out: Sequence[str] = (),
    reference: Array | None = None,
    compared: tuple[str, ...] = (),
) -> Setup:
    """Pose, betas and trans of a body from its keypoints in photographs; `sigma` in px.

    Without a sigma, it is SIGMA times the height of the person in each image.

    A detector's confidence c enters as the weight c^2, outside of the kernel, as in SPIN
    (Kolotouros et al. 2019): without a robust kernel, that keypoint has the standard deviation
    sigma / c. Priors on the pose (`pose_prior`) and the shape (`shape_prior`) determine what the
    keypoints do not. Photographs in `held_out` are not fitted, but drawn and measured. `reference`
    (M, 3) m holds published positions of the body's landmarks, NaN where there is none. A camera
    without K gets a free focal length.

    Raises BadObservation if the keypoints cannot place the body.
    """
    if sigma is None:
        placed = keypoint_setup(KeypointProblem(body), observations, question, held_out)
        heights = [height_in_view(body, view, placed.start) for view in placed.views]
        of = KeypointProblem(body, tuple(SIGMA * height for height in heights), kernel)
    else:
        of = KeypointProblem(body, sigma, kernel)
    return keypoint_setup(of, observations, question, held_out, reference, compared)


def keypoint_setup(
    of: KeypointProblem,
    observations: Observations,
    question: str,
    held_out: Sequence[str] = (),
    reference: Array | None = None,
    compared: tuple[str, ...] = (),
) -> Setup:
    """The fit of a problem to these observations; arguments and errors are `keypoint_fit`'s."""
    body = of.body
    kind, held_out = landmark_set(body, observations.observed()), names(held_out)
    landmarks = body.landmark_names(kind)
    photographs = observations.ordered(landmarks).photographs
    if all(photo.name in held_out for photo in photographs):
        raise BadObservation("there is no image to fit; hold out fewer")
    problem, cameras, priors = of.of(photographs, held_out, kind)
    start, views = body.start(), []
    for camera, photo in zip(cameras, photographs, strict=True):
        observed, confidence = (block.name for block in observed_blocks(camera, landmarks))
        seen = {observed: photo.pixels, confidence: photo.confidence}
        start |= camera_values(camera, photo) | seen
        out = photo.name in held_out
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
    return Setup(
        problem=problem,
        start=start,
        question=question,
        body=body,
        views=tuple(views),
        measures=lambda values: measures(body, views, values, reference),
        priors=priors,
        compared=compared,
        notes=(*observations.notes, *unused(observations, body)),
    )


def height_in_view(body: Body, view: View, values: Values) -> float:
    """How high a person at the depth of the body would be in an image, in px."""
    found = body.landmark(view.landmarks, *(values[block.name] for block in body.blocks()))
    depth = float(np.median(view.camera.depths(found, values)))
    stature = float(np.ptp(body.template[:, 1]))
    return float(np.mean(values[view.camera.focal.name])) * stature / max(depth, 1e-3)


def unused(observations: Observations, body: Body) -> tuple[str, ...]:
    """A sentence on the observed keypoints that have no landmark on the body, if there are any."""
    observed = observations.observed()
    kind = landmark_set(body, observed)
    landmarks = body.landmark_names(kind)
    others = [name for name in observed if name not in landmarks]
    if not others:
        return ()
    return (
        f"Of {len(observed)} observed keypoints, {len(observed) - len(others)} are fitted; "
        f"the landmarks {kind!r} of the body {body.name!r} do not include the others: "
        f"{counted_by_part(others)}",
    )


def measures(
    body: Body, views: Sequence[View], values: Values, reference: Array | None
) -> tuple[Measure, ...]:
    """The mean reprojection error of every view, by `reprojection_errors`, and the mean distances
    of COCO's 17 keypoints to their triangulated and published positions.
    """
    arguments = [values[block.name] for block in body.blocks()]
    kind = views[0].landmarks
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
