"""How scans are registered: stages, starts and lengths as data, for people and for hands."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Mask
from workbench.blocks import Values
from workbench.blocks.checks import above_zero, from_zero
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.hands import is_hand
from workbench.fitting.hands import SIGMA, checked_hand, hand_landmarks, hand_problem, hand_start
from workbench.fitting.scans.scan import Scan
from workbench.registration.doubts import NEAR, Doubts
from workbench.registration.free_vertices import (
    BLOCKS,
    JOINT_SOLVER,
    MODEL_STAGES,
    QUICK_VERTEX_STAGES,
    VERTEX_STAGES,
    VERTICES,
    ScanTerm,
    VertexStage,
)
from workbench.registration.model_fit import (
    FIT_STAGES,
    SAME,
    SEEN_STAGES,
    WITHIN,
    FitProgress,
    FitStage,
    ModelFit,
    fit_model,
)
from workbench.registration.starts import hand_starts, scan_starts
from workbench.residuals import Residual
from workbench.residuals.kernels import Kernel, quadratic
from workbench.solvers import TrustRegion

PERSON = Doubts()
MODEL_HELD_ABOVE = 3_000  # vertices, from which on the model is held while vertices are free


@dataclass(frozen=True)
class Recipe:
    """How scans are registered. The lengths that are the defaults suit a whole person.

    Raises BadArgument for a width below zero, and for other lengths that are not above it.

    Attributes:
        fit_stages: the stages of the fit of the body, from coarse to fine.
        vertex_stages: the stages of free vertices that follow, none if the registration is the
            fitted model; None for those that suit the size of a person's mesh.
        boundary: in m; points of the scan as near as this to its boundary are left out. With 0
            all points are used.
        seed: of the points that the coarse stages draw.
        starts: where the fit of the body begins.
        within: in m; a point farther from the surface has no contact.
        same: in m, the mean distance of joints below which two ends are one.
        near: in m; a vertex without a touching point as near as this was not seen.
        doubts: from where on a fit is doubted.
        empty: whether the body is kept out of space that the camera of a scan saw to be empty;
            else only the doubts look at it.
        seen_stages: the stages of the fit of the body where the camera is known; None for those of
            every fit.
        others: further residuals of the fit of the body, such as those of a skeleton.
    """

    fit_stages: tuple[FitStage, ...] = FIT_STAGES
    vertex_stages: tuple[VertexStage, ...] | None = None
    boundary: float = 0.0
    seed: int = 0
    starts: Callable[[Body, Scan], Sequence[Values]] = scan_starts
    within: float = WITHIN
    same: float = SAME
    near: float = NEAR
    doubts: Doubts = PERSON
    empty: bool = True
    seen_stages: tuple[FitStage, ...] | None = None
    others: tuple[Residual, ...] = ()

    def stages_of_vertices(self, body: Body) -> tuple[VertexStage, ...]:
        """The stages of free vertices; none for triangle bodies, which have no such term.

        The model follows the vertices of bodies of up to 3,000 vertices. For larger ones it is
        held: to follow takes three times as long, and twice the memory (`benchmarks/DECISIONS.md`).
        """
        if not isinstance(body, SkinnedBody):
            return ()
        if self.vertex_stages is not None:
            return self.vertex_stages
        stages = VERTEX_STAGES if body.n_vertices <= MODEL_HELD_ABOVE else QUICK_VERTEX_STAGES
        return stages[len(MODEL_STAGES) :]

    def stages(self, seen: bool) -> tuple[FitStage, ...]:
        """The stages of the fit of the body; `seen` says whether the camera is known to it."""
        return self.seen_stages if seen and self.seen_stages is not None else self.fit_stages

    def __post_init__(self) -> None:
        from_zero("a recipe", boundary=self.boundary)
        above_zero("a recipe", within=self.within, same=self.same, near=self.near)

    def fit(
        self,
        body: Body,
        scan: Scan,
        *,
        keep: Mask | None = None,
        camera: ArrayLike | None = None,
        progress: Callable[[FitProgress], object] | None = None,
    ) -> ModelFit:
        """The body fitted to a scan by this recipe; see `fit_model`, also for what it raises."""
        return fit_model(
            body,
            scan,
            keep=keep,
            camera=camera,
            starts=self.starts,
            stages=self.stages(seen=camera is not None),
            within=self.within,
            same=self.same,
            others=self.others,
            seed=self.seed,
            progress=progress,
        )


PERSON_RECIPE = Recipe(seen_stages=SEEN_STAGES)
"""For a whole person."""

HAND_FIT_STAGES = (
    FitStage(200, 0.012, 0.030, 48, 15, 0.01),
    FitStage(800, 0.005, 0.015, 6, 30, 0.003),
    FitStage(1500, 0.003, 0.009, 2, 40, 0.0005),
)
HAND_TERM = ScanTerm(sigma=0.001, outlier=0.004, within=0.02, patch=1e-5)
HAND_VERTEX_STAGES = (VertexStage("free", (*BLOCKS, VERTICES), 0.001, HAND_TERM, JOINT_SOLVER),)


HAND_RECIPE = Recipe(
    fit_stages=HAND_FIT_STAGES,
    vertex_stages=HAND_VERTEX_STAGES,
    starts=hand_starts,
    within=0.06,
    same=0.004,
    near=0.006,
    doubts=Doubts(apart=0.006, rough=0.004, open=0.003, unusual=np.inf),
    empty=False,
)
"""For a hand alone, in metres as a person: a hand has no side that is usually up."""


def usual_recipe(body: Body) -> Recipe:
    """The recipe for scans of what a body is: a hand alone, or a whole person."""
    return HAND_RECIPE if is_hand(body) else PERSON_RECIPE


def with_skeleton(
    recipe: Recipe,
    body: Body,
    points: ArrayLike,
    *,
    sigma: float = SIGMA,
    kernel: Kernel = quadratic,
) -> Recipe:
    """The recipe for the scan of a hand of which points of the skeleton are known too.

    The energy is E_S + E_J + E_theta + E_beta + E_L: robust distances of the scan's points, each
    weighted by its area, squared distances of the skeleton's points, the priors on pose and shape,
    and what is beyond the limits of joints. The fit begins at the hand that fits the skeleton.
    `points` (m) are (16, 3) in the order of the body's joints or (21, 3) in that of `HAND_POINTS`,
    NaN where one was not seen; `sigma` in m and `kernel` are theirs, along each axis. Raises
    BadBody for a body that is no hand, and BadObservation for other points.
    """
    hand = checked_hand(body)
    skeleton = hand_problem(hand, sigma=sigma, kernel=kernel)
    end = TrustRegion().solve(skeleton, hand_start(hand, points)).values
    own = {block.name: end[block.name] for block in hand.blocks()}
    term = hand_landmarks(hand, points, sigma=sigma, kernel=kernel)
    return replace(recipe, starts=lambda body, scan: (own,), others=(*recipe.others, term))
