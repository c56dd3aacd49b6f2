"""The blocks of the alternation, each of which frees other names, and the plans that order them.

rest       templates and joints, the pose blend shapes held: a linear least-squares problem
poses      theta_j, one registration at a time (Levenberg-Marquardt on a Problem)
surfaces   templates, pose blend shapes and joints: one linear least-squares problem
weights    one vertex at a time: least squares over shares, at most four above zero
regressor  joints from templates: least squares over shares, one joint at a time
people     templates, joints and poses at once: Gauss-Newton steps in a trust region
together   all names at once: Gauss-Newton steps in a trust region
skinning   all names but the pose blend shapes, which are held, in the same way
skeleton   joints, poses and weights at once, in the same way
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf

import numpy as np

from workbench.arrays import Index
from workbench.errors import BadArgument, check_known
from workbench.training.estimate import NAMES, Estimate, Sigmas
from workbench.training.execution import SERIAL, Execution
from workbench.training.normal_equations import NormalEquations, steihaug
from workbench.training.objective import Objective, weight_grams
from workbench.training.poses import fitted_poses
from workbench.training.shares import MOST_WEIGHTS, few_shares, fit_joint_regressor
from workbench.training.subsampling import POSE_VERTICES, subsample

Facts = dict[str, float]  # of a block: numbers about how it found its estimate
REST = ("templates", "joints")
PEOPLE = ("templates", "joints", "poses")
SKELETON = ("joints", "poses", "weights")
SKINNING = ("templates", *SKELETON)
SURFACES = ("templates", "posedirs", "joints")
POSE_STEPS = 2  # of Levenberg-Marquardt in a round: the next round changes the model anyway
LARGEST_TURN = 0.3  # rad, of the first step: beyond, rotations are not nearly linear
GOOD_GAIN, POOR_GAIN = 0.75, 0.25  # above the one the region grows, below the other it shrinks
SMALLEST_RADIUS = 1e-8  # of the longest step: no further decrease is to be expected
NO_LIMIT = 10**6
ROUND = ("regressor", "surfaces", "poses")
REACH = 2  # bones between a vertex and the farthest joint that its blend shapes follow
ROUGH_FACTOR, TIED_FACTOR = 2.5, 0.2  # on the sigma of E_D at first, and on that of E_J later


@dataclass(frozen=True)
class BlockOptions:
    """When the inner iterations of a block may stop, and how many numbers it uses.

    Attributes:
        linear_tolerance: relative tolerance of the linear equations in the blocks `surfaces` and
            `rest`, measured by the preconditioned gradient.
        together_tolerance: the same for the blocks `together` and `people`.
        together_steps: the largest number of Gauss-Newton steps.
        together_stop: a step that lowers the cost by a smaller share is the last.
        enough: in metres; no step is made once the root mean square of E_D is below it.
        products: the largest number of passes over all registrations in one step.
        most_weights: the largest number of weights above zero per vertex.
        pose_vertices: how many vertices, spread over the mesh, poses are found from.
    """

    linear_tolerance: float = 1e-6
    together_tolerance: float = 1e-2
    together_steps: int = 10
    together_stop: float = 1e-3
    enough: float = 0.0
    products: int = 300
    most_weights: int = MOST_WEIGHTS
    pose_vertices: int = POSE_VERTICES


@dataclass(frozen=True, eq=False)
class BlockInput:
    """What a block is given besides the estimate.

    Attributes:
        objective: the cost to lower, with the registrations.
        faces: (F, 3) the triangles of the mesh.
        options: when the block stops.
        execution: runs the fits of poses, and reports the progress.
    """

    objective: Objective
    faces: Index
    options: BlockOptions = field(default_factory=BlockOptions)
    execution: Execution = SERIAL


def fit_poses(context: BlockInput, estimate: Estimate) -> tuple[Estimate, Facts]:
    """Fit each registration's pose to some vertices; keep it if all vertices fit worse then."""
    objective, options = context.objective, context.options
    template = estimate.templates.mean(axis=0) if objective.template is None else objective.template
    few = subsample(template, context.faces, options.pose_vertices)
    candidates = fitted_poses(
        few.estimate(estimate),
        few.registrations(objective.registrations),
        few.faces,
        objective.sigmas.data,
        POSE_STEPS,
        execution=context.execution,
    ).poses
    costs = objective.by_registration(replace(estimate, poses=candidates))
    better = costs < objective.by_registration(estimate)
    poses = np.where(better[:, None, None], candidates, estimate.poses)
    return replace(estimate, poses=poses), {"poses changed": float(better.mean())}


