"""A body in photographs: one problem for all of a kind, the fit to one or several, its measures.

Several people marked the same persons in photographs of COCO, and the standard deviations of what
they marked, divided by the square root of the person's area, came out between 0.025 for eyes and
0.107 for hips; COCO's measure of detectors, the object keypoint similarity, is made with them
(Lin et al., Microsoft COCO, 2014, and its page on the evaluation of keypoints; for feet Jin et al.,
Whole-Body Human Pose Estimation in the Wild, 2020, the mean of both sides). Detectors learn from
such marks.
"""

from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks import Block, Points, Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadArgument
from workbench.fitting.body_priors import usual_priors
from workbench.fitting.files.layouts import counted_by_part
from workbench.fitting.observations import COCO, BadObservation, Observations, Photograph, pinhole
from workbench.fitting.placing import place_body, regressed_start
from workbench.fitting.pose_regressor import shipped_regressor
from workbench.fitting.setup import Measure, Setup, View, distances, largest_beta, names
from workbench.geometry.camera import Camera, triangulate
from workbench.problem import Problem
from workbench.residuals import Residual, keypoints
from workbench.residuals.kernels import Kernel, geman_mcclure, quadratic, scaled

MARKED_SD = {
    "nose": 0.026,
    "eye": 0.025,
    "ear": 0.035,
    "shoulder": 0.079,
    "elbow": 0.072,
    "wrist": 0.062,
    "hip": 0.107,
    "knee": 0.087,
    "ankle": 0.089,
    "toe": 0.080,
    "heel": 0.080,
}
TYPICAL_SD = 0.080  # the median of COCO's 17 keypoints and 6 of the feet, both sides counted
PLAIN, WITH_HANDS = "coco", "coco_with_hands"  # sets of landmarks
SIGMA = 0.0032  # of a person's height in an image and of the image's shorter side: `usual_sigma`
OUTLIER_SHARE = 0.08  # of that height, from which on a coordinate counts as an outlier
FOCAL_SIGMA = 0.3  # of log f, for a camera of unknown focal length
LEAST_CONFIDENCE = 0.2  # above which a keypoint counts in a mean
COUNTED = f"keypoints with a confidence above {LEAST_CONFIDENCE}"


def alike(names: Sequence[str]) -> Array:
    """The relative standard deviations (M,) of keypoints that are all known alike: 1."""
    return np.ones(len(names))


def as_marked(names: Sequence[str]) -> Array:
    """The standard deviations (M,) of keypoints with these names, relative to a typical one's.

    A landmark of a body is besides not at the very place that a detector calls by its name. That
    difference is taken to be as large for all as the marks of a typical keypoint spread, so that
    variances are m_k^2 + m^2, divided by 2 m^2, with m = 0.080. Eyes have 0.74, hips 1.18. A
    keypoint that nobody marked for COCO, such as one of a finger, has 1.
    """
    sds = [next((s for end, s in MARKED_SD.items() if n.endswith(end)), TYPICAL_SD) for n in names]
    return np.asarray(np.sqrt((np.array(sds) ** 2 + TYPICAL_SD**2) / (2 * TYPICAL_SD**2)))


def usual_sigma(height: float, size: tuple[float, float]) -> float:
    """The standard deviation in px of a keypoint of a person `height` px high in an image.

    `SIGMA sqrt(height^2 + side^2)` with the shorter side of the image of this `size` (width and
    height, px). What detectors and people mark spreads with the person's size (Lin et al., 2014);
    and detectors see an image at a size of their own, such as 800 px (He et al., Mask R-CNN, 2017),
    so that they know a person in its background less well. SIGMA was chosen on images of one real
    person and on synthetic people (`benchmarks/DECISIONS.md`).
    """
    return SIGMA * float(np.hypot(height, min(size)))


Kind = tuple[tuple[str, tuple[int, int] | None, bool], ...]  # of the photographs of one person
Relative = Callable[[Sequence[str]], Array]  # sigmas (M,) of keypoints compared with a typical one
Terms = Callable[[SkinnedBody | TriangleBody], Sequence[Residual]]


