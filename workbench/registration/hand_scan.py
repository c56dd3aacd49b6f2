"""A hand fitted to points of its surface, to its skeleton as well if there is one."""

from collections.abc import Callable
from dataclasses import replace

from numpy.typing import ArrayLike

from workbench.bodies import SkinnedBody
from workbench.fitting.hands import (
    SIGMA,
    checked_hand,
    hand_landmarks,
    hand_problem,
    hand_start,
)
from workbench.fitting.scans.scan import Scan
from workbench.registration.fit_stage import Progress
from workbench.registration.model_fit import ModelFit
from workbench.registration.recipe import HAND_RECIPE, Recipe
from workbench.residuals.kernels import Kernel, quadratic
from workbench.solvers import TrustRegion


def fit_hand(
    body: SkinnedBody,
    scan: Scan,
    points: ArrayLike | None = None,
    *,
    sigma: float = SIGMA,
    kernel: Kernel = quadratic,
    recipe: Recipe = HAND_RECIPE,
    progress: Callable[[Progress], object] | None = None,
) -> ModelFit:
    """Find pose, betas and trans of a hand from a scan, with or without a skeleton; lengths in m.

    The energy is E_S + E_J + E_theta + E_beta + E_L: robust distances of the scan's points, each
    weighted by its area, squared distances of the skeleton's points, the priors on pose and shape,
    and what is beyond the limits of joints. The stages of the recipe lead from few points of the
    scan and a wide kernel to many and a narrow one. Without a skeleton the fit begins from all
    starts of the recipe, and with one where the hand is that fits the skeleton alone.

    `points` are (16, 3) in the order of the body's joints or (21, 3) in that of `HAND_POINTS`, NaN
    where one was not seen; `sigma` and `kernel` are theirs, along each axis. Raises BadBody for a
    body that is no hand, BadObservation for other points, and what `fit_model` raises.
    """
    checked_hand(body)
    others = []
    if points is not None:
        skeleton = hand_problem(body, sigma=sigma, kernel=kernel)
        end = TrustRegion().solve(skeleton, hand_start(body, points)).values
        own = {block.name: end[block.name] for block in body.blocks()}
        recipe = replace(recipe, starts=lambda body, scan: (own,))
        others = [hand_landmarks(body, points, sigma=sigma, kernel=kernel)]
    return recipe.fit(body, scan, others=others, progress=progress)
