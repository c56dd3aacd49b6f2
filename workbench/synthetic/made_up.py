"""Synthetic bodies and registrations with known answers; nothing here was measured."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.geometry.solids import heat
from workbench.motions import Motion
from workbench.training.first_guess import Start
from workbench.training.registrations import Batch, InMemory, Registrations
from workbench.training.shares import at_most

POSEDIRS_RMS, WEIGHT_SPREAD = 0.003, 0.06  # m
PACES = (0.3, 1.8)  # Hz, the slowest and the fastest sine


def jointed_tube(rings: int = 25, around: int = 8) -> Start:
    """A tube of rings x around vertices along x, 1 m long, with six joints and a bump on top.

    Alike on both sides of x = 0 if the number of rings is odd.
    """
    v, faces = _tube(rings, around)
    segments = np.select(
        [v[:, 0] > 0.32, v[:, 0] < -0.32, v[:, 0] > 0.14, v[:, 0] < -0.14, v[:, 1] > 0.05],
        [3, 4, 1, 2, 5],
        0,
    )
    names = ("root", "left_1", "right_1", "left_2", "right_2", "head")
    return Start(v, faces, (-1, 0, 0, 1, 2, 0), names, segments)


def limb(rings: int, around: int) -> Start:
    """A tube like `jointed_tube`'s with two joints: the root, and the `tip`, which moves x > 0."""
    v, faces = _tube(rings, around)
    return Start(v, faces, (-1, 0), ("root", "tip"), np.where(v[:, 0] > 0, 1, 0))


def arms(rings: int, around: int) -> Start:
    """A tube like `jointed_tube`'s with three joints: the root, and an arm on each side of it.

    The arms are what lies more than a quarter of the way out. Alike on both sides of x = 0 if the
    number of rings is odd, so that it has a mirror.
    """
    v, faces = _tube(rings, around)
    segments = np.select([v[:, 0] > 0.125, v[:, 0] < -0.125], [1, 2], 0)
    return Start(v, faces, (-1, 0, 0), ("root", "left_arm", "right_arm"), segments)


def _tube(rings: int, around: int) -> tuple[Array, Index]:
    """The vertices (N, 3) m and faces of a closed tube along x, from -0.5 m to 0.5 m."""
    x = np.linspace(-0.5, 0.5, rings)
    phi = 2 * np.pi * np.arange(around) / around + np.pi / 2
    v = np.array([[a, 0.1 * np.sin(p), 0.1 * np.cos(p)] for a in x for p in phi])
    faces: list[tuple[int, int, int]] = []
    for i in range(rings - 1):
        for k in range(around):
            a, b = i * around + k, i * around + (k + 1) % around
            c, d = a + around, b + around
            faces += [(a, c, b), (b, c, d)] if i < rings // 2 else [(a, c, d), (a, d, b)]
    end = (rings - 1) * around
    for k in range(1, around - 1):
        faces += [(0, k, k + 1), (end, end + k + 1, end + k)]
    return v, np.array(faces)


def random_smpl(start: Start, n_betas: int, seed: int, *, shape: float = 0.01) -> SkinnedBody:
    """A body with random arrays on the mesh of a start, all of them smooth over the surface.

    `shape` is the rms of shapedirs in metres; that of posedirs is POSEDIRS_RMS, and weights reach
    WEIGHT_SPREAD beyond their segment. A joint is a weighted mean of the vertices of its ring. The
    two sides of the body differ.
    """
    rng = np.random.default_rng(seed)
    N, K = len(start.template), len(start.parents)
    smooth = heat(start.template, start.faces, WEIGHT_SPREAD)

    def field(*axes: int, rms: float) -> Array:
        rough = rng.standard_normal((N, int(np.prod(axes))))
        drawn = smooth.solve(rough)
        return np.asarray(rms * drawn / np.sqrt(np.mean(drawn**2))).reshape(N, *axes)

    weights = start.weights(WEIGHT_SPREAD) * np.exp(0.3 * rng.standard_normal((N, K)))
    rings = start.rings().toarray()
    shares = rings * rng.random(rings.shape)
    return SkinnedBody(
        template=start.template + field(3, rms=shape),
        shapedirs=field(3, n_betas, rms=shape),
        posedirs=field(3, 9 * (K - 1), rms=POSEDIRS_RMS),
        J_regressor=csr_array(shares / shares.sum(axis=1, keepdims=True)),
        weights=at_most(np.where(weights < 0.02, 0, weights), 4),
        parents=start.parents,
        faces=start.faces,
        joint_names=start.joint_names,
        name="made-up",
    )


