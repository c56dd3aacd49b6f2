"""The people on whom all models are trained and tested: at rest, in poses, and held out."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.priors.recordings import held_out_poses
from workbench.reading.arrays import any_reals, opened, read_expected
from workbench.synthetic.teacher import BODIES, Teacher, teacher_of
from workbench.training.evaluation import AT_REST
from workbench.training.first_guess import Start
from workbench.training.registrations import InMemory
from workbench.training.triangles.learning import PosedMeshes

RECORDED = "real poses, of clips of motion capture that nothing was learned from"
DRAWN = "further draws from the pose prior, which is a Gaussian: easier than real poses"

JITTER = 0.05  # rad, the standard deviation of every joint's rotation in the multi-shape set
MOVED = 0.5  # m on every axis: how far people stand from the origin


@dataclass(frozen=True)
class TrianglePlan:
    """How many people, poses and meshes the study takes.

    Raises BadArgument for counts with which it cannot be carried out.

    Attributes:
        body: the mesh, `small` or `default`.
        people: seen at rest, from whom shape is learned.
        subjects: how many of them, the first ones, are also seen in poses.
        poses: of each subject.
        held_out: further people, from whom nothing is learned.
        test: meshes of the held-out people in poses.
        betas: shape directions of the models that are posed.
        seed: of every draw.
    """

    body: str = "small"
    people: int = 200
    subjects: int = 10
    poses: int = 15
    held_out: int = 50
    test: int = 100
    betas: int = 10
    seed: int = 0

    def __post_init__(self) -> None:
        if self.body not in BODIES:
            raise BadArgument(f"there is no teacher of {self.body!r}, but of {', '.join(BODIES)}")
        if not 0 < self.betas < self.people:
            raise BadArgument(
                f"from {self.people} people at most {self.people - 1} shape directions can be "
                f"learned, not {self.betas}; take fewer betas or more people"
            )
        if not 1 <= self.subjects <= self.people:
            raise BadArgument(
                f"{self.subjects} subjects cannot be taken from {self.people} people; take 2 at "
                "least, and at most as many as there are"
            )
        if min(self.subjects, self.poses, self.held_out) < 2 or self.test < 5:
            raise BadArgument(
                "there must be at least 2 subjects, 2 poses, 2 held-out people and 5 test meshes"
            )


@dataclass(frozen=True, eq=False)
class People:
    """Everybody at rest on one mesh, and how the synthetic teacher poses them.

    Attributes:
        training: (P, N, 3) in metres, those from whom shape is learned.
        held_out: (Q, N, 3) in metres, the others.
        body: gives the kinematic tree, the joint regressor and the faces.
        fine_weights: (N, 32), of the teacher's rig.
    """

    training: Array
    held_out: Array
    body: SkinnedBody
    fine_weights: csr_array

    def posed(self, rest: Array, poses: Array) -> PosedMeshes:
        """Pose i (M, 24, 3) rad on person i modulo P of `rest` (P, N, 3) m."""
        person = np.arange(len(poses), dtype=np.int64) % len(rest)
        teachers = [Teacher(r, self.body.J_regressor @ r, self.fine_weights) for r in rest]
        meshes = [teachers[i].vertices(pose) for i, pose in zip(person, poses, strict=True)]
        return PosedMeshes(np.stack(meshes), poses, person)


@dataclass(frozen=True, eq=False)
class TriangleData:
    """The data on which the models are trained, in unknown poses, and tested; all are synthetic.

    Attributes:
        people: everybody at rest.
        standing: all training people, nearly at rest: the multi-shape set.
        posed: the subjects among them in poses: the multi-pose set.
        test: held-out people in poses.
        test_poses: which poses these are, in words.
    """

    people: People
    standing: InMemory
    posed: InMemory
    test: PosedMeshes
    test_poses: str

    @property
    def start(self) -> Start:
        """Where training starts: the mean person, its tree, and the part of each vertex."""
        body = self.people.body
        return replace(Start.of(body), template=self.people.training.mean(axis=0))


def read_people(plan: TrianglePlan, folder: Path, body: SkinnedBody) -> People:
    """The people at rest of sets that `python -m builder.sets` made; every one is made up.

    Raises BadFile for a folder without them or of another body, and BadArgument for fewer people.
    """
    what = "people at rest", "make them by `python -m builder.sets`, in a checkout"
    expected = {name: any_reals("P", body.n_vertices, 3) for name in ("train", "held_out")}
    with opened(folder / AT_REST, *what) as archive:
        arrays = {name: read_expected(archive, {name: one})[name] for name, one in expected.items()}
    for name, count in (("train", plan.people), ("held_out", plan.held_out)):
        if len(arrays[name]) < count:
            raise BadArgument(
                f"{folder} holds {len(arrays[name])} people of the set {name!r}, not {count}; take "
                "fewer, or make more"
            )
    training, held_out = arrays["train"][: plan.people], arrays["held_out"][: plan.held_out]
    return People(training, held_out, body, teacher_of(body).weights)


def register(plan: TrianglePlan, people: People, mocap: Path | None) -> TriangleData:
    """Pose people, turned and moved at random. Raises BadFile if `mocap` is no recording."""
    rng, prior = np.random.default_rng(plan.seed), shipped_gaussian()
    n = plan.subjects * plan.poses
    seen, others = np.split(draw_poses(prior, n + plan.test, rng), [n])
    if mocap is not None:
        recorded = held_out_poses(mocap)
        others = recorded[rng.permutation(len(recorded))[: plan.test]]
    still = JITTER * rng.standard_normal((plan.people, *seen.shape[1:]))
    return TriangleData(
        people,
        _scanned(people.posed(people.training, _turned(still, rng)), rng),
        _scanned(people.posed(people.training[: plan.subjects], _turned(seen, rng)), rng),
        people.posed(people.held_out, others),
        DRAWN if mocap is None else RECORDED,
    )


def _turned(poses: Array, rng: np.random.Generator) -> Array:
    """Poses (n, K, 3) rad whose root is turned about the vertical at random."""
    turned = poses.copy()
    turned[:, 0] = 0.0
    turned[:, 0, 1] = rng.uniform(-np.pi, np.pi, len(poses))
    return turned


def _scanned(meshes: PosedMeshes, rng: np.random.Generator) -> InMemory:
    """The meshes moved anywhere at random, without their poses."""
    trans = MOVED * rng.standard_normal((len(meshes.vertices), 1, 3))
    return InMemory(meshes.vertices + trans, meshes.person)
