"""Training of the embedded bodies: neutral, female and male ones on each mesh.

Sets are made for `default`, and a body is trained from them. The same people in the same poses
on the meshes of `small` and `full` begin where that ended: their poses are known, and what is
left are templates, weights and blend shapes of more, or fewer, vertices. Female, male and
neutral bodies share what has to do with pose, learned from everybody; template, shape
directions and joint regressor are of their own people.

Training lets every vertex depend a little on every joint: on what the poses have in common, and on
errors that one pose passes on to another. A body that is published needs neither. With everything
else held, the errors of skinning, un-posed, are regressed on the joints within `REACH` bones of
those that move a vertex, as if every registration had a mirror image too (`local_posedirs`).
"""

import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from builder.base_mesh import read_topology
from builder.ground_truth import best_linear, ideal_skinning_errors, read_ground_truth
from builder.population import SEARCH_RADIUS, Sources
from builder.ridge import Pair, RidgeSums, ridge_learned
from builder.sets import ABOUT, BODY, SetRecipe, make_sets, recipe_text, regress
from builder.stored import BuiltBody, TrainedOn, card_of, write_body
from builder.training import BlockLines, training_and_held_out
from lectures.material.teacher import at_most_four
from workbench.arrays import Array, Index, Mask
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import read_embedded
from workbench.bodies.forward.posing import unpose
from workbench.errors import BadBody, BadFile
from workbench.geometry.mirror import Mirror
from workbench.reading.arrays import doubles, open_arrays, read_expected, texts
from workbench.threads import limited_threads
from workbench.training.blend_shapes import local_features
from workbench.training.blocks import REACH, alternation
from workbench.training.checkpoint import fingerprint
from workbench.training.estimate import Estimate, SkinningPass
from workbench.training.evaluation import CARD, held_out_errors, shapes_explained
from workbench.training.execution import Execution, Processes
from workbench.training.first_guess import Start, read_start
from workbench.training.folder import FolderRegistrations, open_folder
from workbench.training.objective import Objective, centred
from workbench.training.pose_training import PoseModel, finishing, train_poses, upsampled
from workbench.training.registrations import RegistrationSubset, batches
from workbench.training.shape_training import (
    UnposingJob,
    about_root,
    learn_shape_space,
    learn_shapes,
    unposing_jobs,
)
from workbench.writing import replacing

RIDGES = (1e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)  # per pose
GENDERS = {"": "neutral", "-female": "female", "-male": "male"}
N_BETAS = 10


@dataclass(frozen=True, eq=False)
class PoseParts:
    """What female, male and neutral bodies of one mesh have in common."""

    start: Start
    mirror: Mirror
    estimate: Estimate  # weights and posedirs alike on both sides
    ridge: float


def pose_parts(model: PoseModel, start: Start) -> PoseParts:
    """Weights made even, then blend shapes learned with them. Raises BadBody without sides."""
    mirror = model.objective.active_mirror
    if mirror is None:
        raise BadBody("a body that is alike on both sides needs a mesh with sides")
    found = model.estimate
    weights = at_most_four((found.weights + mirror.weights(found.weights)) / 2, mirror.vertices)
    even = replace(found, weights=weights)
    posedirs, ridge = local_posedirs(model.objective, even, mirror)
    return PoseParts(start, mirror, replace(even, posedirs=posedirs), ridge)


def regressor_from(parts: PoseParts, subjects: Index) -> tuple[csr_array, Array]:
    """The joints of some subjects from their templates, and how far off each is, (K,) m rms."""
    people, joints = parts.estimate.templates[subjects], parts.estimate.joints[subjects]
    names, radius = parts.start.joint_names, SEARCH_RADIUS["joints"]
    rows = regress(people, joints, names, parts.mirror.vertices, radius)
    return csr_array(rows), regression_errors(rows, people, joints)


def regression_errors(regressor: Array, people: Array, points: Array) -> Array:
    """Root mean square distance of each regressed point from the true one, (M,) m."""
    away = np.einsum("mn,pnc->pmc", regressor, people, optimize=True) - points
    errors: Array = np.sqrt((away**2).sum(axis=2).mean(axis=0))
    return errors


def even_body(parts: PoseParts, people: Array, regressor: csr_array) -> tuple[SkinnedBody, Array]:
    """The body of people (P, N, 3) m, un-posed, with its explained variance."""
    space = learn_shape_space(people, parts.start.faces, parts.mirror, min(10, len(people) - 1))
    body = SkinnedBody(
        template=space.template,
        shapedirs=space.shapedirs,
        posedirs=parts.estimate.posedirs,
        J_regressor=regressor,
        weights=parts.estimate.weights,
        parents=parts.estimate.parents,
        faces=parts.start.faces,
        joint_names=parts.start.joint_names,
        mirror=parts.mirror.vertices,
        name="trained",
    )
    return body, space.explained


