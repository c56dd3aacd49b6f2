"""The blocks of the alternation: each frees other names, and none lets the cost rise.

rest       templates and joints, the pose blend shapes held: a linear least-squares problem
poses      theta_j, one registration at a time (Levenberg and Marquardt on a Problem)
surfaces   templates, pose blend shapes and joints: one linear least-squares problem
weights    one vertex at a time: least squares over shares, at most four above zero
regressor  joints from templates: shares again, one joint at a time
cut        the largest four weights alone, where more were allowed before
people     templates, joints and poses at once: steps of Gauss and Newton in a trust region
together   all names: a step of Gauss and Newton within a trust region
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf

import numpy as np
from numpy.typing import NDArray

from workbench.training.conjugate_gradients import solve
from workbench.training.crew import ONE, Hands
from workbench.training.estimate import NAMES, Estimate
from workbench.training.first_guess import MOST_WEIGHTS, at_most
from workbench.training.joint_regressor import fit_joint_regressor
from workbench.training.normal_equations import NormalEquations
from workbench.training.objective import Objective
from workbench.training.poses import OnVertices, fitted_poses
from workbench.training.simplex import few_shares
from workbench.training.thinning import ENOUGH, thinned
from workbench.training.weight_grams import weight_grams

Array = NDArray[np.float64]
Index = NDArray[np.int64]
REST = ("templates", "joints")
PEOPLE = ("templates", "joints", "poses")
SURFACES = ("templates", "posedirs", "joints")
POSE_STEPS = 2  # of Levenberg and Marquardt in a round: the next round changes the model anyway
LARGEST_TURN = 0.3  # rad, of the first step: beyond, rotations are not nearly linear
GOOD, POOR = 0.75, 0.25  # shares of the predicted fall that let the region grow, and shrink
SMALLEST_RADIUS = 1e-8  # of the longest step: nothing more is to be had


@dataclass(frozen=True, eq=False)
class Found:
    """What a block left: the estimate, and what it has to say about how it got there."""

    estimate: Estimate
    facts: dict[str, float]


@dataclass(frozen=True)
class Effort:
    """When the inner iterations of a block may stop."""

    linear_tolerance: float = 1e-6  # of the equations of `surfaces`, on the preconditioned slope
    together_tolerance: float = 1e-2
    together_steps: int = 10  # of Gauss and Newton
    together_stop: float = 1e-3  # of the cost: a step that gains less is the last
    enough: float = 0.0  # m, rms of E_D: below it no step is made any more
    products: int = 300  # passes over all registrations, at most, in one step
    most_weights: int = MOST_WEIGHTS  # above zero, per vertex
    pose_vertices: int = ENOUGH  # spread over the mesh, that poses are found from


def fit_poses(
    objective: Objective, estimate: Estimate, faces: Index, effort: Effort, hands: Hands = ONE
) -> Found:
    """Each registration's pose, from vertices enough; where all of them say worse, it is kept."""
    template = estimate.templates.mean(axis=0) if objective.template is None else objective.template
    few = thinned(template, faces, effort.pose_vertices)
    found = fitted_poses(
        few.estimate(estimate),
        few.registrations(objective.registrations),
        few.faces,
        OnVertices(),
        objective.sigmas.data,
        POSE_STEPS,
        hands,
    ).poses
    fitted = objective.by_registration(replace(estimate, poses=found))
    better = fitted < objective.by_registration(estimate)
    poses = np.where(better[:, None, None], found, estimate.poses)
    return Found(replace(estimate, poses=poses), {"poses changed": float(better.mean())})


def fit_surfaces(
    objective: Objective, estimate: Estimate, faces: Index, effort: Effort, hands: Hands = ONE
) -> Found:
    """Templates, pose blend shapes and joints: the cost is a parabola in them."""
    return _linear(objective, estimate, effort, SURFACES)


def fit_rest(
    objective: Objective, estimate: Estimate, faces: Index, effort: Effort, hands: Hands = ONE
) -> Found:
    """Templates and joints alone.

    While poses are rough, blend shapes would learn what the poses have wrong, and then hold them
    to it for many rounds.
    """
    return _linear(objective, estimate, effort, REST)


def _linear(
    objective: Objective, estimate: Estimate, effort: Effort, names: tuple[str, ...]
) -> Found:
    equations = NormalEquations(objective, estimate, names)
    step = solve(
        equations.product,
        equations.preconditioned,
        equations.slope,
        tolerance=effort.linear_tolerance,
        most=effort.products,
    )
    facts = {"products": float(step.iterations), "predicted": step.predicted}
    moved = estimate.moved(step.change)
    if objective.cost(moved) > objective.cost(estimate):  # the slope was rounding
        return Found(estimate, facts)
    return Found(moved, facts)


