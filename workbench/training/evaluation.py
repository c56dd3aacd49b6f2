"""How well a body explains people and poses that it was not trained on.

`evaluate_held_out` allows each held-out person a rest shape of their own: half of a person's
registrations show it, with the body's posedirs, weights and regressor held; in the other half
only poses are fitted, and the errors of these registrations count.

The least errors that linear blend skinning can have are those of `ideal_skinning_errors`: it is
given the ground truth of synthetic registrations, alone and with the best linear predictor of blend
shapes, which is learned from the true un-posed errors.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument, BadFile, some
from workbench.geometry.mirror import Mirror, opposites
from workbench.reading.arrays import check_numbers, opened, read_expected, reals, wholes
from workbench.training.blend_shapes import Pair, RidgeSums, ridge_learned
from workbench.training.blocks import BLOCKS, BlockInput, BlockOptions
from workbench.training.estimate import Estimate, Sigmas, SkinningPass
from workbench.training.execution import SERIAL, Execution
from workbench.training.first_guess import Start, first_estimate, first_poses
from workbench.training.folder import FolderRegistrations
from workbench.training.objective import Objective
from workbench.training.registrations import (
    Registrations,
    RegistrationSubset,
    batches,
    check_registrations,
    in_memory,
    training_and_held_out,
)
from workbench.training.shape_training import unposed_people, unposing_jobs
from workbench.writing import write_arrays

FILE = "truth.npz"
CARD = "made.json"  # beside it: how the registrations were made
AT_REST = "people.npz"  # above both sets: everybody at rest, `train` and `held_out` (P, N, 3) m
EXPECTED = {
    "rest": reals("S", "N", 3),
    "joints": reals("S", "K", 3),
    "subject": wholes("J"),
    "poses": reals("J", "K", 3),
    "trans": reals("J", 3),
    "weights": reals("N", "K"),
}
STEPS = 4  # of Gauss-Newton for a held-out person's rest shape and poses
ROUNDS = 4  # of fitting the poses of the registrations that count
REGRESSED = 0.0005  # m: how far joints may be from the regressor's
RIDGES = (1e-3, 3e-3, 1e-2, 3e-2)  # per pose


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """S people in J poses, and the rig that linear blend skinning would use.

    Attributes:
        rest: (S, N, 3) m.
        joints: (S, K, 3) m.
        subject: (J,).
        poses: (J, K, 3) rad, the root's turn included.
        trans: (J, 3) m.
        weights: (N, K).
    """

    rest: Array
    joints: Array
    subject: Index
    poses: Array
    trans: Array
    weights: Array

    def save(self, folder: Path) -> None:
        """Write it as `truth.npz` into a folder."""
        arrays: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(self)}
        write_arrays(folder / FILE, arrays)


def read_ground_truth(folder: Path) -> GroundTruth:
    """Read the ground truth in a folder.

    Raises BadFile if there is none, because the registrations are not synthetic, or it is damaged.
    """
    path = folder / FILE
    if not path.is_file():
        raise BadFile(
            f"{path} does not exist: what these registrations were made from is not known; "
            "`python -m builder.sets`, in a checkout, makes registrations that come with it"
        )
    what = "record of what registrations were made from"
    with opened(path, what, "make them anew") as archive:
        arrays = read_expected(archive, EXPECTED)
        check_numbers("subject", arrays["subject"], len(arrays["rest"]))
    return GroundTruth(**arrays)


@dataclass(frozen=True, eq=False)
class VertexErrors:
    """Distances from registrations to the body fitted to them.

    Attributes:
        distances: (J, N) in metres, of each vertex of each registration.
    """

    distances: Array

    @property
    def mean(self) -> float:
        """The mean distance in metres."""
        return float(self.distances.mean())

    @property
    def rms(self) -> float:
        """The root mean square distance in metres."""
        return float(np.sqrt(np.mean(self.distances**2)))

    @property
    def largest(self) -> float:
        """The largest distance in metres."""
        return float(self.distances.max())


def errors_of(objective: Objective, estimate: Estimate) -> VertexErrors:
    """The distances of the registrations of an objective from an estimate of them."""
    distances = [np.linalg.norm(r, axis=2) for _, _, r in objective.residuals(estimate)]
    return VertexErrors(np.concatenate(distances))


@dataclass(frozen=True, eq=False)
class HeldOutEvaluation:
    """Held-out people, explained by a body.

    Attributes:
        errors: of every second registration of each person.
        templates: (S, N, 3) in metres, the people's rest shapes.
        shape_explained: the share of the rest shapes' variance that shapedirs explain.
    """

    errors: VertexErrors
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
    rows = np.arange(len(registrations.subject))
    sorted_rows = np.argsort(registrations.subject, kind="stable")
    counts = np.bincount(registrations.subject)
    place = np.empty_like(rows)  # of each registration among those of its subject
    place[sorted_rows] = rows - np.repeat(np.cumsum(counts) - counts, counts)
    shape_set, pose_set = (
        in_memory(RegistrationSubset(registrations, rows[place % 2 == half])) for half in (0, 1)
    )
    start, R = Start.of(body), body.J_regressor
    sigmas = Sigmas(rings=REGRESSED)
    options = BlockOptions(
        linear_tolerance=1e-3, products=60, together_steps=STEPS, pose_vertices=body.n_vertices
    )

    def first_of(some: Registrations) -> Estimate:
        first = first_estimate(some, start, weights=body.weights, rings=R)
        return replace(first_poses(first, some, start, execution=execution), posedirs=body.posedirs)

    def after(some: Registrations, estimate: Estimate, blocks: tuple[str, ...]) -> Estimate:
        objective = Objective(some, R, body.weights, mirror, sigmas, body.template)
        context = BlockInput(objective, body.faces, options, execution)
        for name in blocks:
            estimate = BLOCKS[name](context, estimate).estimate
        return estimate

    templates = after(shape_set, first_of(shape_set), ("rest", "poses", "people")).templates
    joints = np.stack([R @ T for T in templates])
    known = replace(first_of(pose_set), templates=templates, joints=joints)
    found = after(pose_set, known, ROUNDS * ("poses",))
    objective = Objective(pose_set, R, body.weights, mirror, sigmas, body.template)
    return HeldOutEvaluation(errors_of(objective, found), templates, shape_share(body, templates))


def check_held_out(registrations: Registrations, n_vertices: int) -> None:
    """Raise BadArgument unless every held-out person has two registrations or more."""
    check_registrations(registrations, n_vertices)
    single = np.flatnonzero(np.bincount(registrations.subject) < 2)
    if len(single):
        who = [f"subject {s}" for s in single]
        if isinstance(registrations, FolderRegistrations):
            who = [registrations.subjects[s] for s in single]
        raise BadArgument(
            "a held-out person needs two registrations in poses, one for the rest shape and one "
            f"to measure; there is only one of {some(who)}"
        )


def shape_share(body: SkinnedBody, people: Array) -> float:
    """The share of the squared distances of people (S, N, 3) from the template that shapedirs
    explain, wherever the people stand; 1 where nothing is to be explained.
    """
    away = people - body.template
    away = (away - away.mean(axis=1, keepdims=True)).reshape(len(people), -1)
    S = body.shapedirs - body.shapedirs.mean(axis=0, keepdims=True)
    Q, _ = np.linalg.qr(S.reshape(-1, body.n_betas))
    whole = np.sum(away**2)
    return float(np.sum((away @ Q) ** 2) / whole) if whole else 1.0


def shapes_explained(
    body: SkinnedBody, registrations: Registrations, execution: Execution = SERIAL
) -> dict[str, float]:
    """The entries of a model card about held-out people in one pose.

    They are brought into the rest pose in the same way as the people in the training.
    """
    work = partial(unposed_people, body, 1.0)
    found = execution.executor(work, unposing_jobs(registrations))
    people = np.concatenate([rest for _, rest in found])
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
    found = evaluate_held_out(body, registrations, execution)
    rigid = replace(body, posedirs=np.zeros_like(body.posedirs))
    errors, without = found.errors, evaluate_held_out(rigid, registrations, execution).errors
    return {
        "registrations": len(errors.distances),
        "people_in_poses": len(found.templates),
        "mean_mm": millimetres(errors.mean),
        "rms_mm": millimetres(errors.rms),
        "mean_without_posedirs_mm": millimetres(without.mean),
        "rms_without_posedirs_mm": millimetres(without.rms),
        "shape_variance_explained": round(found.shape_explained, 5),
    }


def millimetres(metres: float) -> float:
    """A length in millimetres, rounded to a ten-thousandth."""
    return round(1e3 * metres, 4)


def ideal_skinning_errors(
    truth: GroundTruth, registrations: Registrations, start: Start, posedirs: Array | None
) -> dict[str, float]:
    """The errors of ideal skinning in mm, as a model card lists them.

    They are those of linear blend skinning alone and, given `posedirs`, with these blend shapes.
    """
    alone = errors_of_ideal_skinning(truth, registrations, start)
    found = {
        "ideal_skinning_mean_mm": millimetres(alone.mean),
        "ideal_skinning_rms_mm": millimetres(alone.rms),
    }
    if posedirs is not None:
        best = errors_of_ideal_skinning(truth, registrations, start, posedirs)
        found |= {
            "ideal_linear_mean_mm": millimetres(best.mean),
            "ideal_linear_rms_mm": millimetres(best.rms),
        }
    return found


def ideal_skinning(
    truth: GroundTruth, parents: tuple[int, ...], posedirs: Array | None = None
) -> Estimate:
    """The estimate that training would have to find: the ground truth itself."""
    K, N = len(parents), truth.rest.shape[1]
    P = np.zeros((N, 3, 9 * (K - 1))) if posedirs is None else posedirs
    return Estimate(truth.rest, truth.joints, P, truth.weights, truth.poses, parents)


def errors_of_ideal_skinning(
    truth: GroundTruth, registrations: Registrations, start: Start, posedirs: Array | None = None
) -> VertexErrors:
    """The errors of linear blend skinning that is given the ground truth."""
    estimate = ideal_skinning(truth, start.parents, posedirs)
    held = Objective(registrations, start.rings(), truth.weights, None, Sigmas())
    return errors_of(held, estimate)


def best_linear(truth: GroundTruth, registrations: Registrations, start: Start) -> Array:
    """Posedirs (N, 3, F) by ridge regression of the true un-posed errors.

    The ridge is chosen by the errors on a fifth of the subjects, which is held out until then.
    """
    learned, held_out = (
        RidgeSums.of(_errors(truth, registrations, start, rows)).with_reflections(start.mirror())
        for rows in training_and_held_out(truth.subject)
    )
    whole = np.ones_like(learned.products[:, 0], dtype=bool)
    return ridge_learned(learned, held_out, whole, RIDGES)[0]


def _errors(
    truth: GroundTruth, registrations: Registrations, start: Start, rows: Index
) -> Iterator[Pair]:
    """Features, and what must be added at rest for skinning to be right."""
    estimate = replace(ideal_skinning(truth, start.parents), poses=truth.poses[rows])
    for batch in batches(RegistrationSubset(registrations, rows)):
        passed = SkinningPass.of(estimate, batch.some, batch.subject)
        away = batch.vertices - truth.trans[rows[batch.some], None] - passed.points
        yield passed.features, passed.at_rest(away)