@dataclass(frozen=True, eq=False)
class KeypointProblem:
    """The problem of a body in photographs; what was observed is in fixed blocks.

    Photographs that differ in their keypoints and calibrations only have one and the same problem,
    with the functions that were derived for it; in a folder of a thousand images it is made once.

    `sigma` in px and `kernel` are of keypoints: one, or one for each photograph. `priors` are the
    residuals of a body beside its keypoints, and `relative` the standard deviations of keypoints by
    name, in sigmas.
    """

    body: SkinnedBody | TriangleBody
    sigma: float | tuple[float, ...] = 4.0
    kernel: Kernel | tuple[Kernel, ...] = quadratic
    priors: Terms = usual_priors
    relative: Relative = alike
    _made: dict[tuple[str, Kind], tuple[Problem, tuple[str, ...]]] = field(
        default_factory=dict, init=False, repr=False
    )

    def of(
        self, photographs: Sequence[Photograph], held_out: Collection[str], landmarks: str
    ) -> tuple[Problem, tuple[str, ...]]:
        """The problem of a set of landmarks, and the names of the priors.

        Cameras of photographs that are held out are not among the problem's.
        """
        kind = tuple(
            (p.name, p.size if p.K is None else None, p.name in held_out) for p in photographs
        )
        if (landmarks, kind) not in self._made:
            self._made[landmarks, kind] = self._make(landmarks, kind)
        return self._made[landmarks, kind]

    def _make(self, landmarks: str, kind: Kind) -> tuple[Problem, tuple[str, ...]]:
        names, body_blocks = self.body.landmark_names(landmarks), self.body.blocks()
        points = self.body.landmark_points(landmarks, *(block.symbol for block in body_blocks))
        terms, priors, blocks = [], list(self.priors(self.body)), list[Block]()
        free = [block.name for block in body_blocks]
        sigmas = self.sigma if isinstance(self.sigma, tuple) else (self.sigma,) * len(kind)
        kernels = self.kernel if isinstance(self.kernel, tuple) else (self.kernel,) * len(kind)
        for (name, size, held_out), sigma, kernel in zip(kind, sigmas, kernels, strict=True):
            if held_out:
                continue
            camera, relative = Camera(name + "/"), self.relative(names)
            terms.append(camera_residual(points, camera, names, sigma, kernel, relative)[0])
            blocks += camera.blocks
            if size is not None:
                priors.append(focal_prior(camera, max(size)))
                free.append(camera.focal.name)
        problem = Problem([*terms, *priors], free, blocks=blocks)
        return problem, tuple(prior.name for prior in priors)


def landmark_set(body: Body, observed: Collection[str] = ()) -> str:
    """The landmark set that is fitted: `coco` where the body has it, or else its joints.

    A body with fingers has another set, `coco_with_hands`, which is fitted if any of the `observed`
    keypoints is one of a hand.
    """
    both = [body.landmarks[name].names for name in (PLAIN, WITH_HANDS) if name in body.landmarks]
    if len(both) == 2 and {*observed} & ({*both[1]} - {*both[0]}):
        return WITH_HANDS
    return PLAIN if PLAIN in body.landmarks else "joints"


def observed_blocks(camera: Camera, landmarks: tuple[str, ...]) -> tuple[Block, Block]:
    """The blocks of what a camera observed: `observed` (M, 2) px and `confidence` (M,)."""
    return (
        Block(camera.prefix + "observed", (len(landmarks), 2), "px", landmarks),
        Block(camera.prefix + "confidence", (len(landmarks),), "1", landmarks),
    )


def camera_residual(
    points: Points,
    camera: Camera,
    landmarks: tuple[str, ...],
    sigma: float,
    kernel: Kernel,
    relative: Array | None = None,
) -> tuple[Residual, tuple[Block, Block]]:
    """The residual of M landmarks in one camera, and the blocks of what the camera observed.

    The squares of the confidences are the weights, divided by those of `relative` (M,), the
    keypoints' standard deviations in sigmas.
    """
    observed, confidence = observed_blocks(camera, landmarks)
    residual = keypoints(
        points,
        camera,
        observed.symbol,
        confidence.symbol**2 if relative is None else (confidence.symbol / cs.DM(relative)) ** 2,
        sigma=sigma,
        kernel=kernel,
        name=f"keypoints({camera.prefix.rstrip('/')})",
    )
    return residual, (observed, confidence)


def camera_values(camera: Camera, photo: Photograph) -> Values:
    """The camera's numbers; without K, the focal length is guessed as the longer side in px."""
    width, height = photo.size
    return camera.values(
        K=pinhole(max(photo.size), width, height) if photo.K is None else photo.K,
        R=np.eye(3) if photo.R is None else photo.R,
        t=np.zeros(3) if photo.t is None else photo.t,
        distortion=() if photo.distortion is None else photo.distortion,
    )