def fit_linear(
    names: tuple[str, ...], context: BlockInput, estimate: Estimate
) -> tuple[Estimate, Facts]:
    """Fit templates, joints and maybe pose blend shapes, in which the cost is quadratic.

    While poses are rough, blend shapes are left out: they would learn the errors of the poses,
    and then keep the poses wrong for many rounds.
    """
    objective, options = context.objective, context.options
    equations = NormalEquations(objective, estimate, names)
    step = steihaug(
        equations.product,
        equations.preconditioned,
        equations.negative_gradient,
        tolerance=options.linear_tolerance,
        most=options.products,
    )
    facts = {"products": float(step.iterations), "predicted": step.predicted}
    moved = estimate.moved(step.change)
    lower = objective.cost(moved) <= objective.cost(estimate)  # else the gradient was rounding
    return moved if lower else estimate, facts


def fit_regressor(context: BlockInput, estimate: Estimate) -> tuple[Estimate, Facts]:
    """Fit the joint regressor; from here on E_J compares joints with it, not with their rings."""
    objective = context.objective
    regressor = fit_joint_regressor(estimate.templates, estimate.joints, objective.rings)
    moved = replace(estimate, regressor=regressor.matrix)
    lower = objective.cost(moved) <= objective.cost(estimate)  # rings may reach farther than it
    return moved if lower else estimate, {"kkt": regressor.kkt}


def fit_weights(context: BlockInput, estimate: Estimate) -> tuple[Estimate, Facts]:
    """Each vertex's weights, exactly, as many above zero as the options allow.

    `kkt` is the worst residual of the conditions.
    """
    objective, options = context.objective, context.options
    grams, rights = weight_grams(objective, estimate)
    precision = objective.sigmas.weights**-2
    grams += precision * np.eye(grams.shape[1])
    rights += precision * objective.first_weights
    weights, kkt = few_shares(grams, rights, estimate.weights, options.most_weights)
    return replace(estimate, weights=weights), {"kkt": float(kkt.max())}


def fit_in_trust_region(
    names: tuple[str, ...], context: BlockInput, estimate: Estimate
) -> tuple[Estimate, Facts]:
    """Fit several names at once, poses among them, in a few steps within a trust region.

    Alternation needs thousands of rounds to undo a twist of all poses for which the pose blend
    shapes compensate; these steps need a few. Weights remain shares.
    """
    objective, options = context.objective, context.options
    cost, radius, longest = objective.cost(estimate), inf, 0.0
    facts = {"steps": 0.0, "products": 0.0}
    equations = NormalEquations(objective, estimate, names)
    done = options.together_steps == 0 or _exact(context, estimate)
    while not done:
        step = steihaug(
            equations.product,
            equations.preconditioned,
            equations.negative_gradient,
            radius=radius,
            tolerance=options.together_tolerance,
            most=options.products,
        )
        longest = max(longest, step.length)
        facts["products"] += step.iterations
        turned = float(np.abs(step.change["poses"]).max())
        if radius == inf and turned > LARGEST_TURN:
            radius = step.length * LARGEST_TURN / turned
            continue
        moved = estimate.moved(step.change)
        if "weights" in names:
            positive = moved.weights.clip(0)
            moved = replace(moved, weights=positive / positive.sum(axis=1, keepdims=True))
        fall = cost - objective.cost(moved)
        if fall > GOOD_GAIN * step.predicted and not step.inside:
            radius *= 2
        elif fall < POOR_GAIN * step.predicted:
            radius = step.length / 4
        if not fall > 0:
            done = radius <= SMALLEST_RADIUS * longest
            continue
        estimate, cost = moved, cost - fall
        equations = NormalEquations(objective, estimate, names)
        facts["steps"] += 1
        context.execution.finished(int(facts["steps"]), options.together_steps)
        settled = fall < options.together_stop * cost
        last = facts["steps"] == options.together_steps
        done = settled or last or _exact(context, estimate)
    return estimate, facts


def _exact(context: BlockInput, estimate: Estimate) -> bool:
    """Whether the data are explained well enough to stop."""
    enough = context.options.enough
    return enough > 0 and context.objective.rms(estimate) < enough


