"""How a body is fitted to the keypoints of one image: terms, stages and starts, as data.

SMPLify (Bogo et al., Keep it SMPL, 2016) has all of these: a robust reprojection error, priors on
pose and shape, a term against elbows and knees that bend backwards, and stages in which priors
count much at first. Its code multiplies residuals by weights: lambda_theta is 404, 404, 57.4 and
4.78 in its four stages, lambda_beta 100, 50, 10 and 5, and the term of the elbows and knees is
3.17 lambda_theta. Its prior on the pose is half a squared distance, its keypoints are whole
squares in px, and so lambda_theta = sqrt(2) sigma for our sigma of a keypoint in px.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadArgument
from workbench.fitting.body_priors import tailed_pose_prior, usual_priors
from workbench.fitting.keypoint_precision import alike, as_marked
from workbench.fitting.keypoint_problem import Relative, Terms
from workbench.fitting.stature import MEASURED, stature_prior
from workbench.residuals import Residual, bending
from workbench.residuals.numbers import HINGES
from workbench.solvers import LevenbergMarquardt, Solver, SolveStage

SIGMA = 0.004  # of a person's height in an image: 3 px in the recording on which it was chosen
KEYPOINTS = "keypoints"  # in the weights of a stage: those of every camera
LAMBDA_POSE = 404.0, 404.0, 57.4, 4.78
LAMBDA_SHAPE = 100.0, 50.0, 10.0, 5.0
ANGLES = 3.17  # SMPLify's weight of the term of elbows and knees, in lambda_theta
SMPLIFY_SIGMA = LAMBDA_POSE[-1] / float(np.sqrt(2))  # px

Recipe = Callable[["Appearance"], "ImageRecipe"]
COUNTED = 13.0  # numbers of a pose, by the Student's t: fewer than one image determines
ROUGHLY = LevenbergMarquardt(gradient_tolerance=0.01)  # of a stage that is only a start
NEARLY = LevenbergMarquardt(gradient_tolerance=1e-3)  # beyond, keypoints tell nothing more


def image_priors(body: SkinnedBody | TriangleBody) -> tuple[Residual, ...]:
    """Priors on pose and shape, and elbows and knees that do not bend backwards."""
    pose = body.blocks()[0]
    hinged = set(HINGES) & set(pose.labels or ())
    return (*usual_priors(body), *([bending(pose)] if hinged else []))


def tailed_priors(body: SkinnedBody | TriangleBody) -> tuple[Residual, ...]:
    """The same with a Student's t for the pose, of which 13 numbers count (`student_t`).

    At the fits to one image the data determine 18 to 20 of the 51: 51 less the trace of prior
    precision times Laplace's covariance. With 20, synthetic people are found better and real ones
    are not; 13 was chosen on tuning data of both kinds. A real person is found a little better than
    with the Gaussian, synthetic ones a little worse, and clearly worse where detections are grossly
    wrong, so that it is not the default (`benchmarks/IMAGES.md`). Take it with outliers that begin
    at 3.5 % of the height: `ByHeight(priors=tailed_priors, strict=0.035)`.
    """
    of_pose = tailed_pose_prior(body, COUNTED)
    return tuple(of_pose if one.name == of_pose.name else one for one in image_priors(body))


def smplify_priors(body: SkinnedBody | TriangleBody) -> tuple[Residual, ...]:
    """The same with the weights that SMPLify's code has in its last stage."""
    counts = {
        "shape prior": 2 * (LAMBDA_SHAPE[-1] / LAMBDA_POSE[-1]) ** 2,
        "bending": 2 * ANGLES**2,
    }
    priors = image_priors(body)
    return tuple(p.weighed(counts[p.name]) if p.name in counts else p for p in priors)


def wider(sigma: float, *wide: float, solver: Solver | None = None) -> tuple[SolveStage, ...]:
    """Stages in which keypoints have these larger sigmas in px, before the fit with `sigma`."""
    return tuple(SolveStage(weights={KEYPOINTS: (sigma / w) ** 2}, solver=solver) for w in wide)