@dataclass(frozen=True, eq=False)
class Truth:
    """What registrations were made from: betas (S, B), poses (J, K, 3) rad and trans (J, 3) m."""

    betas: Array
    poses: Array
    trans: Array


def draw_registrations(
    body: SkinnedBody, subjects: int, poses_each: int, seed: int, *, turn: float = 1.5
) -> tuple[InMemory, Truth]:
    """Exact registrations of made-up subjects, every joint turned by up to `turn` rad.

    The axes are random, and angles are at least a fifth of the largest, so that every joint moves
    visibly. Beyond two radians, blending squeezes a surface until little can be learned there.
    """
    rng = np.random.default_rng(seed)
    subject = np.repeat(np.arange(subjects), poses_each)
    betas = rng.standard_normal((subjects, body.n_betas))
    axes = rng.standard_normal((len(subject), body.n_joints, 3))
    angles = turn * rng.uniform(0.2, 1.0, (*axes.shape[:2], 1))
    poses = angles * axes / np.linalg.norm(axes, axis=2, keepdims=True)
    trans = rng.standard_normal((len(subject), 3))
    vertices = body.vertices(poses, betas[subject], trans)
    return InMemory(vertices, subject), Truth(betas, poses, trans)


@dataclass(frozen=True, eq=False)
class CorruptedRegistrations:
    """Registrations with errors, which are the same for the same seed.

    `noise` is the standard deviation of every coordinate in m. A share `missing` of the vertices is
    in a patch that was not scanned: their confidence is zero, and they are placed at the middle of
    the patch. A share of `outliers` is wrong by `far` m, with a confidence of one.
    """

    of: Registrations
    seed: int
    noise: float = 0.0
    missing: float = 0.0
    outliers: float = 0.0
    far: float = 0.1

    @property
    def subject(self) -> Index:
        """The subject of each registration, unchanged."""
        return self.of.subject

    @property
    def n_vertices(self) -> int:
        """N, the number of vertices."""
        return self.of.n_vertices

    def read(self, some: slice) -> Batch:
        """Some registrations with errors; those of one registration do not depend on the batch."""
        batch = self.of.read(some)
        vertices, confidence = batch.vertices.copy(), batch.confidence.copy()
        rows = range(len(self.subject))[some]
        for j, (row, v) in enumerate(zip(rows, vertices, strict=True)):
            rng = np.random.default_rng((self.seed, row))
            N = len(v)
            drawn = self.noise * rng.standard_normal((N, 3))
            middle = v[rng.integers(N)]
            errors = rng.standard_normal((N, 3))
            hit = rng.random(N) < self.outliers
            missing = np.argsort(np.linalg.norm(v - middle, axis=1))[: int(self.missing * N)]
            vertices[j] += drawn
            length = np.linalg.norm(errors, axis=1, keepdims=True)
            vertices[j] += np.where(hit[:, None], self.far * errors / length, 0)
            vertices[j][missing] = middle
            confidence[j][missing] = 0
        return Batch(batch.some, batch.subject, vertices, confidence)


def noisy_tubes(noise: float) -> tuple[Start, Registrations]:
    """A small training set: six people in twelve poses each, with `noise` in metres."""
    guess = jointed_tube(11, 6)
    exact, _ = draw_registrations(random_smpl(guess, 3, seed=0), 6, 12, seed=1)
    return guess, CorruptedRegistrations(exact, seed=2, noise=noise)


def made_up_motion(
    body: SkinnedBody, seconds: float, *, seed: int = 0, fps: float = 60.0, turn: float = 0.1
) -> Motion:
    """A body that hops, sways and moves all of its joints, each about each axis by three sines.

    `turn` is the standard deviation of each angle in rad; the root hops by about 3 cm. Nothing of
    it was recorded, and no person moves like this.
    """
    rng = np.random.default_rng(seed)
    times = np.arange(round(seconds * fps)) / fps
    shape = (body.n_joints + 1, 3, 3)  # the last one is for trans: three sines for each axis
    pace, phase = rng.uniform(*PACES, shape), rng.uniform(0, 2 * np.pi, shape)
    waves = np.sin(2 * np.pi * pace * times[:, None, None, None] + phase).sum(axis=-1)
    waves *= np.sqrt(2 / 3)  # a standard deviation of one
    pose = body.bind_pose + turn * waves[:, :-1]
    return Motion(pose, 0.03 * waves[:, -1], fps, body.joint_names, origin="made up of sines")
