"""A body on the keypoints of one image: recipe, stages and starts, the mean, and the distance.

SMPLify (Bogo et al., Keep it SMPL, 2016) has all of these: a robust reprojection error, priors on
pose and shape, a term against elbows and knees that bend backwards, and stages in which priors
count much at first. Its code multiplies residuals by weights: lambda_theta is 404, 404, 57.4 and
4.78 in its four stages, lambda_beta 100, 50, 10 and 5, and the term of the elbows and knees is
3.17 lambda_theta. Its prior on the pose is half a squared distance, its keypoints are whole
squares in px, and so lambda_theta = sqrt(2) sigma for our sigma of a keypoint in px.

Lengths in px are proportional to the height of the person in the image. What a camera observed is
in fixed blocks, so that images of one kind share one problem with its derived functions. A fit
begins at what a small network reads off the keypoints, and further hypotheses at the resting body
and at turned ones.

The landmarks of a detector are not those of a body: a hip, say, is always found a little farther
out. If each keypoint k has an offset of its own, o_k ~ N(0, (s m_k)^2) m in each direction, seen as
s m_k f / z px at the distance z, and it is integrated out, then the estimate x of the fit has
another covariance than Laplace's C = (J'J)^-1:

    C + (s f / (z sigma))^2 C J_d' J_d C

with the rows J_d of the keypoints, whitened (White, Maximum likelihood estimation of misspecified
models, 1982), both up to the curvature that the Gauss-Newton Hessian J'J leaves out. A keypoint
that is known less well has a larger offset too: m_k is its standard deviation in sigmas, 1 for a
typical keypoint of confidence 1 (`as_marked`).
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.blocks.checks import above_zero
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadArgument
from workbench.fitting.body_priors import (
    CONTACT,
    MEASURED_SIGMA,
    POSE_PRIOR,
    mixture_prior,
    pose_prior,
    posed_capsules,
    stature_prior,
    usual_priors,
)
from workbench.fitting.keypoints import (
    LEAST_CONFIDENCE,
    OUTLIER_SHARE,
    KeypointProblem,
    Relative,
    Terms,
    alike,
    as_marked,
    height_in_view,
    placed_views,
    usual_sigma,
)
from workbench.fitting.observations import Observations
from workbench.fitting.placing import image_starts
from workbench.fitting.setup import Measure, Setup, View
from workbench.geometry.rotation import matrix_from_vector
from workbench.residuals import Residual, bending, spheres
from workbench.residuals.kernels import geman_mcclure, scaled
from workbench.residuals.numbers import HINGES
from workbench.sampling.posterior_mean import posterior_mean
from workbench.solvers import LevenbergMarquardt, Solver, SolveStage, Staged, Starts

KEYPOINTS = "keypoints"  # in the weights of a stage: those of every camera
LAMBDA_POSE = 404.0, 404.0, 57.4, 4.78
LAMBDA_SHAPE = 100.0, 50.0, 10.0, 5.0
HINGE_WEIGHT = 3.17  # SMPLify's weight of the term of elbows and knees, in lambda_theta
LAMBDA_SPHERES = 1e3  # in each stage
SMPLIFY_SIGMA = LAMBDA_POSE[-1] / float(np.sqrt(2))  # px

RecipeOf = Callable[["Appearance"], "ImageRecipe"]
ROUGHLY = LevenbergMarquardt(gradient_tolerance=0.01)  # of a stage that is only a start
NEARLY = LevenbergMarquardt(gradient_tolerance=1e-3)  # beyond, keypoints tell nothing more
SUSPECT_SHARE = 1 / 7  # of a person's height in the image
SIZE_RATIO = 1.25  # heights and sides are rounded to powers of it, so that images share problems
LANDMARK_OFFSET = 0.015  # m, in each direction: how far a detector's landmarks are from the body's
Z90 = 1.6448536269514722  # 90 % of a normal distribution are within so many standard deviations
INTERVAL_NOTE = (
    "The 90 % interval of the distance allows for landmarks of the detector that lie "
    f"{100 * LANDMARK_OFFSET:g} cm (standard deviation in each direction) beside those of the "
    "body. It was tested on 100 images of one real person, whose distance was known from four "
    "calibrated cameras: it contained this distance in 100 % of the images, and in 93 % if the "
    "stature was given. Intervals 0.80 and 0.92 times as wide would have contained it in 90 %"
)
DIFFERENCE_STEP = 1e-5  # of an unknown, for a central difference
# by `python -m benchmarks accuracy images`; `spread` in benchmarks/results/accuracy_images.json
SPREAD_NOTE = (
    "too small: on 52 images of one real person, landmarks were 1.4 times as far from the truth "
    "(root mean square; 0.9 to 1.9 times, by landmark)"
)


def image_priors(body: SkinnedBody | TriangleBody) -> tuple[Residual, ...]:
    """Priors on pose and shape, and elbows and knees that do not bend backwards."""
    pose = body.blocks()[0]
    hinged = set(HINGES) & set(pose.labels or ())
    return (*usual_priors(body), *([bending(pose)] if hinged else []))


@dataclass(frozen=True)
class WithPosePrior:
    """The priors of an image, with another one on the pose, such as `mixture_prior`, and with
    others beside them, such as `apart_prior`.
    """

    pose: Callable[[Body], Residual] = pose_prior
    others: tuple[Callable[[Body], Residual], ...] = ()

    def __call__(self, body: SkinnedBody | TriangleBody) -> tuple[Residual, ...]:
        """The terms of this body. Raises what `pose` and `others` raise."""
        kept = (self.pose(body) if p.name == POSE_PRIOR else p for p in image_priors(body))
        return (*kept, *(other(body) for other in self.others))


def spheres_prior(body: Body) -> Residual:
    """E_sp of SMPLify, whose radii are those of the mean person: see `spheres`."""
    ends, capsules = posed_capsules(body)
    sigma = LAMBDA_POSE[-1] / (LAMBDA_SPHERES * float(np.sqrt(2)))
    return spheres(ends, capsules.radii, capsules.pairs, sigma=sigma, name=CONTACT)


@dataclass(frozen=True)
class SmplifyTerms:
    """The prior `pose`, shape, elbows and knees, and for bodies with capsules E_sp, with the
    weights that SMPLify's code has in its last stage.
    """

    pose: Callable[[Body], Residual] = mixture_prior

    def __call__(self, body: SkinnedBody | TriangleBody) -> tuple[Residual, ...]:
        """The terms of this body. Raises what `pose` raises."""
        counts = {
            "shape prior": 2 * (LAMBDA_SHAPE[-1] / LAMBDA_POSE[-1]) ** 2,
            "bending": 2 * HINGE_WEIGHT**2,
        }
        capsules = isinstance(body, SkinnedBody) and body.capsules is not None
        terms = WithPosePrior(self.pose, (spheres_prior,) if capsules else ())(body)
        return tuple(p.weighed(counts[p.name]) if p.name in counts else p for p in terms)


def smplify_stages() -> tuple[SolveStage, ...]:
    """SMPLify's schedule: the place first, and then three stages before the last one."""
    last = LAMBDA_SHAPE[-1] / LAMBDA_POSE[-1]
    weights = [
        {
            **dict.fromkeys((KEYPOINTS, CONTACT), (LAMBDA_POSE[-1] / pose) ** 2),
            "shape prior": (shape / pose / last) ** 2,
        }
        for pose, shape in zip(LAMBDA_POSE[:-1], LAMBDA_SHAPE[:-1], strict=True)
    ]
    root = SolveStage(("trans", "pose[0]"))
    return (root, *(SolveStage(weights=w) for w in weights))