def smplify_stages() -> tuple[SolveStage, ...]:
    """SMPLify's schedule: the place first, and then three stages before the last one."""
    last = LAMBDA_SHAPE[-1] / LAMBDA_POSE[-1]
    weights = [
        {KEYPOINTS: (LAMBDA_POSE[-1] / pose) ** 2, "shape prior": (shape / pose / last) ** 2}
        for pose, shape in zip(LAMBDA_POSE[:-1], LAMBDA_SHAPE[:-1], strict=True)
    ]
    return (SolveStage(("trans", "pose[pelvis]")), *(SolveStage(weights=w) for w in weights))


@dataclass(frozen=True)
class WithStature:
    """The priors of an image and a stature that was measured.

    Attributes:
        height: the stature in m.
        sigma: its standard deviation in m.
        priors: the other terms.
    """

    height: float
    sigma: float = MEASURED
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
        for name in ("sigma", "outlier"):
            if not 0 < getattr(self, name) < np.inf:
                raise BadArgument(f"{name} is a length in px above 0, not {getattr(self, name)!r}")

    def stages_of(self, cameras: Sequence[str], solver: Solver | None) -> tuple[SolveStage, ...]:
        """The stages of a problem with these residuals of cameras, by `solver` if there is one."""

        def spelled(stage: SolveStage) -> SolveStage:
            weights = dict(stage.weights)
            weight = weights.pop(KEYPOINTS, None)
            each = {} if weight is None else dict.fromkeys(cameras, weight)
            return replace(stage, weights=each | weights, solver=solver or stage.solver)

        return tuple(map(spelled, self.stages))


@dataclass(frozen=True)
class Appearance:
    """What is known of a person in an image before the fit.

    Attributes:
        height: how high the person would be in the image if they stood upright, in px.
        suspect: whether some keypoints lie far from where the start has them.
    """

    height: float
    suspect: bool = False


def smplify(person: Appearance) -> ImageRecipe:
    """SMPLify's own terms, weights and stages, whatever the person looks like."""
    stages = smplify_stages()
    return ImageRecipe(SMPLIFY_SIGMA, 100.0, smplify_priors, stages, LevenbergMarquardt())


@dataclass(frozen=True)
class ByHeight:
    """A recipe whose lengths grow with the height of the person in the image.

    Whether a keypoint is wrong, or the body still far from where it should be, is a matter of
    its distance compared with the person, not of px: 100 px are little for a person who fills a
    photograph, and half of one in its background.

    Attributes:
        sigma: the standard deviation of a keypoint, in px; without one, SIGMA times the height, as
            what detectors and people mark spreads in proportion to the person's size (Lin et al.,
            Microsoft COCO, 2014).
        outlier: from which distance on a coordinate counts as an outlier, as a share of the
            person's height in the image.
        strict: the same if some keypoints are suspected to be wrong already at the start.
        wide: the sigmas of keypoints in the stages before the last one, as such shares.
        priors: the residuals of a body beside its keypoints.
        solver: what solves the last stage; those before are solved roughly.
        relative: the standard deviations of keypoints by name, in sigmas.
    """

    sigma: float | None = None
    outlier: float = 0.08
    strict: float = 0.04
    wide: tuple[float, ...] = ()
    priors: Terms = image_priors
    solver: Solver = NEARLY
    relative: Relative = as_marked

    def __call__(self, person: Appearance) -> ImageRecipe:
        """The recipe for a person of this appearance."""
        height = person.height
        sigma = SIGMA * height if self.sigma is None else self.sigma
        stages = wider(sigma, *(share * height for share in self.wide), solver=ROUGHLY)
        outlier = height * (self.strict if person.suspect else self.outlier)
        return ImageRecipe(sigma, outlier, self.priors, stages, self.solver, self.relative)
