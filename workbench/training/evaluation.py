"""How well a body explains people and poses that it was not trained on.

`evaluate_held_out` allows each held-out person a rest shape of their own: half of a person's
registrations show it, with the body's posedirs, weights and regressor held; in the other half
only poses are fitted, and the errors of these registrations count.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument, some
from workbench.geometry.mirror import Mirror, opposites
from workbench.training.blocks import BLOCKS, BlockInput, BlockOptions
from workbench.training.estimate import Estimate, Sigmas
from workbench.training.execution import SERIAL, Execution
from workbench.training.first_guess import Start, first_estimate, first_poses
from workbench.training.folder import FolderRegistrations
from workbench.training.objective import Objective
from workbench.training.registrations import (
    Registrations,
    RegistrationSubset,
    check_registrations,
    in_memory,
)
from workbench.training.shape_training import unposed_people, unposing_jobs

CARD = "made.json"  # beside registrations that were made up: how they were made
SHAPE_STEPS = 4  # of Gauss-Newton for a held-out person's rest shape and poses
POSE_ROUNDS = 4  # of fitting the poses of the registrations that count
REGRESSOR_SIGMA = 0.0005  # m: how far joints may be from the regressor's


@dataclass(frozen=True, eq=False)
class HeldOutEvaluation:
    """Held-out people, explained by a body.

    Attributes:
        distances: (J, N) m, from each vertex of every second registration of each person.
        templates: (S, N, 3) in metres, the people's rest shapes.
        shape_explained: the share of the rest shapes' variance that shapedirs explain.
    """

    distances: Array
    templates: Array
    shape_explained: float


def evaluate_held_out(
    body: SkinnedBody, registrations: Registrations, execution: Execution = SERIAL
) -> HeldOutEvaluation:
    """Fit rest shapes to every second registration of each person, and poses to the others.

    Raises BadArgument for a person of fewer than two registrations, see `check_held_out`.
    """
    check_held_out(registrations, body.n_vertices)
    mirror = None
    if body.mirror is not None:
        mirror = Mirror(body.mirror, opposites(body.joint_names))
    shape_set, pose_set = _halves(registrations)
    start, R = Start.of(body), body.J_regressor
    sigmas = Sigmas(rings=REGRESSOR_SIGMA)
    options = BlockOptions(
        linear_tolerance=1e-3,
        products=60,
        together_steps=SHAPE_STEPS,
        pose_vertices=body.n_vertices,
    )

    def first_of(some: Registrations) -> Estimate:
        first = first_estimate(some, start, weights=body.weights, rings=R)
        return replace(first_poses(first, some, start, execution=execution), posedirs=body.posedirs)

    def objective(some: Registrations) -> Objective:
        return Objective(some, R, body.weights, mirror, sigmas, body.template)

    def after(some: Registrations, estimate: Estimate, blocks: tuple[str, ...]) -> Estimate:
        context = BlockInput(objective(some), body.faces, options, execution)
        for name in blocks:
            estimate, _ = BLOCKS[name](context, estimate)
        return estimate

    templates = after(shape_set, first_of(shape_set), ("rest", "poses", "people")).templates
    joints = np.stack([R @ T for T in templates])
    known = replace(first_of(pose_set), templates=templates, joints=joints)
    fitted = after(pose_set, known, POSE_ROUNDS * ("poses",))
    distances = vertex_distances(objective(pose_set), fitted)
    return HeldOutEvaluation(distances, templates, shape_share(body, templates))


def _halves(registrations: Registrations) -> list[Registrations]:
    """Every second registration of each subject from the first one on, and the others."""
    rows = np.arange(len(registrations.subject))
    sorted_rows = np.argsort(registrations.subject, kind="stable")
    counts = np.bincount(registrations.subject)
    place = np.empty_like(rows)  # of each registration among those of its subject
    place[sorted_rows] = rows - np.repeat(np.cumsum(counts) - counts, counts)
    return [
        in_memory(RegistrationSubset(registrations, rows[place % 2 == half])) for half in (0, 1)
    ]


def vertex_distances(objective: Objective, estimate: Estimate) -> Array:
    """How far each vertex of the registrations is from an estimate of them, (J, N) m."""
    return np.concatenate([np.linalg.norm(r, axis=2) for _, _, r in objective.residuals(estimate)])


def check_held_out(registrations: Registrations, n_vertices: int) -> None:
    """Raise BadArgument unless every held-out person has two registrations or more."""
    check_registrations(registrations, n_vertices)
    single = np.flatnonzero(np.bincount(registrations.subject) < 2)
    if len(single):
        people = [f"subject {s}" for s in single]
        if isinstance(registrations, FolderRegistrations):
            people = [registrations.subjects[s] for s in single]
        raise BadArgument(
            "a held-out person needs two registrations in poses, one for the rest shape and one "
            f"to measure; there is only one of {some(people)}"
        )


def shape_share(body: SkinnedBody, people: Array) -> float:
    """The share of the squared distances of people (S, N, 3) from the template that shapedirs
    explain, wherever the people stand; 1 where nothing is to be explained.
    """
    away = people - body.template
    away = (away - away.mean(axis=1, keepdims=True)).reshape(len(people), -1)
    S = body.shapedirs - body.shapedirs.mean(axis=0, keepdims=True)
    Q, _ = np.linalg.qr(S.reshape(away.shape[1], -1))
    whole = np.sum(away**2)
    return float(np.sum((away @ Q) ** 2) / whole) if whole else 1.0


def shapes_explained(
    body: SkinnedBody, registrations: Registrations, execution: Execution = SERIAL
) -> dict[str, float]:
    """The entries of a model card about held-out people in one pose.

    They are brought into the rest pose in the same way as the people in the training.
    """
    work = partial(unposed_people, body, 1.0)
    results = execution.executor(work, unposing_jobs(registrations))
    people = np.concatenate([rest for _, rest in results])
    return {
        "people_in_one_pose": len(people),
        "their_shape_variance_explained": round(shape_share(body, people), 5),
    }


def held_out_errors(
    body: SkinnedBody, registrations: Registrations, execution: Execution = SERIAL
) -> dict[str, float]:
    """The entries of a model card about held-out people in poses, in mm.

    The errors are those of the body with its pose blend shapes, and without them.
    """
    blended = evaluate_held_out(body, registrations, execution)
    rigid = replace(body, posedirs=np.zeros_like(body.posedirs))
    rigid_distances = evaluate_held_out(rigid, registrations, execution).distances
    mean, rms = mean_and_rms(blended.distances)
    rigid_mean, rigid_rms = mean_and_rms(rigid_distances)
    return {
        "registrations": len(blended.distances),
        "people_in_poses": len(blended.templates),
        "mean_mm": mean,
        "rms_mm": rms,
        "mean_without_posedirs_mm": rigid_mean,
        "rms_without_posedirs_mm": rigid_rms,
        "shape_variance_explained": round(blended.shape_explained, 5),
    }


def mean_and_rms(distances: Array) -> tuple[float, float]:
    """The mean and the root mean square of distances in m, in mm to a ten-thousandth."""
    mean, rms = distances.mean(), np.sqrt(np.mean(distances**2))
    return round(1e3 * float(mean), 4), round(1e3 * float(rms), 4)
