"""The same people for SMPL and SCAPE: at rest, in poses, and others in poses not seen before."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.training.blend_shapes.comparison import held_out, shipped_prior
from workbench.training.embedded.sources import gather_sources
from workbench.training.embedded.teacher import Teacher
from workbench.training.embedded.topology import FILES, read_topology
from workbench.training.embedded.wheel import Wheel
from workbench.training.first_guess import Start
from workbench.training.pose_prior import draw_poses
from workbench.training.registrations import InMemory
from workbench.training.sets import SetRecipe
from workbench.training.triangles.learning import PosedMeshes

Array = NDArray[np.float64]
Report = Callable[[str], None]
RECORDED = "real poses, of clips of motion capture that nothing was learned from"
DRAWN = "further draws from the pose prior, which is a Gaussian: easier than real poses"

MOVED = 0.5  # m, on every axis


@dataclass(frozen=True)
class Plan:
    """How many of everything, and the seed of every draw."""

    body: str = "small"
    people: int = 200  # at rest, for shape
    subjects: int = 10  # the first of them, also in poses
    poses: int = 15  # of each subject
    strangers: int = 50  # whom nothing was learned from
    test: int = 100  # meshes of them
    betas: int = 10  # shape directions of the models that are posed
    seed: int = 0

    def __post_init__(self) -> None:
        if self.body not in FILES:
            raise BadArgument(f"there is no body {self.body!r}; there are {', '.join(FILES)}")
        if not 0 < self.betas < self.people:
            raise BadArgument(
                f"{self.people} people tell up to {self.people - 1} shape directions apart, not "
                f"{self.betas}; take fewer betas or more people"
            )
        if not 1 <= self.subjects <= self.people:
            raise BadArgument(f"{self.subjects} subjects are not among {self.people} people")
        if min(self.subjects, self.poses, self.strangers) < 2 or self.test < 5:
            raise BadArgument("there must be 2 subjects, poses and strangers each, and 5 tests")


@dataclass(frozen=True, eq=False)
class People:
    """Everybody at rest (P, N, 3) m on one mesh, and how the synthetic teacher poses them."""

    learned: Array
    strangers: Array
    body: SkinnedBody  # gives tree, joints and faces
    fine_weights: csr_array  # (N, 32)

    def posed(self, rest: Array, poses: Array) -> PosedMeshes:
        """Pose i (M, 24, 3) rad on person i modulo P of `rest` (P, N, 3) m."""
        person = np.arange(len(poses), dtype=np.int64) % len(rest)
        teachers = [Teacher(r, self.body.J_regressor @ r, self.fine_weights) for r in rest]
        meshes = [teachers[i].vertices(pose) for i, pose in zip(person, poses, strict=True)]
        return PosedMeshes(np.stack(meshes), poses, person)


@dataclass(frozen=True, eq=False)
class Registrations:
    """What is learned from, in poses that nobody is told, and what is tested on; all synthetic."""

    people: People
    standing: InMemory  # of everybody learned from, nearly at rest: the multi-shape set
    posed: InMemory  # of the first of them: the multi-pose set
    test: PosedMeshes  # of the strangers
    said: str  # which poses they are in

    @property
    def start(self) -> Start:
        """What training is told: the mean person, its tree, and the part that each vertex is of."""
        body = self.people.body
        return replace(Start.of(body), template=self.people.learned.mean(axis=0))


def draw_people(plan: Plan, wheel: Path, body: SkinnedBody, report: Report) -> People:
    """From the artists' shape targets in the wheel; every one of them is made up."""
    sources = gather_sources(Wheel(wheel), plan.people + plan.strangers, plan.seed, report)
    topology = read_topology(sources.wheel, plan.body, sources.mesh)
    rest = np.stack([topology.follows @ person for person in sources.population.vertices])
    fine = csr_array(topology.follows @ sources.fine_weights)
    return People(rest[: plan.people], rest[plan.people :], body, fine)


def register(plan: Plan, people: People, mocap: Path | None) -> Registrations:
    """Pose them, turned and moved at random. Raises BadFile if `mocap` is no recording."""
    rng, prior = np.random.default_rng(plan.seed), shipped_prior()
    n = plan.subjects * plan.poses
    seen, others = np.split(draw_poses(prior, n + plan.test, rng), [n])
    if mocap is not None:
        recorded = held_out(mocap)
        others = recorded[rng.permutation(len(recorded))[: plan.test]]
    still = SetRecipe.jitter * rng.standard_normal((plan.people, *seen.shape[1:]))
    return Registrations(
        people,
        _scanned(people.posed(people.learned, _turned(still, rng)), rng),
        _scanned(people.posed(people.learned[: plan.subjects], _turned(seen, rng)), rng),
        people.posed(people.strangers, others),
        DRAWN if mocap is None else RECORDED,
    )


def _turned(poses: Array, rng: np.random.Generator) -> Array:
    """About the vertical, nobody knows how far."""
    turned = poses.copy()
    turned[:, 0] = 0.0
    turned[:, 0, 1] = rng.uniform(-np.pi, np.pi, len(poses))
    return turned


def _scanned(meshes: PosedMeshes, rng: np.random.Generator) -> InMemory:
    """Without their poses, and standing anywhere."""
    trans = MOVED * rng.standard_normal((len(meshes.vertices), 1, 3))
    return InMemory(meshes.vertices + trans, meshes.person)
