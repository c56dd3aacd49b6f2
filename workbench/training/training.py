"""Registrations in, a body out."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.bodies import SkinnedBody
from workbench.threads import limited_threads
from workbench.training.carrying import train_coarse_first
from workbench.training.crew import Crew, Hands, alone
from workbench.training.first_guess import Start
from workbench.training.joint_regressor import JointRegressor
from workbench.training.plan import Plan, alternation
from workbench.training.pose_training import SILENT, PoseModel, Report
from workbench.training.registrations import Registrations
from workbench.training.shape_training import Shapes, learn_shapes, start_shape

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Trained:
    """A body, and all that was found on the way to it."""

    body: SkinnedBody
    poses: PoseModel
    regressor: JointRegressor
    shapes: Shapes | None


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
    crew: Crew = alone,
) -> Trained:
    """A body from some people in many poses and, if there are, many people in one.

    `start` is a template cut into segments. Without `multi_shape` the shape directions are those
    of the subjects themselves, at most one less than they are. With a `folder` the run can be
    killed at any time and goes on from there. A mesh of very many vertices is trained on some of
    them first. Raises NotLowered, NoMirror or BadFile.
    """
    chosen = alternation() if plan is None else plan
    model = train_coarse_first(multi_pose, start, chosen, folder=folder, report=report, crew=crew)
    with limited_threads():
        body, regressor = start_shape(model, start, n_betas)
        shapes = None
        if multi_shape is not None:
            mirror = model.objective.held_even
            shapes = learn_shapes(
                body,
                multi_shape,
                n_betas=n_betas,
                mirror=mirror,
                rounds=shape_rounds,
                hands=Hands(crew, partial(report.part, "shapes")),
            )
            body = replace(body, template=shapes.space.template, shapedirs=shapes.space.shapedirs)
    facts = card_of(model, regressor, shapes, chosen) | (card or {})
    return Trained(replace(body, card=facts), model, regressor, shapes)


def card_of(
    model: PoseModel, regressor: JointRegressor, shapes: Shapes | None, plan: Plan
) -> dict[str, Any]:
    """What a trained body says about itself, from the run's own numbers."""
    registrations = model.objective.registrations
    estimate, sigmas = model.estimate, model.objective.sigmas
    worst = max([regressor.kkt, *(e.facts["kkt"] for e in model.log if "kkt" in e.facts)])
    said: dict[str, Any] = {
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
        said["explained_variance_cumulative"] = [round(float(x), 5) for x in cumulative]
    return said
