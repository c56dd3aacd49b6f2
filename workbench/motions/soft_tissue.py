"""Soft tissue that follows a motion: dynamic blend shapes, and a model of their coefficients.

Dynamic blend shapes are added to the rest surface, as those of shape and pose are (Pons-Moll et
al., Dyna, 2015, and DMPL in Loper et al., SMPL, 2015, section 7):

    T = template + B_S(betas) + B_P(pose) + gain(betas) sum_c phi_c D_c

Their coefficients at frame t follow from those of the two frames before and from what moves,

    phi_t = A_1 phi_(t-1) + A_2 phi_(t-2) + B x_t

with x_t the inputs of `tissue_inputs`. Joints are those of the person without tissue, as in the
paper.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, eye_array

from workbench.arrays import Array, Index
from workbench.blocks import Block, Points
from workbench.blocks.checks import reals
from workbench.bodies import Landmarks, SkinnedBody
from workbench.bodies.body import why_not_skinned
from workbench.bodies.readonly import locked
from workbench.bodies.spaces import body_mass_index
from workbench.errors import BadArgument
from workbench.motions.accelerations import MovingFrames
from workbench.motions.motion import Motion
from workbench.motions.splines import FEWEST, splined
from workbench.motions.tissue_inputs import tissue_inputs

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
        given = {name: reals(name, getattr(self, name)) for name in names}
        given["part"] = np.asarray(self.part, dtype=np.int64)
        N, C = given["directions"].shape[0], given["directions"].shape[-1]
        X = 6 * len(self.joint_names) + 6 + 3 * (int(given["part"].max(initial=-1)) + 1)
        shapes = {"directions": (N, 3, C), "first": (C, C), "second": (C, C), "part": (N,)}
        shapes["response"] = (C, X + self.n_betas + 1)
        for name, shape in shapes.items():
            if given[name].shape != shape or not np.isfinite(given[name]).all():
                raise BadArgument(
                    f"{name} of soft tissue are {shape} finite numbers, not {given[name].shape}"
                )
        if not self.fps > 0:
            raise BadArgument(f"fps is a number above 0, not {self.fps!r:.60}")
        self.__dict__.update({name: locked(array.copy()) for name, array in given.items()})
        if not (radius := self.spectral_radius) < LARGEST_RADIUS:
            raise BadArgument(
                f"the model of the coefficients has a spectral radius of {radius:.4f}, so that "
                f"they would not die away; make it less than {LARGEST_RADIUS}, as "
                "training.soft_tissue.stabilized does"
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
        x = tissue_inputs(frames, self.part, self.n_betas).values
        return free_run(self.first, self.second, x @ self.response.T)

    def displacements(self, body: SkinnedBody, coefficients: ArrayLike, betas: Any = None) -> Array:
        """What coefficients (..., C) add to the rest surface of a person, (..., N, 3) m."""
        phi = reals("coefficients", coefficients)
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

    # In symbols: coefficients as a block like any other, to be fitted as DMPL's are.

    def block(self, prefix: str = "") -> Block:
        """`tissue` (C,), the coefficients phi as an unknown; they have no unit."""
        return Block(f"{prefix}tissue", (self.n_coefficients,), "1")

    def points(
        self, body: SkinnedBody, pose: cs.MX, betas: cs.MX, trans: cs.MX, coefficients: cs.MX
    ) -> Points:
        """The posed surface (3, N) m, with coefficients (C, 1) that are symbols or numbers.

        The gain is that of the mean person, because a body mass index is not linear in betas.
        Points of one problem come from one body: pass the same `surface_as_landmarks(body)` to
        all of them, or let this make one.
        """
        whole = body if "surface" in body.landmarks else surface_as_landmarks(body)
        flat = cs.DM(self.directions.reshape(-1, self.n_coefficients))
        moved = cs.reshape(flat @ coefficients, 3, body.n_vertices)
        return whole.landmark_points("surface", pose, betas, trans, offsets=moved)

    def _check(self, body: SkinnedBody, motion: Motion) -> None:
        if reason := why_not_skinned(body, "soft tissue", "give the skinned body it was made from"):
            raise BadArgument(reason)
        if body.n_vertices != len(self.part) or tuple(body.joint_names) != self.joint_names:
            raise BadArgument(
                f"this soft tissue is that of {self.card.get('body', 'another body')!r} with "
                f"{len(self.part)} vertices and {len(self.joint_names)} joints, not that of body "
                f"{body.name!r} with {body.n_vertices} and {body.n_joints}"
            )
        if abs(motion.fps / self.fps - 1) > SAME_RATE:
            do = "tissue.prepared(motion) splines it" if len(motion) >= FEWEST else "record it anew"
            raise BadArgument(
                f"this soft tissue moves at {self.fps:g} frames a second, and the motion has "
                f"{motion.fps:g}; {do}"
            )


def companion(first: Array, second: Array) -> Array:
    """The matrix (2 C, 2 C) that takes (phi_(t-1), phi_(t-2)) to (phi_t, phi_(t-1))."""
    C = len(first)
    return np.block([[first, second], [np.eye(C), np.zeros((C, C))]])


def free_run(first: Array, second: Array, driven: Array, start: Array | None = None) -> Array:
    """phi_t = A_1 phi_(t-1) + A_2 phi_(t-2) + driven_t, from zeros or from `start` (2, C)."""
    found = np.zeros((len(driven) + 2, driven.shape[1]))
    if start is not None:
        found[:2] = start
    for t, pushed in enumerate(driven, start=2):
        found[t] = first @ found[t - 1] + second @ found[t - 2] + pushed
    return found[2:]


def surface_as_landmarks(body: SkinnedBody) -> SkinnedBody:
    """The body with a set of landmarks `surface`, one for each vertex."""
    names = tuple(map(str, range(body.n_vertices)))
    every = Landmarks(names, csr_array(eye_array(body.n_vertices)))
    return replace(body, landmarks={**body.landmarks, "surface": every})