@dataclass(frozen=True)
class WithStature:
    """The priors of an image, and a stature that was measured as `height`, with `sigma`, in m."""

    height: float
    sigma: float = MEASURED_SIGMA
    priors: Terms = image_priors

    def __call__(self, body: SkinnedBody | TriangleBody) -> tuple[Residual, ...]:
        """The priors of this body. Raises BadArgument for one that is not skinned."""
        if not isinstance(body, SkinnedBody):
            raise BadArgument(
                f"the stature of body {body.name!r} is no linear function of its shape; fit it "
                "without a height, or take a skinned body"
            )
        return (*self.priors(body), stature_prior(body, self.height, sigma=self.sigma))


@dataclass(frozen=True)
class ImageRecipe:
    """How a body is fitted to the keypoints of one image, with all lengths in px.

    Raises BadArgument for a sigma or an outlier that is not above 0.

    Attributes:
        sigma: the standard deviation of a keypoint, in px.
        outlier: the distance in px from which on a coordinate counts as an outlier: Geman and
            McClure's kernel has this scale, whatever sigma is.
        priors: the residuals of a body beside its keypoints.
        stages: what is different before the last stage; the name `keypoints` among the weights
            stands for those of every camera.
        solver: what solves each stage, if the stage does not say.
        relative: the standard deviations of keypoints by name, in sigmas.
    """

    sigma: float
    outlier: float
    priors: Terms
    stages: tuple[SolveStage, ...]
    solver: Solver
    relative: Relative = alike

    def __post_init__(self) -> None:
        above_zero("keypoints in px", sigma=self.sigma, outlier=self.outlier)

    def stages_of(self, residuals: Iterable[str], solver: Solver | None) -> tuple[SolveStage, ...]:
        """The stages of a problem with residuals of these names, by `solver` if there is one."""

        def spelled(stage: SolveStage) -> SolveStage:
            of = {name: KEYPOINTS if name.startswith("keypoints(") else name for name in residuals}
            weights = {n: stage.weights[kind] for n, kind in of.items() if kind in stage.weights}
            return replace(stage, weights=weights, solver=solver or stage.solver)

        return tuple(map(spelled, self.stages))