def focal_prior(camera: Camera, guess: float) -> Residual:
    """A prior on log f_x with a standard deviation of 0.3, and one on log f_y - log f_x of 0.01.

    The first is centred on a guess in px, the second on square pixels.
    """
    f = camera.focal.symbol
    logs = cs.vertcat(
        (cs.log(f[0]) - float(np.log(guess))) / FOCAL_SIGMA, (cs.log(f[1]) - cs.log(f[0])) / 0.01
    )
    return Residual(f"focal prior({camera.prefix.rstrip('/')})", logs, 1.0)


def keypoint_fit(
    observations: Observations,
    body: SkinnedBody | TriangleBody,
    question: str,
    *,
    sigma: float | None = 4.0,
    kernel: Kernel | None = quadratic,
    relative: Relative = alike,
    held_out: Sequence[str] = (),
    reference: Array | None = None,
    compared: tuple[str, ...] = (),
) -> Setup:
    """Pose, betas and trans of a body from its keypoints in photographs; `sigma` in px.

    Without a sigma, it follows the person's height in each image (`usual_sigma`). Without a kernel,
    it is Geman and McClure's, with outliers from OUTLIER_SHARE times that height on; the fit then
    begins in the pose that a regressor reads off the view that shows most, if the body is of its
    kind.

    A detector's confidence c enters as the weight c^2, outside of the kernel, as in SPIN
    (Kolotouros et al. 2019): without a robust kernel, that keypoint has the standard deviation
    sigma / c, times that of `relative`. Priors on the pose (`pose_prior`) and the shape
    (`shape_prior`) determine what the keypoints do not. Photographs in `held_out` are not fitted,
    but drawn and measured. `reference` (M, 3) m holds published positions of the body's landmarks,
    NaN where there is none. A camera without K gets a free focal length.

    Raises BadObservation if the keypoints cannot place the body.
    """
    shown = placed_views(body, observations, held_out)
    heights = [max(height_in_view(body, view, shown.start), 1.0) for view in shown.views]
    sigmas = tuple(
        usual_sigma(height, view.size) if sigma is None else sigma
        for height, view in zip(heights, shown.views, strict=True)
    )
    kernels = tuple(
        kernel or scaled(geman_mcclure, OUTLIER_SHARE * height / own)
        for height, own in zip(heights, sigmas, strict=True)
    )
    if kernel is None:
        fitted = [view for view in shown.views if not view.held_out]
        best = max(fitted, key=lambda view: float(view.confidence.sum()))
        with suppress(BadArgument, BadObservation):
            regressed = regressed_start(shipped_regressor(), body, best, shown.start)
            shown = replace(shown, start={**shown.start, **regressed})
    of = KeypointProblem(body, sigmas, kernels, relative=relative)
    return shown.setup(of, question, reference, compared)


def keypoint_setup(
    of: KeypointProblem, observations: Observations, question: str, held_out: Sequence[str] = ()
) -> Setup:
    """The fit of a problem to these observations; arguments and errors are `keypoint_fit`'s."""
    return placed_views(of.body, observations, held_out).setup(of, question)


@dataclass(frozen=True, eq=False)
class PlacedViews:
    """What cameras observed, also as photographs and views of the landmarks that are fitted;
    `start` has the numbers of the cameras, what they observed, and the body placed where it was
    seen.
    """

    observations: Observations
    photographs: tuple[Photograph, ...]
    views: tuple[View, ...]
    start: Values

    def setup(
        self,
        of: KeypointProblem,
        question: str,
        reference: Array | None = None,
        compared: tuple[str, ...] = (),
    ) -> Setup:
        """The fit of a problem to these views; see `keypoint_fit`."""
        body, held_out = of.body, [view.name for view in self.views if view.held_out]
        problem, priors = of.of(self.photographs, held_out, self.views[0].landmarks)
        return Setup(
            problem=problem,
            start=self.start,
            question=question,
            body=body,
            views=self.views,
            measures=lambda values: measures(body, self.views, values, reference),
            priors=priors,
            compared=compared,
            notes=(*self.observations.notes, *unused(self.observations, body)),
        )