def local_posedirs(
    objective: Objective, estimate: Estimate, mirror: Mirror | None
) -> tuple[Array, float]:
    """Posedirs (N, 3, F) m, and the ridge, which is chosen on held-out subjects."""
    learned, held_out = (
        RidgeSums.of(errors_at_rest(objective, estimate, rows)).with_reflections(mirror)
        for rows in training_and_held_out(objective.registrations.subject)
    )
    support = local_features(estimate.weights, estimate.parents, REACH)
    posedirs, ridge = ridge_learned(learned, held_out, support, RIDGES)
    return (posedirs if mirror is None else (posedirs + mirror.posedirs(posedirs)) / 2), ridge


def errors_at_rest(objective: Objective, estimate: Estimate, rows: Index) -> Iterator[Pair]:
    """The pose features, and the un-posed errors of skinning."""
    own = replace(estimate, poses=estimate.poses[rows])
    bare = replace(own, posedirs=np.zeros_like(own.posedirs))
    for batch in batches(RegistrationSubset(objective.registrations, rows)):
        whole, passed = (SkinningPass.of(e, batch.some, batch.subject) for e in (own, bare))
        _, trans = centred(batch, batch.vertices - whole.points)
        away = (batch.vertices - trans[:, None] - passed.points) * (batch.confidence > 0)[..., None]
        yield passed.features, passed.at_rest(away)


@dataclass(frozen=True, eq=False)
class MeshResult:
    """What the other meshes take over from the first.

    Attributes:
        model: the training's result.
        parts: what the bodies of all genders have in common.
        people: (P, K, 3) in radians, the poses of the people in the multi-shape set.
    """

    model: PoseModel
    parts: PoseParts
    people: Array


