"""Simulated scans of people whose surfaces are known, and how far registrations are from them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_skinned
from workbench.geometry.solids import vertex_normals
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.registration import FreeVertices
from workbench.registration.coregistration import ScansInMemory
from workbench.registration.free_vertices import MODEL_STAGES, VERTEX_STAGES
from workbench.synthetic import Clutter, Holes, Joining, Noise, people, scan, scanners
from workbench.training.registrations import InMemory

TRUTH, START = "default-male", "default"  # whom scans are made of, and where registering begins
VIEWS, OWN_SHAPE = 2, 0.006  # depth cameras; rms in m of what betas do not reach
OTHERS, POSES = 3, 4  # people, and poses of each, that no scan shows
POSE_OFF, TRANS_OFF = 0.03, 0.01  # rad, m: how far from the truth each fit begins
MM = 1e3


@dataclass(frozen=True, eq=False)
class Person:
    """A person at rest, as a body of the truth: (N, 3) m with joints by its regressor."""

    body: SkinnedBody

    def posed(self, rng: np.random.Generator, poses: Array) -> Array:
        """The person in one of the poses, turned and moved at random."""
        return self.placed(rng, poses)[0]

    def placed(self, rng: np.random.Generator, poses: Array) -> tuple[Array, Array, Array]:
        """Vertices (N, 3) m, the pose and the translation."""
        pose = poses[rng.integers(len(poses))].copy()
        pose[0] = [0.0, rng.uniform(-np.pi, np.pi), 0.0]
        trans = 0.1 * rng.standard_normal(3)
        return self.body.vertices(pose, np.zeros(self.body.n_betas), trans), pose, trans


@dataclass(frozen=True, eq=False)
class ScannedSet:
    """Everything that is known of a simulated set of J scans.

    Attributes:
        faces: (F, 3).
        meshes: (J, N, 3) m, the true surfaces that were scanned.
        scans: the scans, and of whom they are.
        seen: (J, N) which vertices some scanner saw.
        starts: where the fits begin: pose, betas and trans.
        same: the same people in poses that were not scanned.
        others: other people, in several poses each.
    """

    faces: Index
    meshes: Array
    scans: ScansInMemory
    seen: Mask
    starts: list[dict[str, Array]]
    same: InMemory
    others: InMemory

    @property
    def subject(self) -> Index:
        """(J,) of whom the scans are."""
        return self.scans.subject

    def some(self, count: int) -> "ScannedSet":
        """The first `count` scans."""
        own = ScansInMemory(self.scans.scans[:count], self.subject[:count])
        return replace(
            self,
            meshes=self.meshes[:count],
            scans=own,
            seen=self.seen[:count],
            starts=self.starts[:count],
        )


def scanned_set(
    seed: int, count: int, n_scans: int, holes: int = 0, clutter: float = 0.0
) -> ScannedSet:
    """Scans of `count` people in turn, with so many holes in each and a share of clutter.

    The people are made of the body `TRUTH`, each with a shape of its own that betas do not reach,
    and scanned by two depth cameras with noise that grows with the distance, 2 mm at 2 m. Scan j is
    the same for any number of scans.
    """
    truth = load_skinned(TRUTH)
    poses = draw_poses(shipped_gaussian(), 400, np.random.default_rng((seed, 7)))
    made = people(truth, poses, count + OTHERS, seed, own_shape=OWN_SHAPE)
    who = [
        Person(replace(truth, template=one.template + truth.shapedirs @ one.values["betas"]))
        for one in made
    ]
    meshes, scans, seen, starts = [], [], [], []
    subject = np.arange(n_scans) % count
    for j, s in enumerate(subject):
        rng = np.random.default_rng((seed, 1, j))
        vertices, pose, trans = who[s].placed(rng, poses)
        simulated = scan(
            vertices,
            truth.faces,
            scanners(VIEWS, height=0.3, target=vertices.mean(axis=0)),
            seed=1000 * seed + j,
            noise=Noise(growth=5e-4),
            holes=Holes(holes) if holes else None,
            clutter=Clutter(clutter) if clutter else None,
            steepest=np.radians(80),
            joining=Joining(),
        )
        meshes.append(vertices)
        scans.append(simulated.scan)
        seen.append(simulated.seen)
        starts.append(
            {
                "pose": pose + POSE_OFF * rng.standard_normal(pose.shape),
                "betas": np.zeros(truth.n_betas),
                "trans": trans + TRANS_OFF * rng.standard_normal(3),
            }
        )

    def unseen(some: Sequence[Person], stream: int) -> InMemory:
        rng = np.random.default_rng((seed, stream))
        numbers = np.repeat(np.arange(len(some)), POSES)
        return InMemory(np.stack([some[s].posed(rng, poses) for s in numbers.tolist()]), numbers)

    return ScannedSet(
        truth.faces,
        np.stack(meshes),
        ScansInMemory(tuple(scans), subject),
        np.stack(seen),
        starts,
        unseen(who[:count], 2),
        unseen(who[count:], 3),
    )


@dataclass(frozen=True)
class Apart:
    """Registers each scan by itself, in some rounds of the last stage, from where it is.

    Attributes:
        rounds: how many; none begins with the stages of `workbench register`.
    """

    rounds: int

    def __call__(self, job: tuple[ScansInMemory, int, Mapping[str, Array]]) -> dict[str, Array]:
        """Pose, betas, trans and the vertices of one scan."""
        scans, row, values = job
        fit = FreeVertices(load_skinned(START), scans.read(row))
        if "vertices" not in values:
            values = fit.register(values, VERTEX_STAGES).values
        for _ in range(self.rounds):
            values = fit.register(values, VERTEX_STAGES[len(MODEL_STAGES) :]).values
        return dict(values)


def errors(given: ScannedSet, vertices: Array) -> dict[str, list[float]]:
    """Mean errors of registrations (J, N, 3) m by scan, in mm.

    They are those of seen and of hidden vertices, and along the skin and across it of all.
    """
    away = vertices - given.meshes
    length = MM * np.linalg.norm(away, axis=2)
    normals = np.stack([vertex_normals(V, given.faces) for V in given.meshes])
    across = MM * np.einsum("jna,jna->jn", away, normals)
    along = np.sqrt(np.maximum(length**2 - across**2, 0))
    means = {
        "seen": np.array([e[s].mean() for e, s in zip(length, given.seen, strict=True)]),
        "hidden": np.array([e[~s].mean() for e, s in zip(length, given.seen, strict=True)]),
        "tangential": along.mean(axis=1),
        "normal": np.abs(across).mean(axis=1),
    }
    return {name: each.tolist() for name, each in means.items()}


def ratio(ours: Sequence[float], theirs: Sequence[float], subject: Index) -> tuple[float, ...]:
    """The sum of errors by scan over that of others, with its 90 % interval over people.

    The interval is that of 10,000 draws of as many people, with replacement.
    """
    P = int(subject.max()) + 1
    sums = np.stack([np.bincount(subject, each, P) for each in (ours, theirs)])
    drawn = np.random.default_rng(0).integers(P, size=(10_000, P))
    ratios = sums[0][drawn].sum(axis=1) / sums[1][drawn].sum(axis=1)
    return float(sums[0].sum() / sums[1].sum()), *map(float, np.percentile(ratios, [5, 95]))
