"""Soft tissue that follows a motion: dynamic blend shapes, and a model of their coefficients.

Dynamic blend shapes are added to the rest surface, as those of shape and pose are (Pons-Moll et
al., Dyna, 2015, and DMPL in Loper et al., SMPL, 2015, section 7):

    T = template + B_S(betas) + B_P(pose) + gain(betas) sum_c phi_c D_c

Their coefficients at frame t follow from those of the two frames before and from what moves,

    phi_t = A_1 phi_(t-1) + A_2 phi_(t-2) + B x_t

with x_t the inputs of `tissue_inputs`. Joints are those of the person without tissue, as in the
paper.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.blocks.checks import reals as as_reals
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body, why_not_skinned
from workbench.bodies.forward.posing import Posing
from workbench.bodies.readonly import locked
from workbench.bodies.spaces import body_mass_index, body_mass_index_of
from workbench.environment import expanded
from workbench.errors import BadArgument, BadFile
from workbench.geometry.rotation import vector_from_matrix
from workbench.motions.motion import SPLINE_FRAMES, Motion, splined
from workbench.reading.arrays import opened, read_expected, reals, texts, wholes
from workbench.writing import write_arrays

LARGEST_RADIUS = 0.999  # of a model that is taken; at 60 frames a second it dies away in 17 s
SAME_RATE = 1e-6  # relative


@dataclass(frozen=True, eq=False)
class SoftTissue:
    """Dynamic blend shapes of a body of N vertices and the second-order model that drives them.

    The coefficients of frame t are phi_t = A_1 phi_(t-1) + A_2 phi_(t-2) + B x_t, x_t being inputs
    that follow from the motion.

    Raises BadArgument if the arrays do not fit together, or if the model is not stable: a spectral
    radius of `LARGEST_RADIUS` or more.

    Attributes:
        directions: (N, 3, C) m per unit of a coefficient, orthonormal up to a factor.
        first: (C, C), A_1.
        second: (C, C), A_2.
        response: (C, X), B.
        part: (N,) the soft part of each vertex; -1 if it is in none.
        fps: frames a second of the model.
        joint_names: of the body.
        n_betas: how many betas are among the inputs.
        power: gain(betas) = (body mass index / that of the mean person)^power.
        card: where its numbers come from.
    """

    directions: Array
    first: Array
    second: Array
    response: Array
    part: Index
    fps: float
    joint_names: tuple[str, ...]
    n_betas: int = 0
    power: float = 0.0
    card: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        names = ("directions", "first", "second", "response")
        arrays = {name: as_reals(name, getattr(self, name)) for name in names}
        arrays["part"] = np.asarray(self.part, dtype=np.int64)
        N, C = arrays["directions"].shape[0], arrays["directions"].shape[-1]
        X = 6 * len(self.joint_names) + 6 + 3 * (int(arrays["part"].max(initial=-1)) + 1)
        shapes = {"directions": (N, 3, C), "first": (C, C), "second": (C, C), "part": (N,)}
        shapes["response"] = (C, X + self.n_betas + 1)
        for name, shape in shapes.items():
            if arrays[name].shape != shape or not np.isfinite(arrays[name]).all():
                raise BadArgument(
                    f"{name} of soft tissue are {shape} finite numbers, not {arrays[name].shape}"
                )
        if not self.fps > 0:
            raise BadArgument(f"fps is a number above 0, not {self.fps!r:.60}")
        self.__dict__.update({name: locked(array.copy()) for name, array in arrays.items()})
        if not (radius := self.spectral_radius) < LARGEST_RADIUS:
            raise BadArgument(
                f"the model of the coefficients has a spectral radius of {radius:.4f}, so that "
                f"they would not die away; make it less than {LARGEST_RADIUS}, as `stabilized` of "
                "lecture 19 does"
            )

    @property
    def n_coefficients(self) -> int:
        """C, the number of dynamic blend shapes."""
        return int(self.directions.shape[2])

    @property
    def poles(self) -> Array:
        """The 2 C eigenvalues of the companion matrix of A_1 and A_2, complex."""
        return np.asarray(np.linalg.eigvals(companion(self.first, self.second)))

    @property
    def spectral_radius(self) -> float:
        """The largest size of a pole: what is left of a wobble after one frame."""
        return float(np.abs(self.poles).max(initial=0.0))

    def gain(self, body: SkinnedBody, betas: ArrayLike | None = None) -> float:
        """How much more the tissue of a person moves than that of the mean person."""
        return float((body_mass_index(body, betas) / body_mass_index(body)) ** self.power)

    def coefficients(self, body: SkinnedBody, motion: Motion) -> Array:
        """The coefficients (T, C) in a motion, frame by frame from the inputs alone.

        The first two frames begin at zero. The motion has the model's rate: see `prepared`.
        Raises BadArgument for another rate or another body.
        """
        self._check(body, motion)
        frames = MovingFrames.of(body, motion)
        x = tissue_inputs(frames, self.part, self.n_betas)
        return free_run(self.first, self.second, x @ self.response.T)

    def displacements(self, body: SkinnedBody, coefficients: ArrayLike, betas: Any = None) -> Array:
        """What coefficients (..., C) add to the rest surface of a person, (..., N, 3) m."""
        phi = as_reals("coefficients", coefficients)
        if phi.shape[-1:] != (self.n_coefficients,):
            raise BadArgument(
                f"this tissue has {self.n_coefficients} coefficients a frame, not {phi.shape}"
            )
        flat = self.directions.reshape(-1, self.n_coefficients)
        moved = (self.gain(body, betas) * phi) @ flat.T
        return np.asarray(moved.reshape(*phi.shape[:-1], -1, 3))

    def vertices(self, body: SkinnedBody, motion: Motion, exaggeration: float = 1.0) -> Array:
        """The surface (T, N, 3) m in a motion; the tissue moves `exaggeration` times as far.

        At an exaggeration of 0 the surface is that of `motion.vertices`, to the last bit.
        """
        phi = exaggeration * self.coefficients(body, motion)
        return self.surface(body, motion, phi)

    def surface(self, body: SkinnedBody, motion: Motion, coefficients: ArrayLike) -> Array:
        """The surface (T, N, 3) m in a motion with these coefficients (T, C).

        Each displacement is turned as the vertex is, by its blend of rotations.
        """
        self._check(body, motion)
        frames = MovingFrames.of(body, motion)
        bare = frames.motion.vertices(body)
        added = self.displacements(body, coefficients, frames.motion.betas)
        for t, d in enumerate(added):
            R = frames.turns[t].reshape(body.n_joints, 9)
            bare[t] += np.einsum("nij,nj->ni", (body.weights @ R).reshape(-1, 3, 3), d)
        return bare

    def prepared(self, motion: Motion) -> Motion:
        """The motion at the model's rate: as it is, or splined (`splined`)."""
        same = abs(motion.fps / self.fps - 1) < SAME_RATE
        return motion if same else splined(motion, self.fps)

    def gain_of(self, body: SkinnedBody, betas: cs.MX) -> cs.MX:
        """`gain` (1, 1) in symbols, of betas (B, 1): see `body_mass_index_of` for its derivatives.

        It is the number 1 if the power is 0.
        """
        if not self.power:
            return cs.MX(1)
        return (body_mass_index_of(body, betas) / body_mass_index(body)) ** self.power

    def _checked(self, body: Body) -> SkinnedBody:
        if reason := why_not_skinned(body, "soft tissue", "give the skinned body it was made from"):
            raise BadArgument(reason)
        if body.n_vertices != len(self.part) or tuple(body.joint_names) != self.joint_names:
            raise BadArgument(
                f"this soft tissue is that of {self.card.get('body', 'another body')!r} with "
                f"{len(self.part)} vertices and {len(self.joint_names)} joints, not that of body "
                f"{body.name!r} with {body.n_vertices} and {body.n_joints}"
            )
        assert isinstance(body, SkinnedBody)
        return body

    def _check(self, body: SkinnedBody, motion: Motion) -> None:
        self._checked(body)
        if abs(motion.fps / self.fps - 1) > SAME_RATE:
            long_enough = len(motion) >= SPLINE_FRAMES
            do = "tissue.prepared(motion) splines it" if long_enough else "record it anew"
            raise BadArgument(
                f"this soft tissue moves at {self.fps:g} frames a second, and the motion has "
                f"{motion.fps:g}; {do}"
            )


