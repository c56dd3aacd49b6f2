"""Training of the embedded bodies: neutral, female and male ones on each mesh.

Sets are made for `default`, and a body is trained from them. The same people in the same poses
on the meshes of `small` and `full` begin where that ended: their poses are known, and what is
left are templates, weights and blend shapes of more, or fewer, vertices. Female, male and
neutral bodies share what has to do with pose, learned from everybody; template, shape
directions and joint regressor are of their own people.
"""

import time
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from builder.card import TrainedOn, card_of
from builder.packing import BuiltBody, write_body
from builder.regressors import regress
from builder.rigs import BODY
from builder.sets import ABOUT, SetRecipe, make_sets, recipe_text
from builder.symmetrize import PoseParts, even_body, pose_parts, regression_errors, regressor_from
from workbench.arrays import Array, Mask
from workbench.bodies import SkinnedBody
from workbench.bodies.files.embedded import read_embedded
from workbench.bodies.forward.posing import unpose
from workbench.errors import BadFile
from workbench.reading.arrays import doubles, open_arrays, read_expected, texts
from workbench.synthetic.ground_truth import CARD, read_ground_truth
from workbench.synthetic.ideal_skinning import best_linear, ideal_skinning_errors
from workbench.synthetic.population import SEARCH_RADIUS, Sources
from workbench.synthetic.topology import read_topology
from workbench.threads import limited_threads
from workbench.training.checkpoint import fingerprint
from workbench.training.evaluation import held_out_errors, shapes_explained
from workbench.training.executor import Execution, Processes
from workbench.training.first_guess import Start, read_start
from workbench.training.folder import FolderRegistrations, open_folder
from workbench.training.plan import REACH, alternation
from workbench.training.pose_training import PoseModel, train_poses
from workbench.training.progress import BlockLines
from workbench.training.shape_training import UnposingJob, about_root, learn_shapes, unposing_jobs
from workbench.training.upsampling import finishing, upsampled
from workbench.writing import replacing

GENDERS = {"": "neutral", "-female": "female", "-male": "male"}
N_BETAS = 10


@dataclass(frozen=True, eq=False)
class Known:
    """What the other meshes take over from the first.

    Attributes:
        model: the training's result.
        parts: what the bodies of all genders have in common.
        people: (P, K, 3) in radians, the poses of the people in the multi-shape set.
    """

    model: PoseModel
    parts: PoseParts
    people: Array


class Builder:
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

    def train(self, name: str, before: Known | None = None) -> Known:
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
        return Known(model, parts, known)

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