@dataclass(frozen=True)
class Appearance:
    """What is known of a person in an image before the fit.

    Attributes:
        height: how high the person would be in the image if they stood upright, in px.
        side: the shorter side of the image, in px.
        suspect: whether some keypoints lie far from where the start has them.
    """

    height: float
    side: float
    suspect: bool = False


@dataclass(frozen=True)
class Smplify:
    """SMPLify's terms, weights and stages, whatever the person looks like; see `ImageRecipe`."""

    sigma: float = SMPLIFY_SIGMA
    outlier: float = 100.0
    priors: Terms = SmplifyTerms()
    solver: Solver = field(default_factory=LevenbergMarquardt)

    def __call__(self, person: Appearance) -> ImageRecipe:
        """The recipe, which is the same for every person."""
        return ImageRecipe(self.sigma, self.outlier, self.priors, smplify_stages(), self.solver)


@dataclass(frozen=True)
class ByHeight:
    """A recipe whose lengths grow with the height of the person in the image: 100 px are little for
    a person who fills a photograph, and half of one in its background. See also `ImageRecipe`.

    Attributes:
        sigma: the standard deviation of a keypoint, in px; without one, `usual_sigma`.
        outlier: from which distance on a coordinate counts as an outlier, as a share of the
            person's height in the image.
        strict: the same if some keypoints are suspected to be wrong already at the start.
    """

    sigma: float | None = None
    outlier: float = OUTLIER_SHARE
    strict: float = 0.04
    priors: Terms = image_priors
    solver: Solver = NEARLY
    relative: Relative = as_marked

    def __call__(self, person: Appearance) -> ImageRecipe:
        """The recipe for a person of this appearance."""
        height = person.height
        sigma = usual_sigma(height, (person.side,) * 2) if self.sigma is None else self.sigma
        outlier = height * (self.strict if person.suspect else self.outlier)
        return ImageRecipe(sigma, outlier, self.priors, (), self.solver, self.relative)


@dataclass(frozen=True, eq=False)
class ImageFits:
    """Fits of a body to single images by a recipe, which depends on the appearance of the person;
    what images have in common is made once.
    """

    body: SkinnedBody | TriangleBody
    recipe: RecipeOf = field(default_factory=ByHeight)
    _made: dict[Appearance, tuple[ImageRecipe, KeypointProblem]] = field(
        default_factory=dict, init=False, repr=False
    )

    def setup(
        self,
        observations: Observations,
        question: str,
        hypotheses: int = 1,
        held_out: Sequence[str] = (),
        reference: Array | None = None,
        compared: tuple[str, ...] = (),
    ) -> Setup:
        """Pose, betas and trans of the body from the keypoints of one image; see `image_fit`.

        The measures of the setup tell the distance from the camera with its 90 % interval.
        """
        shown = placed_views(self.body, observations, held_out)
        view = next(view for view in shown.views if not view.held_out)
        starts = image_starts(self.body, view, shown.start, hypotheses)
        shown = replace(shown, start={**shown.start, **starts[0]})
        recipe, of = self._for(appearance(self.body, view, shown.start))
        setup = shown.setup(of, question, reference, compared)

        def strategy(solver: Solver | None) -> Solver:
            staged = Staged(recipe.stages_of(setup.problem.rows, solver), solver or recipe.solver)
            return staged if len(starts) == 1 else Starts(starts, staged)

        if sum(not view.held_out for view in setup.views) != 1:
            return replace(setup, strategy=strategy)
        return replace(
            setup,
            strategy=strategy,
            measures=lambda values: (*setup.measures(values), *depth_measures(setup, values)),
            notes=(*setup.notes, INTERVAL_NOTE),
        )

    def _for(self, person: Appearance) -> tuple[ImageRecipe, KeypointProblem]:
        """The recipe and the problem for a person who looks nearly like this."""
        lengths = np.maximum([person.height, person.side], 1.0)
        height, side = SIZE_RATIO ** np.round(np.log(lengths) / np.log(SIZE_RATIO))
        nearly = Appearance(float(height), float(side), person.suspect)
        if nearly not in self._made:
            recipe = self.recipe(nearly)
            kernel = scaled(geman_mcclure, recipe.outlier / recipe.sigma)
            problem = KeypointProblem(
                self.body, recipe.sigma, kernel, recipe.priors, recipe.relative
            )
            self._made[nearly] = recipe, problem
        return self._made[nearly]


