"""The same people for SMPL and SCAPE: at rest, in poses, and others in poses not seen before."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.training.blend_shapes.comparison import held_out, shipped_prior
from workbench.training.embedded.build import Recipe, gather_sources
from workbench.training.embedded.pose_blends import draw_poses
from workbench.training.embedded.teacher import Teacher
from workbench.training.embedded.topology import FILES, read_topology
from workbench.training.embedded.wheel import Wheel
from workbench.training.triangles.learning import PosedMeshes

Array = NDArray[np.float64]
Report = Callable[[str], None]
RECORDED = "real poses, of clips of motion capture that nothing was learned from"
DRAWN = "further draws from the pose prior, which is a Gaussian: easier than real poses"


@dataclass(frozen=True)
class Plan:
    """How many of everything, and the seed of every draw."""

    body: str = "small"
    people: int = 200  # at rest, for shape
    subjects: int = 10  # the first of them, also in poses
    poses: int = 15  # of each subject
    trial: int = 40  # further meshes of the subjects, to choose SMPL's ridge on
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
        if min(self.poses, self.trial, self.strangers) < 2 or self.test < 5:
            raise BadArgument("there must be 2 poses, trials and strangers each, and 5 tests")


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
    """What is learned from, chosen on and tested on; all of it synthetic but the test's poses."""

    people: People
    posed: PosedMeshes
    trial: PosedMeshes
    test: PosedMeshes  # of the strangers
    said: str  # which poses they are in


def draw_people(plan: Plan, wheel: Path, body: SkinnedBody, report: Report) -> People:
    """From the artists' shape targets in the wheel; every one of them is made up."""
    recipe = Recipe(people=plan.people + plan.strangers, seed=plan.seed)
    sources = gather_sources(Wheel(wheel), recipe, report)
    topology = read_topology(sources.wheel, plan.body, sources.mesh)
    rest = np.stack([topology.follows @ person for person in sources.population.vertices])
    fine = csr_array(topology.follows @ sources.fine_weights)
    return People(rest[: plan.people], rest[plan.people :], body, fine)


def register(plan: Plan, people: People, mocap: Path | None) -> Registrations:
    """Pose them. Raises BadFile if `mocap` is no recording."""
    rng, prior = np.random.default_rng(plan.seed), shipped_prior()
    n = plan.subjects * plan.poses
    drawn = draw_poses(prior, n + plan.trial + plan.test, rng)
    seen, trial, others = np.split(drawn, [n, n + plan.trial])
    if mocap is not None:
        recorded = held_out(mocap)
        others = recorded[rng.permutation(len(recorded))[: plan.test]]
    subjects = people.learned[: plan.subjects]
    return Registrations(
        people,
        people.posed(subjects, seen),
        people.posed(subjects, trial),
        people.posed(people.strangers, others),
        DRAWN if mocap is None else RECORDED,
    )