def placed_views(
    body: SkinnedBody | TriangleBody, observations: Observations, held_out: Sequence[str] = ()
) -> PlacedViews:
    """The views of photographs, and where the body is in those that are fitted.

    Raises BadObservation if the keypoints cannot place the body.
    """
    kind, held_out = landmark_set(body, observations.observed()), names(held_out)
    landmarks = body.landmark_names(kind)
    photographs = observations.ordered(landmarks).photographs
    start, views = body.start(), []
    for photo in photographs:
        camera = Camera(photo.name + "/")
        observed, confidence = (block.name for block in observed_blocks(camera, landmarks))
        start |= camera_values(camera, photo)
        start |= {observed: photo.pixels, confidence: photo.confidence}
        view = View(photo.name, camera, photo.size, kind, photo.pixels, photo.confidence)
        views.append(replace(view, held_out=photo.name in held_out))
    try:
        with np.errstate(divide="raise", invalid="raise", over="raise"):
            start |= place_body(body, [view for view in views if not view.held_out], start)
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        raise BadObservation(
            "the keypoints do not determine the place of the body: those of its torso, or all of "
            "them, coincide or lie absurdly far out; check their coordinates, which are px"
        ) from error
    return PlacedViews(observations, photographs, tuple(views), start)


def height_in_view(body: Body, view: View, values: Values) -> float:
    """How high a person at the depth of the body would be in an image, in px."""
    landmarks = body.landmark(view.landmarks, *(values[block.name] for block in body.blocks()))
    depth = float(np.median(view.camera.depths(landmarks, values)))
    stature = float(np.ptp(body.template[:, 1]))
    return float(np.mean(values[view.camera.focal.name])) * stature / max(depth, 1e-3)


def unused(observations: Observations, body: Body) -> tuple[str, ...]:
    """A sentence on the observed keypoints that have no landmark on the body, if there are any."""
    observed = observations.observed()
    kind = landmark_set(body, observed)
    others = [name for name in observed if name not in body.landmark_names(kind)]
    if not others:
        return ()
    return (
        f"Of {len(observed)} observed keypoints, {len(observed) - len(others)} are fitted; "
        f"the landmarks {kind!r} of the body {body.name!r} do not include the others: "
        f"{counted_by_part(others)}",
    )


def triangulated(views: Sequence[View], values: Values) -> Array:
    """The keypoints (M, 3) m that two views or more see; NaN for others."""
    sure = [np.where(v.confidence > LEAST_CONFIDENCE, v.confidence, 0.0) for v in views]
    return triangulate([v.camera for v in views], values, [v.observed for v in views], sure)


def measures(
    body: Body, views: Sequence[View], values: Values, reference: Array | None
) -> tuple[Measure, ...]:
    """The mean reprojection error of every view, by `reprojection_errors`, and the mean distances
    of COCO's 17 keypoints to their triangulated and published positions.
    """
    kind = views[0].landmarks
    places = body.landmark(kind, *(values[block.name] for block in body.blocks()))  # (M, 3) m
    coco = np.isin(body.landmark_names(kind), COCO)
    fitted, own, each = [], [], []
    for view in views:
        projected = view.camera.pixels(places, values)
        error = reprojection_errors(view.observed, projected, view.confidence)
        name = f"reprojection, {view.name}{' (held out)' if view.held_out else ''}"
        each.append(_mean(name, error, "px", COUNTED))
        if not view.held_out:
            fitted.append(view)
            own.append(error)
    shown = [_mean("reprojection, mean of the fitted", np.concatenate(own), "px", COUNTED), *each]
    if len(fitted) > 1:
        off = distances(places, triangulated(fitted, values))[coco]
        of = f"COCO {COUNTED} in 2 views"
        shown.append(_mean("distance to triangulated keypoints", off, "mm", of))
    if reference is not None:
        off = distances(places, reference)[coco]
        shown.append(_mean("distance to published keypoints", off, "mm", "COCO keypoints"))
    return (*shown, largest_beta(values[body.blocks()[1].name]))


def reprojection_errors(observed: Array, projected: Array, confidence: Array) -> Array:
    """The reprojection errors of one view in px, of all keypoints of the body, feet and hands too,
    that were observed there with a confidence above `LEAST_CONFIDENCE`.

    All statistics of a camera, in tables and on figures, are of these errors.
    """
    well = confidence > LEAST_CONFIDENCE
    return np.asarray(np.linalg.norm((projected - observed)[well], axis=1))


def _mean(name: str, numbers: Array, unit: str, what: str) -> Measure:
    """The mean of the finite numbers; `what` says what they are."""
    known = numbers[np.isfinite(numbers)]
    value = float(np.mean(known)) if known.size else np.nan
    return Measure(name, value, unit, f"{known.size} {what}")