class BodyBuilder:
    """Trains bodies and writes them to `out`; stopped, it goes on from what is in `work`.

    `recorded` are held-out poses (F, 24, 3) rad of people, or None for further draws.
    """

    def __init__(
        self,
        sources: Sources,
        keypoint_names: tuple[str, ...],
        work: Path,
        out: Path,
        recorded: Array | None,
        jobs: int,
    ) -> None:
        self.sources, self.work, self.out, self.recorded = sources, work, out, recorded
        self.keypoint_names = keypoint_names
        self.began = time.perf_counter()
        self.execution = Execution(Processes(jobs), BlockLines(self.say))

    def say(self, message: str) -> None:
        """Print a message after the seconds since the builder began."""
        print(f"{time.perf_counter() - self.began:6.1f} s  {message}", flush=True)

    def train(self, name: str, before: MeshResult | None = None) -> MeshResult:
        """All bodies of one mesh. Raises BadFile if `work` holds those of another recipe."""
        folder, recipe = self.work / name, SetRecipe(body=name)
        if not already_made(folder, recipe, self.recorded):
            make_sets(self.sources, recipe, folder, self.say, self.recorded)
        start = read_start(str(folder / "train" / "start.npz"))
        every = open_folder(folder / "train", len(start.template), start.faces)
        poses, shapes = every.only("poses"), every.only("shapes")
        run = self.work / f"run-{name}"
        run.mkdir(parents=True, exist_ok=True)
        plan, initial = alternation(reach=REACH), None
        if before is not None:
            plan = finishing(reach=REACH)
            initial = upsampled(before.model.estimate, before.parts.start, start)
        self.say(f"training {name}")
        model = train_poses(
            poses, start, plan, folder=run, execution=self.execution, initial=initial
        )
        with limited_threads():
            self.say("  blend shapes of few joints")
            parts = pose_parts(model, start)
            regressor, _ = regressor_from(parts, np.arange(len(parts.estimate.templates)))
            first, _ = even_body(parts, parts.estimate.templates, regressor)
            self.say("  un-posing people")
            known = before.people if before else self._poses_of(first, shapes, parts, run)
            each = self.execution.executor(partial(unposed, first), unposing_jobs(shapes, known))
            people = about_root(np.concatenate(list(each)), first.J_regressor)
            for ending, gender in GENDERS.items():
                if name != "small" or not ending:
                    self._write(f"{name}{ending}", gender, people, model, parts, poses, shapes)
        return MeshResult(model, parts, known)

    def _poses_of(
        self, body: SkinnedBody, shapes: FolderRegistrations, parts: PoseParts, run: Path
    ) -> Array:
        """Poses of people who nearly stand alike, found once and kept.

        A file that is damaged, or of other people, counts as none.
        """
        path, mark = run / "people.npz", fingerprint(shapes, parts.estimate, "poses of people")
        sizes = len(shapes.rows), body.n_joints, 3
        with suppress(BadFile), open_arrays(path) as archive:
            kept = read_expected(archive, {"mark": texts(), "poses": doubles(*sizes)})
            if str(kept["mark"]) == mark:
                return kept["poses"]
        found = learn_shapes(
            body, shapes, n_betas=N_BETAS, mirror=parts.mirror, execution=self.execution
        ).poses
        with replacing(path) as temporary, temporary.open("wb") as file:
            np.savez(file, mark=np.array(mark), poses=found)
        return found

    def _write(
        self,
        name: str,
        gender: str,
        people: Array,
        model: PoseModel,
        parts: PoseParts,
        poses: FolderRegistrations,
        shapes: FolderRegistrations,
    ) -> None:
        """Write the body of one gender: packed, measured, and packed again with its card."""
        mine, subjects = (_of(gender, those) for those in (shapes, poses))
        regressor, errors = regressor_from(parts, np.flatnonzero(subjects))
        body, explained = even_body(parts, people[mine], regressor)
        rows, off = self._keypoints(name.partition("-")[0])
        built = BuiltBody(
            template=body.template,
            shapedirs=body.shapedirs,
            posedirs=body.posedirs,
            J_regressor=regressor.toarray(),
            weights=body.weights,
            faces=body.faces,
            mirror=parts.mirror.vertices,
            keypoint_names=self.keypoint_names,
            keypoint_regressor=rows,
        )
        trial = self.work / f"{name}.npz"
        write_body(built, {}, trial)
        stored = read_embedded(trial)
        self.say(f"  {name}: fitting held-out people")
        held_out = self._held_out(name.partition("-")[0], gender, stored, parts.start)
        trained_on = TrainedOn(
            gender, int(subjects.sum()), int(mine.sum()), explained, errors, off, parts.ridge
        )
        path = self.out / f"{name}.npz"
        write_body(
            built, card_of(name, built, stored, model, trained_on, held_out, self.sources), path
        )
        trial.unlink()
        self.say(f"  wrote {path} ({path.stat().st_size / 1e6:.2f} MB): {held_out}")

    def _keypoints(self, mesh: str) -> tuple[Array, Array]:
        """Keypoints (M, N) from vertices of the people of the multi-shape set; m rms (M,)."""
        topology = read_topology(self.sources.wheel, mesh, self.sources.mesh)
        n = SetRecipe().people
        rest = topology.vertices(self.sources.population.vertices[:n])
        points, names = self.sources.population.keypoints[:n], self.keypoint_names
        rows = regress(rest, points, names, topology.mirror, SEARCH_RADIUS["keypoints"])
        return rows, regression_errors(rows, rest, points)

    def _held_out(self, mesh: str, gender: str, body: SkinnedBody, start: Start) -> dict[str, Any]:
        """The held-out errors of a body on people of its gender, as `workbench train` has them."""
        folder = self.work / mesh
        own = None if gender == "neutral" else gender
        held_out = open_folder(folder / "held_out", body.n_vertices, body.faces)
        found: dict[str, Any] = held_out_errors(body, held_out.only("poses", own), self.execution)
        found |= shapes_explained(body, held_out.only("shapes", own), self.execution)
        if own is None:
            poses = open_folder(folder / "train", body.n_vertices, body.faces).only("poses")
            linear = best_linear(read_ground_truth(folder / "train"), poses, start)
            truth = read_ground_truth(folder / "held_out")
            found |= ideal_skinning_errors(truth, held_out.only("poses"), start, linear)
        return found


def already_made(
    folder: Path,
    recipe: SetRecipe,
    recorded: Array | None,
    about: str | None = ABOUT,
    draws: str = BODY.draws,
) -> bool:
    """Whether both folders are there. Raises BadFile if they are of another recipe."""
    cards = [folder / name / CARD for name in ("train", "held_out")]
    if not all(card.is_file() for card in cards):
        return False
    for card in cards:
        text = card.read_text(encoding="utf-8", errors="replace")
        text = text.replace('"strangers":', '"held_out":')  # as the number was called before
        text = text.replace("python -m workbench.synthetic.sets", "python -m builder.sets")
        if text != recipe_text(recipe, recorded, about, draws):
            raise BadFile(
                f"{card} says that these sets were made otherwise; remove {folder} to make them "
                "anew, or choose another folder"
            )
    return True


def unposed(body: SkinnedBody, job: UnposingJob) -> Array:
    """People (c, N, 3) m at rest, every vertex of whom was scanned, from poses that are known."""
    batch, poses = job
    assert poses is not None  # they are known
    each = zip(poses, batch.vertices, strict=True)
    return np.stack([unpose(body, pose, V) for pose, V in each])


def _of(gender: str, those: FolderRegistrations) -> Mask:
    """Which subjects are of a gender, in the order in which they first appear."""
    genders = np.array(list({row.subject: row.gender for row in those.rows}.values()))
    every: Mask = (genders == gender) | (gender == "neutral")
    return every
