"""SMPL, SCAPE and BlendSCAPE on the same synthetic people, from seeds to numbers."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_skinned
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.geometry.triangles import soup
from workbench.studies.pages import Report
from workbench.studies.triangles.explained_variance import (
    ExplainedVariance,
    explained_by_triangles,
    explained_by_vertices,
    explained_gradients,
)
from workbench.studies.triangles.measures import (
    HeldOutFits,
    Timing,
    additivity_gap,
    n_parameters,
    n_seams,
    seam_jump,
    timing,
)
from workbench.studies.triangles.models import (
    BLEND_SCAPE,
    SCAPE,
    SMPL,
    TrainedModels,
    TrainingOptions,
    train_models,
)
from workbench.studies.triangles.people import (
    People,
    TriangleData,
    TrianglePlan,
    read_people,
    register,
)
from workbench.training.blend_shapes import RidgeChoice
from workbench.training.triangles.alternation import AnyBody

SHOWN = (SMPL, SCAPE, BLEND_SCAPE)
DIFFICULT, APART = 5, 0.25  # poses that are drawn; their least rms distance, rad per joint


@dataclass(frozen=True)
class ModelResult:
    """The numbers of one model; distances are in mm, and pose and shape of every mesh were unknown.

    Attributes:
        model: its name.
        parameters: the number of trained parameters.
        training_rms: of the training meshes; None for a model that is not trained by itself.
        rest_rms: of held-out people at rest; None where it was not measured.
        rms: of held-out people in held-out poses.
        mean: the mean distance of the same meshes.
        largest: the largest distance of the same meshes.
        seam_jump: rms jump of the deformation where parts meet, in those poses.
        gap: rms of shape and pose together minus each alone, on the unposed surface, see
            `additivity_gap`.
    """

    model: str
    parameters: int
    training_rms: float | None
    rest_rms: float | None
    rms: float
    mean: float
    largest: float
    seam_jump: float
    gap: float


@dataclass(frozen=True, eq=False)
class ShapeDirections:
    """What the first k shape directions explain, k = 0, 1, ...

    Attributes:
        training: by "vertices" and "triangles", of the training people.
        held_out: likewise, of the held-out people.
        gradients: shares of the variance of the training people's gradients.
    """

    training: Mapping[str, ExplainedVariance]
    held_out: Mapping[str, ExplainedVariance]
    gradients: Array

    @property
    def leads(self) -> Array:
        """How much more of the training people vertices explain than triangles, k = 1, 2, ..."""
        v, t = (self.training[name].share for name in ("vertices", "triangles"))
        return np.asarray((v - t)[1:])


@dataclass(frozen=True, eq=False)
class TriangleStudy:
    """All that was measured.

    Attributes:
        plan: what was asked for.
        test_poses: which poses were tested on, in words.
        faces: (F, 3), of the mesh.
        shapes: what shape directions explain.
        results: of every model.
        true_seam_jump: the jump of the test meshes themselves.
        n_seams: how many pairs of neighbouring faces are of different parts.
        choices: by model, how strongly the pose-dependent part was regularized.
        timings: of the models shown, on their mesh and on the full one.
        smpl: the trained SMPL.
        poses: (H, K, 3) in radians, difficult test poses.
        difficult: by model, the fits in those.
        torn: by stage of SCAPE, the corners of its triangles (F, 3, 3) in metres.
    """

    plan: TrianglePlan
    test_poses: str
    faces: Index
    shapes: ShapeDirections
    results: tuple[ModelResult, ...]
    true_seam_jump: float
    n_seams: int
    choices: Mapping[str, RidgeChoice]
    timings: tuple[Timing, ...]
    smpl: SkinnedBody
    poses: Array
    difficult: Mapping[str, HeldOutFits]
    torn: Mapping[str, Array]

    def result(self, model: str) -> ModelResult:
        """The result of the model of that name."""
        return next(one for one in self.results if one.model == model)


def triangle_study(
    plan: TrianglePlan, folder: Path, mocap: Path | None, report: Report
) -> TriangleStudy:
    """Read people, train the models, and measure them.

    Without a recording they are tested on further draws of the pose prior.
    """
    people = read_people(plan, folder, load_skinned(plan.body))
    return compare_models(plan, register(plan, people, mocap), report, TrainingOptions())


def compare_models(
    plan: TrianglePlan, data: TriangleData, report: Report, options: TrainingOptions
) -> TriangleStudy:
    """Train the models on the given data, and measure them."""
    trained = train_models(data, plan.betas, report, options)
    smpl, test = trained.smpl, data.test
    report("shape directions")
    shapes = explain(data.people)
    fits = {}
    for name, model in trained.models.items():
        report(f"fitting {name} to held-out people in held-out poses")
        fits[name] = HeldOutFits.of(model, smpl, test.vertices)
    part = trained.rigid.weights.toarray().argmax(axis=1)
    difficult = difficult_poses(test.poses)
    report("measuring times")
    return TriangleStudy(
        plan,
        data.test_poses,
        smpl.faces,
        shapes,
        tuple(measured(name, trained, data, fits[name], part) for name in fits),
        seam_jump(smpl.template, smpl.faces, part, test.vertices),
        n_seams(smpl.faces, part),
        trained.choices,
        tuple(timings(plan.body, trained.models)),
        smpl,
        test.poses[difficult],
        {name: fits[name].only(difficult) for name in SHOWN},
        stages(trained.rigid, test.poses[difficult[0]]),
    )


def explain(people: People) -> ShapeDirections:
    """The variance that both kinds of directions explain, of training and of held-out people."""
    training, faces = people.training, people.body.faces
    most = len(training) - 1
    own, others = (
        {
            "vertices": explained_by_vertices(training, most, whom),
            "triangles": explained_by_triangles(training, faces, most, whom),
        }
        for whom in (None, people.held_out)
    )
    return ShapeDirections(own, others, explained_gradients(training, faces, most))


def measured(
    name: str, trained: TrainedModels, data: TriangleData, fits: HeldOutFits, part: Index
) -> ModelResult:
    """One model in numbers; `part` (F,) is the part of each face of SCAPE."""
    model, smpl, found = trained.models[name], trained.smpl, fits.fits
    gaps = [additivity_gap(model, *at) for at in zip(found.poses, found.betas, strict=True)]
    at_rest = data.people.held_out
    return ModelResult(
        name,
        n_parameters(model),
        trained.training_rms.get(name),
        1e3 * HeldOutFits.of(model, smpl, at_rest).errors.rms if name in SHOWN else None,
        1e3 * fits.errors.rms,
        1e3 * fits.errors.mean,
        1e3 * fits.errors.largest,
        seam_jump(smpl.template, smpl.faces, part, found.surfaces),
        1e3 * float(np.sqrt(np.mean(np.sum(np.square(gaps), axis=-1)))),
    )


def difficult_poses(poses: Array) -> list[int]:
    """The numbers of at most five of the poses (M, K, 3) rad: those that turn joints most.

    No two of them are alike.
    """
    chosen: list[int] = []
    for i in np.argsort(-np.linalg.norm(poses, axis=2).sum(axis=1)):
        away = [np.sqrt(np.mean(np.sum((poses[i] - poses[j]) ** 2, axis=1))) for j in chosen]
        if min(away, default=np.inf) > APART:
            chosen.append(int(i))
    return chosen[:DIFFICULT]


def stages(body: TriangleBody, pose: Array) -> dict[str, Array]:
    """The template's triangles, deformed one by one, and stitched: (F, 3, 3) m each."""
    X = body.deformations(pose, np.zeros(body.n_betas))
    return {
        "template": body.template[body.faces],
        "rigid parts, torn": soup(body.template, body.faces, X),
        "stitched": body.vertices(pose)[body.faces],
    }


def timings(mesh: str, models: Mapping[str, AnyBody]) -> list[Timing]:
    """The times of the trained models, and of untrained models on the full mesh."""
    found = [timing(mesh, name, models[name]) for name in SHOWN]
    full = load_skinned("full")
    made: dict[str, AnyBody] = {SMPL: full, SCAPE: scape(full), BLEND_SCAPE: blend_scape(full)}
    return found + [timing("full", name, made[name]) for name in SHOWN]