def companion(first: Array, second: Array) -> Array:
    """The matrix (2 C, 2 C) that takes (phi_(t-1), phi_(t-2)) to (phi_t, phi_(t-1))."""
    C = len(first)
    return np.block([[first, second], [np.eye(C), np.zeros((C, C))]])


def free_run(first: Array, second: Array, driven: Array) -> Array:
    """phi_t = A_1 phi_(t-1) + A_2 phi_(t-2) + driven_t, from zeros."""
    phi = np.zeros((len(driven) + 2, driven.shape[1]))
    for t, pushed in enumerate(driven, start=2):
        phi[t] = first @ phi[t - 1] + second @ phi[t - 2] + pushed
    return phi[2:]


def with_tissue(body: Body, tissue: SoftTissue) -> SkinnedBody:
    """The body with B + C betas, the last C of which displace its tissue and move no joint.

    The regressor is the one nearest to the body's of those that give its joints (least squares).
    With a block phi (C,) of coefficients its points are those of a person's tissue in symbols:
    `points(pose, cs.vertcat(betas, tissue.gain_of(body, betas) * phi), trans)`. Raises BadArgument
    for a body that this is not the tissue of.
    """
    body = tissue._checked(body)
    N = body.n_vertices
    known = np.hstack([np.ones((N, 1)), body.template, body.shapedirs.reshape(N, -1)])
    every = np.hstack([known, tissue.directions.reshape(N, -1)])
    targets = np.zeros((body.n_joints, every.shape[1]))
    targets[:, : known.shape[1]] = body.J_regressor @ known
    change = np.linalg.lstsq(every.T, (targets - body.J_regressor @ every).T)[0].T
    return replace(
        body,
        shapedirs=np.concatenate([body.shapedirs, tissue.directions], axis=2),
        J_regressor=csr_array(body.J_regressor.toarray() + change),
        capsules=None,
        extras={**body.extras, "tissue": np.array(tissue.n_coefficients)},
        name=f"{body.name} with soft tissue",
    )