def image_fit(
    observations: Observations,
    body: SkinnedBody | TriangleBody,
    question: str,
    *,
    recipe: RecipeOf | None = None,
    hypotheses: int = 1,
    held_out: Sequence[str] = (),
    reference: Array | None = None,
    compared: tuple[str, ...] = (),
) -> Setup:
    """Pose, betas and trans of a body from the keypoints of one image, as SMPLify does.

    The setup's `strategy` is how it is solved: in stages, from `hypotheses` starts. To fit many
    images, make one `ImageFits`. Other arguments and errors are those of `keypoint_fit`.
    """
    fits, rest = ImageFits(body, recipe or ByHeight()), (hypotheses, held_out, reference, compared)
    return fits.setup(observations, question, *rest)


def appearance(body: Body, view: View, values: Values) -> Appearance:
    """How high a person at the depth of a start would be in the image, and whether some keypoint
    is suspect: farther from the start's than a seventh of that height.
    """
    landmarks = body.landmark(view.landmarks, *(values[block.name] for block in body.blocks()))
    height = height_in_view(body, view, values)
    off = np.linalg.norm(view.camera.pixels(landmarks, values) - view.observed, axis=1)
    suspect = (off > SUSPECT_SHARE * height) & (view.confidence > LEAST_CONFIDENCE)
    return Appearance(height, min(view.size), bool(suspect.any()))


@dataclass(frozen=True)
class DepthInterval:
    """How far the body's root is from the camera's plane, along the axis of the camera, in m."""

    mean: float
    sd: float

    @property
    def low(self) -> float:
        """The lower end of the 90 % interval, m."""
        return self.mean - Z90 * self.sd

    @property
    def high(self) -> float:
        """The upper end of the 90 % interval, m."""
        return self.mean + Z90 * self.sd

    def __str__(self) -> str:
        return f"{self.mean:.2f} m (90 %: {self.low:.2f} to {self.high:.2f} m)"


def depth_interval(
    setup: Setup, values: Values, offset: float = LANDMARK_OFFSET
) -> DepthInterval | None:
    """The distance of the body in the one view that was fitted, at the solution `values`.

    `offset` is the standard deviation in m of the distance between a landmark of the detector and
    that of the body, in each direction; with 0 the interval is Laplace's. None if keypoints and
    priors do not determine the distance, or if not one view was fitted.
    """
    fitted = [view for view in setup.views if not view.held_out]
    if len(fitted) != 1 or setup.body is None or _keypoints_of(setup, fitted[0]) is None:
        return None
    mean, sd, lever = depth_spread(setup, fitted[0], values)
    total = float(np.hypot(sd, offset * lever))
    return DepthInterval(mean, total) if np.isfinite(total) else None


def depth_measures(setup: Setup, values: Values) -> tuple[Measure, ...]:
    """The distance of `depth_interval` and the ends of its interval; none where it is unknown."""
    interval = depth_interval(setup, values)
    if interval is None:
        return ()
    name, end = "distance from the camera", "end of the 90 % interval"
    return (
        Measure(name, interval.mean, "m"),
        Measure(f"{name}, lower {end}", interval.low, "m"),
        Measure(f"{name}, upper {end}", interval.high, "m"),
    )


