"""A body on the keypoints of one image: the setup, and the stages and starts that solve it."""

from collections.abc import Sequence
from dataclasses import replace

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.fitting.image_recipe import ImageRecipe
from workbench.fitting.keypoint_problem import KeypointProblem
from workbench.fitting.keypoints import keypoint_setup
from workbench.fitting.observations import Observations
from workbench.fitting.setup import Setup
from workbench.residuals.kernels import geman_mcclure, scaled
from workbench.solvers import Solver, Staged


def image_problem(
    body: SkinnedBody | TriangleBody, recipe: ImageRecipe | None = None
) -> KeypointProblem:
    """The problem of a recipe, to be made once for many images."""
    recipe = recipe or ImageRecipe()
    kernel = scaled(geman_mcclure, recipe.outlier / recipe.sigma)
    return KeypointProblem(body, recipe.sigma, kernel, recipe.priors)


def image_fit(
    observations: Observations,
    of: KeypointProblem,
    question: str,
    *,
    recipe: ImageRecipe | None = None,
    hypotheses: int = 1,
    held_out: Sequence[str] = (),
    reference: Array | None = None,
    compared: tuple[str, ...] = (),
) -> Setup:
    """Pose, betas and trans of a body from the keypoints of one image, by a recipe.

    `of` is the `image_problem` of the body and the recipe. The setup's `strategy` takes the stages
    of the recipe, from `hypotheses` starts. Other arguments and errors are those of `keypoint_fit`.
    """
    recipe = recipe or ImageRecipe()
    setup = keypoint_setup(of, observations, question, held_out, reference, compared)
    cameras = [name for name in setup.problem.rows if name.startswith("keypoints(")]

    def strategy(solver: Solver | None) -> Solver:
        return Staged(recipe.stages_of(cameras, solver), solver or recipe.solver)

    return replace(setup, strategy=strategy)