def with_dmpls(body: SkinnedBody, path: str | Path, count: int = 8) -> SkinnedBody:
    """The body with B + C betas, of which the last C are those of DMPL's dynamic blend shapes.

    `path` is the file of DMPL for the body, dmpls/GENDER/model.npz with `eigvec` (N, 3, ...), of
    which AMASS uses the first 8. The body then moves as human_body_prior's BodyModel does, in which
    joints follow the displaced surface: a motion with `dmpls` plays them (`Motion.betas_on`).
    Raises BadFile for another file, or one for another number of vertices.
    """
    with opened(path, "file of DMPL's directions", "give dmpls/GENDER/model.npz") as archive:
        arrays = read_expected(archive, {"eigvec": reals("N", 3, "C")})
        directions = arrays["eigvec"][:, :, :count]
        if (N := len(directions)) != body.n_vertices:
            raise BadFile(f"it is for {N} vertices, and the body has {body.n_vertices}")
    return replace(
        body,
        shapedirs=np.concatenate([body.shapedirs, directions], axis=2),
        capsules=None,
        extras={**body.extras, "dmpls": np.array(directions.shape[2])},
        name=f"{body.name} with DMPL",
    )


def betas_with_tissue(
    body: Body, tissue: SoftTissue, motion: Motion, exaggeration: float = 1.0
) -> Array:
    """The betas (T, B + C) of `with_tissue` in a motion of the tissue's rate, frame by frame.

    Raises BadArgument for another rate or another body.
    """
    body = tissue._checked(body)
    phi = tissue.coefficients(body, motion)
    gain = exaggeration * tissue.gain(body, motion.named(body).betas)
    betas = np.broadcast_to(motion.betas_on(body), (len(motion), body.n_betas))
    return np.hstack([betas, gain * phi])


def displaced_by(tissue: SoftTissue, betas: Array) -> Array:
    """How far tissue is displaced at rest, (T, N, 3) m, by betas (T, B + C) of a body with it."""
    phi = betas[:, betas.shape[1] - tissue.n_coefficients :]
    displaced: Array = np.einsum("tc,ndc->tnd", phi, tissue.directions)
    return displaced


# What drives soft tissue: velocities and accelerations of joints, of the root, of soft parts.

GRAVITY = np.array([0.0, -9.81, 0.0])  # m/s^2


