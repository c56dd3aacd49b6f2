"""The problem of a body in photographs, made once for all photographs of the same kind."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks import Block, Points, Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.triangles import TriangleBody
from workbench.fitting.body_priors import usual_priors
from workbench.fitting.keypoint_precision import alike
from workbench.fitting.observations import Photograph, pinhole
from workbench.geometry.camera import Camera
from workbench.problem import Problem
from workbench.residuals import Residual, keypoints
from workbench.residuals.kernels import Kernel, quadratic

PLAIN, WITH_HANDS = "coco", "coco_with_hands"  # sets of landmarks
FOCAL_SIGMA = 0.3  # of log f, for a camera of unknown focal length
Kind = tuple[tuple[str, tuple[int, int] | None, bool], ...]  # of the photographs of one person
Relative = Callable[[Sequence[str]], Array]  # sigmas (M,) of keypoints compared with a typical one
Terms = Callable[[SkinnedBody | TriangleBody], Sequence[Residual]]


@dataclass(frozen=True, eq=False)
class KeypointProblem:
    """The problem of a body in photographs; what was observed is in fixed blocks.

    Photographs that differ in their keypoints and calibrations only have one and the same problem,
    with the functions that were derived for it; in a folder of a thousand images it is made once.

    Attributes:
        body: the body that is fitted.
        sigma: the standard deviation of a keypoint, in px: one, or one for each photograph.
        kernel: the robust kernel of keypoints.
        priors: the residuals of a body beside its keypoints.
        relative: the standard deviations of keypoints by name, in sigmas.
    """

    body: SkinnedBody | TriangleBody
    sigma: float | tuple[float, ...] = 4.0
    kernel: Kernel = quadratic
    priors: Terms = usual_priors
    relative: Relative = alike
    _made: dict[tuple[str, Kind], tuple[Problem, tuple[Camera, ...], tuple[str, ...]]] = field(
        default_factory=dict, init=False, repr=False
    )

    def of(
        self,
        photographs: Sequence[Photograph],
        held_out: Collection[str],
        landmarks: str | None = None,
    ) -> tuple[Problem, tuple[Camera, ...], tuple[str, ...]]:
        """The problem, a camera for each photograph, and the names of the priors.

        `landmarks` is the set of landmarks that are fitted; without it, it is `landmark_set`'s.
        Cameras of photographs that are held out are not among the problem's.
        """
        landmarks = landmark_set(self.body) if landmarks is None else landmarks
        kind = tuple(
            (p.name, p.size if p.K is None else None, p.name in held_out) for p in photographs
        )
        if (landmarks, kind) not in self._made:
            self._made[landmarks, kind] = self._make(landmarks, kind)
        return self._made[landmarks, kind]

    def _make(
        self, landmarks: str, kind: Kind
    ) -> tuple[Problem, tuple[Camera, ...], tuple[str, ...]]:
        body = self.body
        names = body.landmark_names(landmarks)
        pose, betas, trans = body.blocks()
        points = body.landmark_points(landmarks, pose.symbol, betas.symbol, trans.symbol)
        cameras = tuple(Camera(name + "/") for name, _, _ in kind)
        terms, priors, blocks = [], list(self.priors(body)), list[Block]()
        free = [pose.name, betas.name, trans.name]
        sigmas = self.sigma if isinstance(self.sigma, tuple) else (self.sigma,) * len(kind)
        for camera, sigma, (_, size, out) in zip(cameras, sigmas, kind, strict=True):
            if out:
                continue
            given = points, camera, names, sigma, self.kernel, self.relative(names)
            terms.append(camera_residual(*given)[0])
            blocks += camera.blocks
            if size is not None:
                priors.append(focal_prior(camera, max(size)))
                free.append(camera.focal.name)
        problem = Problem([*terms, *priors], free, blocks=blocks)
        return problem, cameras, tuple(prior.name for prior in priors)


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

    These are `observed` (M, 2) px and `confidence` (M,), whose square is the residual's weight.
    `relative` (M,) are the keypoints' standard deviations in sigmas, all 1 if they are not given;
    the weight is divided by their squares.
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
