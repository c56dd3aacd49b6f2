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
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import embedded_body
from workbench.errors import BadFile
from workbench.reading.archive import open_arrays
from workbench.reading.expected import doubles, read_expected, texts
from workbench.threads import limited_threads
from workbench.training.carrying import carried_over, finishing
from workbench.training.checkpoint import fingerprint
from workbench.training.crew import Hands, Processes
from workbench.training.embedded.card import TrainedOn, card_of
from workbench.training.embedded.evening import PoseParts, even_body, pose_parts, regressor_from
from workbench.training.embedded.packing import BuiltBody, write_body
from workbench.training.embedded.regressors import regress, regression_errors
from workbench.training.embedded.sources import SEARCH_RADIUS, Sources
from workbench.training.embedded.topology import read_topology
from workbench.training.first_guess import Start, read_start
from workbench.training.folder import FolderRegistrations, open_folder
from workbench.training.plan import REACH, alternation
from workbench.training.pose_training import PoseModel, Progress, train_poses
from workbench.training.sets import SetRecipe, already_made, make_sets_of
from workbench.training.shape_training import learn_shapes, unposed_at
from workbench.training.strangers import (
    best_linear,
    shapes_explained,
    standing,
    standing_when_told,
)
from workbench.training.truth import read_truth
from workbench.writing import replacing

Array = NDArray[np.float64]
GENDERS = {"": "neutral", "-female": "female", "-male": "male"}
N_BETAS = 10


@dataclass(frozen=True, eq=False)
class Known:
    """What the other meshes take over from the first."""

    model: PoseModel
    parts: PoseParts
    people: Array  # (P, K, 3) rad: the poses of those in the multi-shape set


class Builder:
    """Trains bodies and writes them to `out`; stopped, it goes on from what is in `work`.

    `recorded` are held-out poses (F, 24, 3) rad of people, or None for further draws.
    """

    def __init__(
        self, sources: Sources, work: Path, out: Path, recorded: Array | None, jobs: int
    ) -> None:
        self.sources, self.work, self.out, self.recorded = sources, work, out, recorded
        self.crew, self.began = Processes(jobs), time.perf_counter()
        self.hands = Hands(self.crew)

    def say(self, message: str) -> None:
        """With the time."""
        print(f"{time.perf_counter() - self.began:6.1f} s  {message}", flush=True)

    def block(self, progress: Progress) -> None:
        """A line."""
        entry = progress.entry
        self.say(
            f"  {progress.number}/{progress.of} {entry.block} {sum(entry.before.values()):.6g} -> "
            f"{sum(entry.after.values()):.6g}, {entry.seconds:.0f} s"
        )

    def part(self, doing: str, done: int, of: int) -> None:
        """Nothing: blocks are told."""

    def train(self, name: str, before: Known | None = None) -> Known:
        """All bodies of one mesh. Raises BadFile if `work` holds those of another recipe."""
        folder, recipe = self.work / name, SetRecipe(body=name)
        if not already_made(folder, recipe, self.recorded):
            make_sets_of(self.sources, recipe, folder, self.say, self.recorded)
        start = read_start(str(folder / "train" / "start.npz"))
        every = open_folder(folder / "train", len(start.template), start.faces)
        poses, shapes = every.only("poses"), every.only("shapes")
        run = self.work / f"run-{name}"
        run.mkdir(parents=True, exist_ok=True)
        plan, begun = alternation(reach=REACH), None
        if before is not None:
            plan = finishing(reach=REACH)
            begun = carried_over(before.model.estimate, before.parts.start, start)
        self.say(f"training {name}")
        model = train_poses(
            poses, start, plan, folder=run, report=self, crew=self.crew, begun=begun
        )
        with limited_threads():
            self.say("  blend shapes of few joints")
            parts = pose_parts(model, start)
            regressor, _ = regressor_from(parts, np.arange(len(parts.estimate.templates)))
            first, _ = even_body(parts, parts.estimate.templates, regressor)
            self.say("  un-posing people")
            known = before.people if before else self._poses_of(first, shapes, parts, run)
            people = unposed_at(first, shapes, known, self.hands)
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
            body, shapes, n_betas=N_BETAS, mirror=parts.mirror, hands=self.hands
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
        """The body of one gender: packed, measured as stored, and packed with its card."""
        mine, subjects = (_of(gender, those) for those in (shapes, poses))
        regressor, errors = regressor_from(parts, np.flatnonzero(subjects))
        body, explained = even_body(parts, people[mine], regressor)
        rows, off = self._keypoints(name.partition("-")[0])
        built = BuiltBody(
            template=body.template, shapedirs=body.shapedirs, posedirs=body.posedirs,
            J_regressor=regressor.toarray(), weights=body.weights, faces=body.faces,
            mirror=parts.mirror.vertices, keypoint_names=self.sources.keypoint_names,
            keypoint_regressor=rows,
        )  # fmt: skip
        trial = self.work / f"{name}.npz"
        write_body(built, {}, trial)
        stored = embedded_body(trial)
        self.say(f"  {name}: meeting strangers")
        met = self._standing(name.partition("-")[0], gender, stored, parts.start)
        told = TrainedOn(
            gender, int(subjects.sum()), int(mine.sum()), explained, errors, off, parts.ridge
        )
        path = self.out / f"{name}.npz"
        write_body(built, card_of(name, built, stored, model, told, met, self.sources), path)
        trial.unlink()
        self.say(f"  wrote {path} ({path.stat().st_size / 1e6:.2f} MB): {met}")

    def _keypoints(self, mesh: str) -> tuple[Array, Array]:
        """Keypoints (M, N) from vertices of the people of the multi-shape set; m rms (M,)."""
        topology = read_topology(self.sources.wheel, mesh, self.sources.mesh)
        n = SetRecipe().people
        rest = np.stack([topology.follows @ p for p in self.sources.population.vertices[:n]])
        points, names = self.sources.population.keypoints[:n], self.sources.keypoint_names
        rows = regress(rest, points, names, topology.mirror, SEARCH_RADIUS["keypoints"])
        return rows, regression_errors(rows, rest, points)

    def _standing(self, mesh: str, gender: str, body: SkinnedBody, start: Start) -> dict[str, Any]:
        """As `workbench train --held-out` says it, of strangers of the body's gender."""
        folder = self.work / mesh
        own = None if gender == "neutral" else gender
        strangers = open_folder(folder / "held_out", body.n_vertices, body.faces)
        met: dict[str, Any] = standing(body, strangers.only("poses", own), self.hands)
        met |= shapes_explained(body, strangers.only("shapes", own), self.hands)
        if own is None:
            poses = open_folder(folder / "train", body.n_vertices, body.faces).only("poses")
            linear = best_linear(read_truth(folder / "train"), poses, start)
            truth = read_truth(folder / "held_out")
            met |= standing_when_told(truth, strangers.only("poses"), start, linear)
        return met


def _of(gender: str, those: FolderRegistrations) -> NDArray[np.bool_]:
    """Which subjects, in the order in which they come first."""
    genders = np.array(list({row.subject: row.gender for row in those.rows}.values()))
    every: NDArray[np.bool_] = (genders == gender) | (gender == "neutral")
    return every