@dataclass(frozen=True, eq=False)
class MovingFrames:
    """The frames of a body's joints along a motion, whose joints are those of the body.

    Attributes:
        body: the body.
        motion: the motion, under the names of the body's joints.
    """

    body: SkinnedBody
    motion: Motion

    @staticmethod
    def of(body: SkinnedBody, motion: Motion) -> "MovingFrames":
        """Of a motion, named as the body (`Motion.named`). Raises BadArgument for few frames."""
        if len(motion) < 3:
            raise BadArgument(
                f"an acceleration needs three frames or more, and this motion has {len(motion)}"
            )
        return MovingFrames(body, motion.named(body))

    @cached_property
    def turns(self) -> Array:
        """How each joint has turned the skin that follows it, (T, K, 3, 3)."""
        body = self.body
        bound = Posing.of(body.bind_pose[None], body.parents).world[0]
        world = Posing.of(self.motion.pose, body.parents).world
        return np.asarray(world @ bound.swapaxes(-1, -2))

    @cached_property
    def joints(self) -> Array:
        """The posed joints, (T, K, 3) m."""
        return self.motion.joints(self.body)

    @cached_property
    def angular_velocities(self) -> Array:
        """Of each joint relative to its parent, in its own frame, (T, K, 3) rad/s.

        They are the logarithms of R_(t-1)' R_(t+1) over two frames, and do not see that a rotation
        vector may jump by a full turn.
        """
        local = Posing.of(self.motion.pose, self.body.parents).local
        turns = vector_from_matrix(local[:-2].swapaxes(-1, -2) @ local[2:])
        return _same_at_ends(turns * (self.motion.fps / 2))

    @cached_property
    def world_turning(self) -> Array:
        """The angular velocity of each joint's frame, in the world, (T, K, 3) rad/s."""
        R = self.turns
        turns = vector_from_matrix(R[2:] @ R[:-2].swapaxes(-1, -2))
        return _same_at_ends(turns * (self.motion.fps / 2))

    def forces(self, points: Array, joints: Index) -> Array:
        """What points (P, 3) m at rest feel that are fixed to joints (P,): (T, P, 3) m/s^2.

        In the frame of its joint, a point of mass one is pulled by R'(g - a), with gravity g and
        the acceleration a of its place. What it feels in the rest pose, g, is subtracted, because
        the body at rest has the form that gravity gives it.
        """
        R, at_rest = self.turns[:, joints], self.body.joints(None, self.motion.betas)
        arms = points - at_rest[joints]
        places = np.einsum("tpij,pj->tpi", R, arms) + self.joints[:, joints]
        force = GRAVITY - second_differences(places, self.motion.fps)
        return np.asarray(np.einsum("tpji,tpj->tpi", R, force) - GRAVITY)


def first_differences(values: Array, fps: float) -> Array:
    """The central differences (T, ...) a second; at the ends those next to them."""
    return _same_at_ends((values[2:] - values[:-2]) * (fps / 2))


def second_differences(values: Array, fps: float) -> Array:
    """The second differences (T, ...) a second squared; at the ends those next to them."""
    return _same_at_ends((values[2:] - 2 * values[1:-1] + values[:-2]) * fps**2)


def _same_at_ends(inner: Array) -> Array:
    return np.concatenate([inner[:1], inner, inner[-1:]])


FASTEST_TURN, FASTEST_CHANGE = 8.0, 80.0  # rad/s, rad/s^2
FASTEST_ROOT, HARDEST_PUSH = 4.0, 25.0  # m/s, m/s^2
STRONGEST_FORCE = 20.0  # m/s^2: about two more gravities