def fit_regressor(
    objective: Objective, estimate: Estimate, faces: Index, effort: Effort, hands: Hands = ONE
) -> Found:
    """The joint regressor; from here on E_J holds joints to it instead of to their rings."""
    found = fit_joint_regressor(estimate.templates, estimate.joints, objective.rings)
    kept = replace(estimate, regressor=found.matrix)
    if objective.cost(kept) > objective.cost(estimate):  # rings may reach farther than it does
        return Found(estimate, {"kkt": found.kkt})
    return Found(kept, {"kkt": found.kkt})


def fit_weights(
    objective: Objective, estimate: Estimate, faces: Index, effort: Effort, hands: Hands = ONE
) -> Found:
    """Each vertex's weights, exactly, as many above zero as the effort allows.

    `kkt` is the worst residual of the conditions.
    """
    grams, rights = weight_grams(objective, estimate)
    precision = objective.sigmas.weights**-2
    grams += precision * np.eye(grams.shape[1])
    rights += precision * objective.first_weights
    weights, worst = np.empty_like(estimate.weights), 0.0
    for i, start in enumerate(estimate.weights):
        weights[i], kkt = few_shares(grams[i], rights[i], start, effort.most_weights)
        worst = max(worst, kkt)
    return Found(replace(estimate, weights=weights), {"kkt": worst})


def cut_weights(
    objective: Objective, estimate: Estimate, faces: Index, effort: Effort, hands: Hands = ONE
) -> Found:
    """The largest weights of each vertex alone: the one block that may let the cost rise.

    From here on fewer weights are allowed than before. On noiseless data the others are zero by
    then, and nothing changes.
    """
    weights = at_most(estimate.weights, effort.most_weights)
    change = float(np.abs(weights - estimate.weights).max())
    return Found(replace(estimate, weights=weights), {"largest change": change})


def fit_together(
    objective: Objective, estimate: Estimate, faces: Index, effort: Effort, hands: Hands = ONE
) -> Found:
    """All names at once, a few steps, each within a region where the linear model can be trusted.

    What alternation takes thousands of rounds for, a twist of all poses that the pose blend
    shapes make up for, this takes in a few steps. Weights stay shares.
    """
    return _trusted(objective, estimate, effort, NAMES, hands)


def fit_people(
    objective: Objective, estimate: Estimate, faces: Index, effort: Effort, hands: Hands = ONE
) -> Found:
    """Templates, joints and poses at once, as in `together`; blend shapes and weights are held."""
    return _trusted(objective, estimate, effort, PEOPLE, hands)


def _trusted(
    objective: Objective,
    estimate: Estimate,
    effort: Effort,
    names: tuple[str, ...],
    hands: Hands,
) -> Found:
    cost, radius, longest = objective.cost(estimate), inf, 0.0
    facts = {"steps": 0.0, "products": 0.0}
    while facts["steps"] < effort.together_steps and not _near(objective, estimate, effort):
        equations = NormalEquations(objective, estimate, names)
        slope = equations.slope
        while True:
            step = solve(
                equations.product,
                equations.preconditioned,
                slope,
                radius=radius,
                tolerance=effort.together_tolerance,
                most=effort.products,
            )
            longest = max(longest, step.length)
            facts["products"] += step.iterations
            turned = float(np.abs(step.change["poses"]).max())
            if radius == inf and turned > LARGEST_TURN:
                radius = step.length * LARGEST_TURN / turned
                continue
            moved = estimate.moved(step.change)
            if "weights" in names:
                moved = replace(moved, weights=_as_shares(moved.weights))
            fall = cost - objective.cost(moved)
            if fall > GOOD * step.predicted and not step.inside:
                radius *= 2
            elif fall < POOR * step.predicted:
                radius = step.length / 4
            if fall > 0:
                break
            if radius <= SMALLEST_RADIUS * longest:
                return Found(estimate, facts)
        estimate, cost = moved, cost - fall
        facts["steps"] += 1
        hands.say(int(facts["steps"]), effort.together_steps)
        if fall < effort.together_stop * cost:
            break
    return Found(estimate, facts)


def _near(objective: Objective, estimate: Estimate, effort: Effort) -> bool:
    """Whether the data are met as closely as was asked for, which takes a pass over them."""
    return effort.enough > 0 and objective.rms(estimate) < effort.enough


def _as_shares(weights: Array) -> Array:
    kept = weights.clip(0)
    return np.asarray(kept / kept.sum(axis=1, keepdims=True))


Block = Callable[[Objective, Estimate, Index, Effort, Hands], Found]
BLOCKS: dict[str, Block] = {
    "poses": fit_poses,
    "rest": fit_rest,
    "surfaces": fit_surfaces,
    "regressor": fit_regressor,
    "weights": fit_weights,
    "cut": cut_weights,
    "people": fit_people,
    "together": fit_together,
}
MAY_RISE = ("cut",)  # what is allowed shrinks there