Block = Callable[[BlockInput, Estimate], tuple[Estimate, Facts]]
BLOCKS: dict[str, Block] = {
    "poses": fit_poses,
    "rest": partial(fit_linear, REST),
    "surfaces": partial(fit_linear, SURFACES),
    "regressor": fit_regressor,
    "weights": fit_weights,
    "people": partial(fit_in_trust_region, PEOPLE),
    "together": partial(fit_in_trust_region, NAMES),
    "skinning": partial(fit_in_trust_region, SKINNING),
    "skeleton": partial(fit_in_trust_region, SKELETON),
}


# For registrations with noise: digits that the next block changes are not worth their passes.
QUICK = BlockOptions(linear_tolerance=1e-4, together_tolerance=0.1, together_steps=3, products=40)


@dataclass(frozen=True)
class Stage:
    """Blocks that are run a number of times, with the same sigmas and options.

    Raises UnknownName for a block that is not in `BLOCKS`.

    Attributes:
        sigmas: the standard deviation of each term.
        blocks: the names of the blocks, in order.
        rounds: how often they are run.
        options: when the blocks stop.
    """

    sigmas: Sigmas
    blocks: tuple[str, ...]
    rounds: int = 1
    options: BlockOptions = field(default_factory=BlockOptions)

    def __post_init__(self) -> None:
        for block in self.blocks:
            check_known("block of training", block, BLOCKS)


@dataclass(frozen=True)
class Plan:
    """The plan of a training: its stages, in order. Raises BadArgument for one without a block.

    Attributes:
        stages: the stages.
        reach: the largest number of bones from a vertex to a joint that changes the surface there,
            see `blend_shapes.local_features`; None allows all joints.
    """

    stages: tuple[Stage, ...]
    reach: int | None = None

    def __post_init__(self) -> None:
        if not self.steps:
            raise BadArgument("a plan needs at least one block; `alternation()` is the usual plan")

    @property
    def steps(self) -> list[tuple[Stage, str]]:
        """All blocks in the order in which they run, each with its stage."""
        return [
            (stage, block)
            for stage in self.stages
            for _ in range(stage.rounds)
            for block in stage.blocks
        ]


def alternation(sigmas: Sigmas | None = None, rounds: int = 2, reach: int | None = None) -> Plan:
    """The alternation of the lectures, with all names at once near its end.

    First only templates and joints are fitted, with a larger sigma of the data: skinning without
    blend shapes cannot be right to millimetres. Blend shapes are added when poses are nearly
    right. Then, for a number of rounds, the joints are compared with the regressor that the body
    will have, and no longer with their rings. A vertex is bent by the joints within `reach`
    bones; None allows all joints, as in the paper.
    """
    last = ("together", "weights", "regressor", "surfaces", "poses", "regressor", "surfaces")
    stages = _alternating(sigmas, ("surfaces", "poses"), ROUND, rounds, last)
    return Plan(stages, reach)


def without_blend_shapes(rounds: int = 2) -> Plan:
    """The alternation without pose blend shapes: templates, joints, weights and poses alone.

    What skinning alone leaves of the data is then the cost, and not compensated by 9 (K - 1) free
    directions for every vertex: from registrations that linear blending explains, joints and
    weights are found that blend shapes would hide.
    """
    last = ("skinning", "weights", "regressor", "rest", "poses", "regressor", "rest")
    first, each = ("rest", "poses", "weights"), ("regressor", "rest", "poses")
    return Plan(_alternating(None, first, each, rounds, last))


def _alternating(
    sigmas: Sigmas | None,
    first: tuple[str, ...],
    each: tuple[str, ...],
    rounds: int,
    last: tuple[str, ...],
) -> tuple[Stage, ...]:
    """Templates and poses with a larger sigma of the data, the blocks `first`, and then, with
    joints tied to the regressor, rounds of `each`, and `last`.
    """
    sigmas = Sigmas() if sigmas is None else sigmas
    rough = replace(sigmas, data=ROUGH_FACTOR * sigmas.data)
    tied = replace(sigmas, rings=TIED_FACTOR * sigmas.rings)
    return (
        Stage(rough, ("rest", "poses"), 1, QUICK),
        Stage(sigmas, first, 1, QUICK),
        Stage(tied, each, rounds, QUICK),
        Stage(tied, last, 1, QUICK),
    )