def tissue_inputs(frames: MovingFrames, part: Index, n_betas: int = 0) -> Array:
    """The inputs (T, X) along a motion, in this order:

    - the angular velocity of each joint relative to its parent (rad/s), and its derivative
      (rad/s^2), the root's first;
    - velocity and acceleration of the root, in its own frame (m/s, m/s^2);
    - what the middle of each soft part feels in the frame of its joint (m/s^2): gravity less
      acceleration, less what it feels at rest (`MovingFrames.forces`);
    - the first `n_betas` betas, and 1.

    Each vector v of these is a share of its bound m, the constants above: v / sqrt(m^2 + |v|^2),
    which is about v / m where it is small and never longer than 1. So whatever a motion holds, such
    as a joint that flips between two frames of a recording, the coefficients of a stable model stay
    bounded, and fast motion moves tissue less than in proportion, as tissue stiffens when it is
    stretched.

    All but the forces are those of Dyna (Pons-Moll et al., 2015). The forces are no linear function
    of them: they depend on where down is, and on how far a part is from the joints that turn.
    """
    body, motion = frames.body, frames.motion
    spin = frames.angular_velocities
    T = len(spin)
    R = frames.turns[:, 0].swapaxes(-1, -2)
    root = frames.joints[:, 0]
    moving = (first_differences(root, motion.fps), second_differences(root, motion.fps))
    velocity, acceleration = (np.einsum("tij,tj->ti", R, line) for line in moving)
    middles, joints = part_middles(body, part, motion.betas)
    betas = np.zeros(n_betas)
    count = min(n_betas, len(motion.betas))
    betas[:count] = motion.betas[:count]
    parts = [
        _bounded(spin, FASTEST_TURN),
        _bounded(first_differences(spin, motion.fps), FASTEST_CHANGE),
        _bounded(velocity[:, None], FASTEST_ROOT),
        _bounded(acceleration[:, None], HARDEST_PUSH),
        _bounded(frames.forces(middles, joints), STRONGEST_FORCE),
        np.tile(betas, (T, 1)),
        np.ones((T, 1)),
    ]
    return np.hstack(parts)


def _bounded(vectors: Array, most: float) -> Array:
    """Vectors (T, V, 3) as shares of `most`, smoothly kept shorter than 1, as rows (T, 3 V)."""
    square = (vectors**2).sum(axis=-1, keepdims=True)
    shares = vectors / np.sqrt(most**2 + square)
    return np.asarray(shares.reshape(len(vectors), -1))


def part_middles(body: SkinnedBody, part: Index, betas: Array) -> tuple[Array, Index]:
    """The middle of each soft part at rest, (P, 3) m, and the joint that moves most of it, (P,)."""
    surface = body.vertices(body.bind_pose, betas)
    members = [np.flatnonzero(part == p) for p in range(int(part.max(initial=-1)) + 1)]
    middles = np.array([surface[vertices].mean(axis=0) for vertices in members]).reshape(-1, 3)
    joints = [int(body.weights[vertices].sum(axis=0).argmax()) for vertices in members]
    return middles, np.array(joints, dtype=np.int64)


EXPECTED = {
    "directions": reals("N", 3, "C"),
    "first": reals("C", "C"),
    "second": reals("C", "C"),
    "response": reals("C", "X"),
    "part": wholes("N"),
    "fps": reals(),
    "power": reals(),
    "n_betas": wholes(),
    "joint_names": texts("K"),
    "card": texts(),
}


def save_tissue(path: str | Path, tissue: SoftTissue) -> None:
    """Write soft tissue as an .npz, in single precision. Raises BadFile."""
    reals_of = ("directions", "first", "second", "response", "fps", "power")
    arrays = {name: np.asarray(getattr(tissue, name), np.float32) for name in reals_of}
    others = {
        "part": tissue.part.astype(np.int16),
        "n_betas": np.array(tissue.n_betas),
        "joint_names": np.array(tissue.joint_names),
        "card": np.array(json.dumps(dict(tissue.card))),
    }
    write_arrays(path, {**arrays, **others})


def load_tissue(name_or_path: str | Path = "default") -> SoftTissue:
    """The embedded soft tissue of the body `default`, or that of a file of `save_tissue`.

    The embedded one was learned from simulated tissue (`data/tissue/PROVENANCE.md`). Raises BadFile
    if there is no such file, or it holds something else.
    """
    if name_or_path == "default":
        with as_file(files("workbench") / "data" / "tissue" / "default.npz") as path:
            return _read(path)
    path = expanded(name_or_path)
    if not path.exists():
        raise BadFile(
            f"no soft tissue is called {str(name_or_path)!r}, and there is no such file; there is "
            "'default', or give an .npz that save_tissue wrote"
        )
    return _read(path)


def _read(path: Path) -> SoftTissue:
    with opened(path, "soft tissue", "give an .npz that save_tissue wrote") as archive:
        arrays: dict[str, Any] = read_expected(archive, EXPECTED)
        try:
            card = json.loads(str(arrays.pop("card")))
            numbers = {name: arrays.pop(name).item() for name in ("fps", "power", "n_betas")}
            names = tuple(map(str, arrays.pop("joint_names")))
            card = card if isinstance(card, dict) else {}
            return SoftTissue(**arrays, **numbers, joint_names=names, card=card)
        except (BadArgument, ValueError) as error:
            raise BadFile(str(error)) from error
