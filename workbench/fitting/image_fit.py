"""A body on the keypoints of one image: the setup, and the stages and starts that solve it.

How an image is fitted is a recipe, as data (`image_recipe`): terms, sigmas, stages, priors and a
solver. Lengths in px are proportional to the height of the person in the image. What a camera
observed is in fixed blocks, so that images of one kind share one problem with its derived functions
(`keypoint_problem`). A fit begins at what a small network reads off the keypoints
(`regressed_start`), and further hypotheses at the resting body and at turned ones. The `strategy`
of the setup makes the whole solver of the one that the user named.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.fitting.depth_interval import FOUND, depth_measures
from workbench.fitting.image_recipe import Appearance, ByHeight, ImageRecipe, Recipe
from workbench.fitting.image_starts import image_starts
from workbench.fitting.keypoint_problem import KeypointProblem
from workbench.fitting.keypoints import LEAST_CONFIDENCE, height_in_view, keypoint_setup
from workbench.fitting.observations import Observations
from workbench.fitting.setup import Setup
from workbench.residuals.kernels import geman_mcclure, scaled
from workbench.solvers import Solver, Staged, Starts

SUSPECT = 1 / 7  # of a person's height in the image
STEP = 1.25  # heights in an image are rounded to powers of it, so that images share problems


@dataclass(frozen=True, eq=False)
class ImageFits:
    """Fits of a body to single images by a recipe; what images have in common is made once.

    Attributes:
        body: the body that is fitted.
        recipe: how it is fitted, by the appearance of the person.
    """

    body: SkinnedBody | TriangleBody
    recipe: Recipe = field(default_factory=ByHeight)
    _made: dict[Appearance, tuple[ImageRecipe, KeypointProblem]] = field(
        default_factory=dict, init=False, repr=False
    )

    @cached_property
    def _placing(self) -> KeypointProblem:
        """The problem of those setups that only say where the torso was seen."""
        return KeypointProblem(self.body)

    def setup(
        self,
        observations: Observations,
        question: str,
        *,
        hypotheses: int = 1,
        held_out: Sequence[str] = (),
        reference: Array | None = None,
        compared: tuple[str, ...] = (),
    ) -> Setup:
        """Pose, betas and trans of the body from the keypoints of one image.

        The `strategy` of the setup takes the stages of the recipe, from `hypotheses` starts (see
        `image_starts`). Its measures tell the distance from the camera with its 90 % interval (see
        `depth_interval`). Other arguments and errors are those of `keypoint_fit`.
        """
        given = observations, question, held_out, reference, compared
        placed = keypoint_setup(self._placing, *given)
        starts = image_starts(self.body, placed, hypotheses)
        first = placed.start | starts[0]
        recipe, of = self._for(appearance(placed, first))
        setup = replace(keypoint_setup(of, *given), start=first)
        cameras = [name for name in setup.problem.rows if name.startswith("keypoints(")]

        def strategy(solver: Solver | None) -> Solver:
            staged = Staged(recipe.stages_of(cameras, solver), solver or recipe.solver)
            return staged if len(starts) == 1 else Starts(starts, staged)

        plain = replace(setup, strategy=strategy)
        if sum(not view.held_out for view in plain.views) != 1:
            return plain
        return replace(
            plain,
            measures=lambda values: (*plain.measures(values), *depth_measures(plain, values)),
            notes=(*plain.notes, FOUND),
        )

    def _for(self, person: Appearance) -> tuple[ImageRecipe, KeypointProblem]:
        """The recipe and the problem for a person who looks nearly like this."""
        step = round(float(np.log(max(person.height, 1.0)) / np.log(STEP)))
        nearly = Appearance(STEP**step, person.suspect)
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
    recipe: Recipe | None = None,
    hypotheses: int = 1,
    held_out: Sequence[str] = (),
    reference: Array | None = None,
    compared: tuple[str, ...] = (),
) -> Setup:
    """Pose, betas and trans of a body from the keypoints of one image, as SMPLify does.

    The setup's `strategy` is how it is solved: in stages, from `hypotheses` starts. To fit many
    images, make one `ImageFits`. `reference` is as for `keypoint_fit`. Raises
    BadObservation if the keypoints cannot place the body.
    """
    fits = ImageFits(body, recipe or ByHeight())
    return fits.setup(
        observations,
        question,
        hypotheses=hypotheses,
        held_out=held_out,
        reference=reference,
        compared=compared,
    )


def appearance(setup: Setup, values: Values) -> Appearance:
    """How high a person at the depth of a start would be in the image, and whether some keypoint
    is suspect: farther from the start's than a seventh of that height.
    """
    view = next(view for view in setup.views if not view.held_out)
    body = setup.body
    assert body is not None
    found = body.landmark(view.landmarks, *(values[block.name] for block in body.blocks()))
    height = height_in_view(body, view, values)
    off = np.linalg.norm(view.camera.pixels(found, values) - view.observed, axis=1)
    suspect = (off > SUSPECT * height) & (view.confidence > LEAST_CONFIDENCE)
    return Appearance(height, bool(suspect.any()))
