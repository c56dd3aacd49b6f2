"""SMPL, SCAPE and BlendSCAPE trained on the same registrations."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Index
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.studies.pages import Report
from workbench.studies.triangles.people import TriangleData
from workbench.training.blend_shapes import RidgeChoice
from workbench.training.blocks import BLOCKS, QUICK, REACH, BlockInput, Plan, alternation
from workbench.training.estimate import Estimate, Sigmas
from workbench.training.execution import BlockLines
from workbench.training.objective import Objective
from workbench.training.pose_training import PoseModel, train_poses
from workbench.training.registrations import InMemory, training_and_held_out
from workbench.training.training import train
from workbench.training.triangles.alternation import QUICK as QUICK_BLOCKS
from workbench.training.triangles.alternation import (
    AnyBody,
    TriangleEstimate,
    TriangleOptions,
    choose_ridge,
    train_triangles,
)

SMPL, SCAPE, BLEND_SCAPE = "SMPL", "SCAPE", "BlendSCAPE"
LBS = "linear blend skinning"


def near(sigmas: Sigmas) -> Plan:
    """The plan of `workbench train`, where blend shapes depend on the joints near a vertex."""
    return alternation(sigmas, reach=REACH)


@dataclass(frozen=True)
class TrainingOptions:
    """How SMPL is trained, and how the triangle models are.

    Attributes:
        plan: SMPL's training for given sigmas.
        sigmas: those of E_P that are tried, m per unit of feature.
        triangles: how long and with which ridges triangle models are trained.
    """

    plan: Callable[[Sigmas], Plan] = near
    sigmas: tuple[float, ...] = (0.003, 0.006, 0.01, 0.02)
    triangles: TriangleOptions = QUICK_BLOCKS


@dataclass(frozen=True, eq=False)
class TrainedModels:
    """All models, each also without what it learned of pose.

    Attributes:
        models: by name.
        training_rms: mm, of the training meshes, where each subject has a shape of their own.
        choices: how strongly the part of each model that depends on pose was held: the sigma of
            E_P in m, or the ridge of E_Q in m^2.
    """

    models: dict[str, AnyBody]
    training_rms: dict[str, float]
    choices: dict[str, RidgeChoice]

    @property
    def smpl(self) -> SkinnedBody:
        """The trained SMPL."""
        found = self.models[SMPL]
        assert isinstance(found, SkinnedBody)
        return found

    @property
    def rigid(self) -> TriangleBody:
        """SCAPE without a learned Q: every part turns rigidly."""
        found = self.models[without_bends(SCAPE)]
        assert isinstance(found, TriangleBody)
        return found


def without_bends(name: str) -> str:
    """The name of a triangle model whose Q is the identity."""
    return f"{name}, Q = I"


def train_models(
    data: TriangleData, n_betas: int, report: Report, options: TrainingOptions
) -> TrainedModels:
    """Train SMPL by the training pipeline, and the others from where it ended by their own blocks.

    SCAPE and BlendSCAPE compare vertices about their mean, as SMPL does.
    """
    report("choosing how freely SMPL's blend shapes follow the pose")
    start = data.start
    choices = {SMPL: choose_sigma(data, options)}
    report("training SMPL")
    plan = options.plan(Sigmas(posedirs=choices[SMPL].chosen))
    trained = train(
        data.posed,
        start,
        multi_shape=data.standing,
        plan=plan,
        n_betas=n_betas,
        report=BlockLines(report),
    )
    smpl = trained.body
    training_rms = {SMPL: _mm(trained.poses.objective, trained.poses.estimate)}
    models: dict[str, AnyBody] = {LBS: replace(smpl, posedirs=0 * smpl.posedirs), SMPL: smpl}
    for name, untrained in ((SCAPE, scape(smpl)), (BLEND_SCAPE, blend_scape(smpl))):
        report(f"choosing {name}'s ridge")
        begun = TriangleEstimate.begin(untrained, trained)
        choices[name] = choose_ridge(begun, data.posed, options.triangles)
        report(f"training {name}")
        end = train_triangles(
            begun,
            data.standing,
            data.posed,
            n_betas=n_betas,
            ridge=choices[name].chosen,
            options=options.triangles,
        )
        training_rms[name] = 1e3 * end.fits(data.posed).rms(data.posed.vertices)
        models[without_bends(name)] = replace(end.body, posedirs=0 * end.body.posedirs)
        models[name] = end.body
    return TrainedModels(models, training_rms, choices)


def choose_sigma(data: TriangleData, options: TrainingOptions) -> RidgeChoice:
    """The sigma of E_P, chosen by validation on some of the subjects.

    After the first stages of training, blend shapes are learned from the other subjects with each
    sigma. The poses of those held out are then found anew; their rest shapes stay as they were.
    """
    posed, start = data.posed, data.start
    plan = options.plan(Sigmas())
    first = train_poses(posed, start, replace(plan, stages=plan.stages[:2]))
    kept, back = training_and_held_out(posed.subject)
    left = []
    for sigma in options.sigmas:
        objective, estimate = _some(first, posed, kept, sigma)
        given = BlockInput(objective, start.faces, QUICK)
        learned = BLOCKS["surfaces"](given, estimate).estimate
        objective, estimate = _some(first, posed, back, sigma)
        bent = replace(estimate, posedirs=learned.posedirs)
        given = BlockInput(objective, start.faces, QUICK)
        found = BLOCKS["poses"](given, bent).estimate
        left.append(_mm(objective, found))
    return RidgeChoice(options.sigmas, tuple(left))


def _some(
    model: PoseModel, posed: InMemory, rows: Index, sigma: float
) -> tuple[Objective, Estimate]:
    """Objective and estimate of some registrations alone, with the sigma of E_P."""
    who, subject = np.unique(posed.subject[rows], return_inverse=True)
    own, found = InMemory(posed.vertices[rows], subject), model.estimate
    estimate = replace(
        found, poses=found.poses[rows], templates=found.templates[who], joints=found.joints[who]
    )
    return replace(model.objective, registrations=own, sigmas=Sigmas(posedirs=sigma)), estimate


def _mm(objective: Objective, estimate: Estimate) -> float:
    """The rms distance of a vertex, mm."""
    return 1e3 * float(np.sqrt(3)) * objective.rms(estimate)
