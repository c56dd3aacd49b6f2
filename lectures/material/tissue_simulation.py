"""Simulated soft tissue: masses on springs over a body in motion. No tissue was measured.

How far the skin lies from the bones says how soft it is there. Every soft vertex is a mass on a
spring, whose other end SMPL moves, and neighbours are tied to each other:

    s'' = -w^2 (1 + |s|^2 / l^2) s - 2 z w (s' - W x s) + c^2 (mean of neighbours - s)
          + (1 - A) g - p''

s is the displacement in the world, p the place that SMPL gives the vertex, A its blend of
rotations, W the angular velocity of that blend, g gravity. The spring stiffens at the length l.
Gravity in the rest pose is in the template already, and turns with the body: hence (1 - A) g.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_array, diags_array

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.geometry.solids import heat, mesh_edges
from workbench.motions import Motion
from workbench.motions.soft_tissue import GRAVITY, MovingFrames, second_differences

FLESH = {  # share of the way from bone to skin that is soft, by the joint that moves it: made up
    "pelvis": 0.6,
    "spine1": 0.6,
    "spine2": 0.5,
    "spine3": 0.35,
    "hip": 0.5,
    "knee": 0.35,
    "shoulder": 0.45,
    "elbow": 0.25,
    "collar": 0.15,
}
CHUNK = 600  # frames whose surfaces are kept at once


@dataclass(frozen=True)
class TissueLaw:
    """The numbers of the springs. They are made up, of the order of what is reported of thighs.

    Attributes:
        frequency: in Hz, of a layer as thick as `thickness`; thinner layers are stiffer.
        thickness: in m.
        range: in Hz, the lowest and the highest frequency; a layer that would be above is rigid.
        damping: as a share of the critical damping.
        coupling: in Hz, of a vertex tied to neighbours that do not move.
        stiffening: l in m, the displacement at which a spring pulls twice as hard as a linear one.
        steps: of the integration in each frame.
        flesh: which share of the way from bone to skin is soft, by the name of the joint without
            its side.
    """

    frequency: float = 5.0
    thickness: float = 0.06
    range: tuple[float, float] = (4.0, 16.0)
    damping: float = 0.15
    coupling: float = 3.0
    stiffening: float = 0.05
    steps: int = 4
    flesh: Mapping[str, float] = field(default_factory=lambda: FLESH)


def softness(body: SkinnedBody, betas: Array | None = None, law: TissueLaw | None = None) -> Array:
    """The frequency of each vertex of a person in Hz, (N,); infinite where it is rigid."""
    law = TissueLaw() if law is None else law
    surface, joints = body.vertices(body.bind_pose, betas), body.joints(None, betas)
    thick = np.zeros(len(surface))
    for k, name in enumerate(body.joint_names):
        share = law.flesh.get(name.removeprefix("left_").removeprefix("right_"), 0.0)
        if not share:
            continue
        ends = [joints[c] for c, parent in enumerate(body.parents) if parent == k]
        away = np.min([_from_bone(surface, joints[k], end) for end in ends], axis=0)
        thick += body.weights[:, k] * share * away
    thick = heat(body.template, body.faces, 0.02).solve(thick)
    with np.errstate(divide="ignore"):
        f = law.frequency * law.thickness / np.maximum(thick, 0)
    low, high = law.range
    return np.where(f > high, np.inf, np.maximum(f, low))


def simulate_tissue(body: SkinnedBody, motion: Motion, law: TissueLaw | None = None) -> Array:
    """The displacements (T, N, 3) m at rest of simulated tissue in a motion, with its betas.

    They are added to the rest surface before it is skinned: with A a vertex's blend of rotations,
    A' times the displacement in the world. The tissue begins without displacement and speed; the
    integration is symplectic, with `law.steps` steps a frame. Use 50 frames a second or more, and
    a smooth motion (`splined`). Raises BadArgument for a rate at which the integration would not
    be stable, and for a body without soft joints.
    """
    law = TissueLaw() if law is None else law
    frames = MovingFrames.of(body, motion)
    here, dt = frames.motion, 1 / (motion.fps * law.steps)
    f = softness(body, here.betas, law)
    soft = np.flatnonzero(np.isfinite(f))
    if not len(soft):
        raise BadArgument(f"nothing of body {body.name!r} is soft; its joints have other names")
    w, c = 2 * np.pi * f[soft, None], 2 * np.pi * law.coupling
    if dt * (w.max() + c) > 1:
        raise BadArgument(
            f"{motion.fps:g} frames a second with {law.steps} steps are too few for springs of "
            f"{f[soft].max():.0f} Hz; spline the motion to a higher rate"
        )
    tie = _means_of_neighbours(body, soft)
    out = np.zeros((len(here), body.n_vertices, 3))
    s, v = np.zeros((2, len(soft), 3))
    W = body.weights[soft]
    pulls = -second_differences(_surface(body, here, soft), here.fps)
    before: tuple[Array, Array] | None = None
    for t, pull in enumerate(pulls):
        A = np.einsum("nk,kij->nij", W, frames.turns[t], optimize=True)
        pull = pull + GRAVITY - A @ GRAVITY
        turning = W @ frames.world_turning[t]
        a, b = (pull, turning) if before is None else before
        for step in range(1, law.steps + 1):
            share = step / law.steps
            spin, force = b + share * (turning - b), a + share * (pull - a)
            hardening = 1 + (s * s).sum(axis=1, keepdims=True) / law.stiffening**2
            force = force - w * w * hardening * s - 2 * law.damping * w * (v - np.cross(spin, s))
            v = v + dt * (force + c * c * (tie @ s - s))
            s = s + dt * v
        before = pull, turning
        out[t, soft] = np.einsum("nji,nj->ni", A, s)
    return out


def _surface(body: SkinnedBody, motion: Motion, soft: Index) -> Array:
    """The soft vertices in all frames, (T, S, 3) m, from a chunk of surfaces at a time."""
    firsts = range(0, len(motion), CHUNK)
    return np.concatenate([motion[at : at + CHUNK].vertices(body)[:, soft] for at in firsts])


def _means_of_neighbours(body: SkinnedBody, soft: Index) -> csr_array:
    """The mean of each soft vertex's neighbours, those that are rigid counting as zero, (S, S)."""
    edges, N = mesh_edges(body.faces), body.n_vertices
    pairs = np.concatenate([edges, edges[:, ::-1]])
    near = csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(N, N))
    shares = diags_array(1 / np.maximum(np.asarray(near.sum(axis=1)).ravel(), 1)) @ near
    return csr_array(csr_array(shares)[soft][:, soft])


def _from_bone(points: Array, a: Array, b: Array) -> Array:
    """The distances (N,) of points from the straight line between two joints."""
    way = b - a
    share = np.clip((points - a) @ way / (way @ way), 0, 1)
    return np.asarray(np.linalg.norm(points - a - share[:, None] * way, axis=1))