def depth_spread(setup: Setup, view: View, values: Values) -> tuple[float, float, float]:
    """The distance in m of a body's root in one view, at `values`; its standard deviation by
    Laplace; and what an offset of 1 m in each direction, as standard deviation of each typical
    landmark by itself, adds to that in quadrature.
    """
    body, camera, keypoints = setup.body, view.camera, _keypoints_of(setup, view)
    assert body is not None
    assert keypoints is not None
    names = [block.name for block in body.blocks()]
    numbers = [values[name] for name in names]
    axis = matrix_from_vector(values[camera.rotation.name])[2]
    gradient = np.zeros(setup.problem.free.size)
    for i, name in enumerate(names):
        steps, ends = DIFFERENCE_STEP * np.eye(numbers[i].size).reshape(-1, *numbers[i].shape), []
        for step in (steps, -steps):
            moved = [*numbers[:i], numbers[i] + step, *numbers[i + 1 :]]
            ends.append(body.joints(moved[0], moved[1], moved[2])[:, 0] @ axis)
        gradient[setup.problem.free.slices[name]] = (ends[0] - ends[1]) / (2 * DIFFERENCE_STEP)
    depth = float(camera.depths(body.joints(*numbers)[:1], values)[0])
    here = setup.problem.linearize(values)
    by_data = here.covariance @ gradient
    px = float(np.mean(values[camera.focal.name])) / depth  # of 1 m
    rows = here.dense[setup.problem.rows[keypoints.name]]
    lever = px / float(keypoints.sigma) * float(np.linalg.norm(rows @ by_data))
    return depth, float(np.sqrt(gradient @ by_data)), lever


def _keypoints_of(setup: Setup, view: View) -> Residual | None:
    """The residual of the keypoints of a view, or None if the problem has none of its name."""
    name = f"keypoints({view.camera.prefix.rstrip('/')})"
    return next((residual for residual in setup.problem.residuals if residual.name == name), None)


@dataclass(frozen=True, eq=False)
class ImageMean:
    """The expected body of a fit to images, beside the likeliest one.

    Attributes:
        values: all blocks, with the mean of what is free.
        names: the landmarks (M,) of the body.
        landmarks: (M, 3) m their places on the body of the means.
        sd: (M,) m the standard deviations of their distances from there, once the middle of all
            landmarks of a draw is brought to that of the mean (see `SPREAD_NOTE`).
        moved: how far that middle is from the one of the likeliest body, in m.
        apart: (M,) m how far landmarks are from those of the likeliest body, about their middles.
        error: the standard error of the mean place, from the number of draws, in m.
        draws: how many there were.
    """

    values: Values = field(repr=False)
    names: tuple[str, ...] = field(repr=False)
    landmarks: Array = field(repr=False)
    sd: Array = field(repr=False)
    moved: float
    apart: Array = field(repr=False)
    error: float
    draws: int


def image_mean(setup: Setup, values: Values) -> ImageMean:
    """Draw about `values`, the solution of a fit to images, and take the mean of the draws.

    Raises what `posterior_mean` raises.
    """
    body = setup.body
    assert body is not None  # which every fit to images has
    posterior = posterior_mean(setup.problem, values)
    kind = setup.views[0].landmarks
    blocks = [block.name for block in body.blocks()]
    fixed = setup.problem.split(values)[1]
    drawn = [setup.problem.values(x, fixed) for x in posterior.draws]
    places = body.landmark(kind, *(np.array([draw[name] for draw in drawn]) for name in blocks))
    mean, likeliest = (
        body.landmark(kind, *(point[name] for name in blocks))
        for point in (posterior.values, values)
    )
    return ImageMean(
        posterior.values,
        tuple(body.landmark_names(kind)),
        mean,
        np.sqrt(np.sum((_centred(places) - _centred(mean)) ** 2, axis=2).mean(axis=0)),
        float(np.linalg.norm(mean.mean(axis=0) - likeliest.mean(axis=0))),
        np.linalg.norm(_centred(mean) - _centred(likeliest), axis=1),
        float(np.linalg.norm(setup.problem.free.unpack(posterior.error, values)[blocks[2]])),
        len(posterior.draws),
    )


def _centred(places: Array) -> Array:
    return np.asarray(places - places.mean(axis=-2, keepdims=True))
