"""The training of a body from registrations."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from workbench.blocks.checks import above_zero, from_zero
from workbench.bodies import SkinnedBody
from workbench.threads import limited_threads
from workbench.training.blocks import Plan, alternation
from workbench.training.execution import SILENT, Execution, Executor, Report
from workbench.training.first_guess import Start
from workbench.training.pose_training import PoseModel, train_coarse_first
from workbench.training.registrations import Registrations, check_registrations
from workbench.training.shape_training import ShapeModel, learn_shapes, start_shape
from workbench.training.shares import JointRegressor


@dataclass(frozen=True, eq=False)
class Trained:
    """The result of training.

    Attributes:
        body: the trained body, with its model card.
        poses: what was learned from the multi-pose set.
        regressor: the joint regressor, and how well it fits.
        shapes: what was learned from the multi-shape set; None without one.
    """

    body: SkinnedBody
    poses: PoseModel
    regressor: JointRegressor
    shapes: ShapeModel | None


def train(
    multi_pose: Registrations,
    start: Start,
    *,
    multi_shape: Registrations | None = None,
    plan: Plan | None = None,
    n_betas: int = 10,
    shape_rounds: int = 2,
    folder: Path | None = None,
    report: Report = SILENT,
    card: dict[str, Any] | None = None,
    executor: Executor = map,
) -> Trained:
    """Train a body from a few people in many poses and, if given, many people in one pose.

    `start` is a template divided into segments. Without `multi_shape`, the shape directions are
    those of the subjects themselves, at most one fewer than there are subjects, so that a body of
    one subject has none. The plan `without_blend_shapes` leaves pose blend shapes out. With a
    `folder`, the run can be killed at any time, and continues from there. A mesh of very many
    vertices is trained on some of them first. `executor` runs the fits of poses, in this process
    as `map` does, or in several by `Processes`. Raises BadArgument for registrations that do not
    fit the start and for no rounds, NotLowered, NoMirror or BadFile.
    """
    from_zero("training", n_betas=n_betas)
    above_zero("training", shape_rounds=shape_rounds)
    check_registrations(multi_pose, len(start.template))
    if multi_shape is not None:
        check_registrations(multi_shape, len(start.template))
    chosen = alternation() if plan is None else plan
    execution = Execution(executor, report)
    model = train_coarse_first(multi_pose, start, chosen, folder=folder, execution=execution)
    with limited_threads():
        body, regressor = start_shape(model, start, n_betas)
        shapes = None
        if multi_shape is not None:
            shapes = learn_shapes(
                body,
                multi_shape,
                n_betas=n_betas,
                mirror=model.objective.active_mirror,
                rounds=shape_rounds,
                execution=execution,
            )
            body = replace(body, template=shapes.space.template, shapedirs=shapes.space.shapedirs)
    facts = card_of(model, regressor, shapes, chosen) | (card or {})
    return Trained(replace(body, card=facts), model, regressor, shapes)


def card_of(
    model: PoseModel, regressor: JointRegressor, shapes: ShapeModel | None, plan: Plan
) -> dict[str, Any]:
    """The model card of a trained body, from the numbers of its training."""
    registrations = model.objective.registrations
    estimate, sigmas = model.estimate, model.objective.sigmas
    worst = max([regressor.kkt, *(e.facts["kkt"] for e in model.log if "kkt" in e.facts)])
    card: dict[str, Any] = {
        "trained_on": {
            "registrations": len(registrations.subject),
            "subjects": len(estimate.templates),
            "people_for_shape": 0 if shapes is None else len(shapes.people),
        },
        "training_rms_mm_per_coordinate": round(1e3 * model.objective.rms(estimate), 4),
        "final_costs": {k: float(f"{v:.6g}") for k, v in model.log[-1].after.items()},
        "lambdas": {k: float(f"{v:.6g}") for k, v in sigmas.lambdas.items()},
        "weights_per_vertex": int((estimate.weights > 0).sum(axis=1).max()),
        "worst_kkt": float(f"{worst:.2g}"),
        "J_regressor_rms_mm": [round(1e3 * float(r), 4) for r in regressor.rms],
        "blocks": ", ".join(entry.block for entry in model.log),
        "blend_shapes_reach_bones": "all" if plan.reach is None else plan.reach,
    }
    if shapes is not None:
        cumulative = np.cumsum(shapes.space.explained)
        card["explained_variance_cumulative"] = [round(float(x), 5) for x in cumulative]
    return card
