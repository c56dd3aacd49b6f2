"""Linearly blended bodies: SMPL and its relatives."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, ClassVar

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.blocks import Block, Points
from workbench.blocks.checks import reals
from workbench.bodies.body import (
    Body,
    Given,
    Landmarks,
    arguments,
    check_prefix,
    landmark_set,
    no_offsets,
    of_joints,
)
from workbench.bodies.capsules import Capsules
from workbench.bodies.forward.mesh import batch_points
from workbench.bodies.forward.motion import Kinematics
from workbench.bodies.forward.posed_points import BodyNumbers
from workbench.bodies.forward.skinning import Skinning, linear_blend
from workbench.bodies.forward.sources import (
    Arguments,
    joint_points,
    landmark_points,
    surface_points,
)
from workbench.bodies.forward.surface import ALL, Features, rotation_elements
from workbench.bodies.readonly import readonly_parts
from workbench.bodies.validation import check_skinned, chosen_vertices
from workbench.errors import BadBody

REALS = ("template", "shapedirs", "posedirs", "weights", "bound_in", "rest_joints")


@dataclass(frozen=True, eq=False)
class SkinnedBody(Body):
    """N vertices on K joints with B shape directions, in the arrays of SMPL's files.

    Metres, y up, facing +z. The arrays are numbers; those in `free` are symbols in every
    expression as well, so that training a body is a fit with other names free.

    Raises BadBody if the arrays do not fit together. `freed` takes `joints` (K, 3) m as well: the
    joints at rest of every person, in place of J_regressor. `with_values` makes them
    `rest_joints`; J_regressor is kept, but does not find them: train it on bodies of several
    shapes, and then replace `rest_joints` by None.

    Attributes (beside those of every Body):
        shapedirs: (N, 3, B) m per unit of betas.
        posedirs: (N, 3, F) m per unit of pose feature; F is 9 (K - 1) as in SMPL, and
            4 (K - 1) + 1 as in STAR.
        J_regressor: (K, N) from rest vertices to joints; rows sum to one.
        weights: (N, K) skinning weights; rows sum to one.
        mirror: (N,) the vertex on the other side of each, or None.
        skinning: how the motions of joints are blended.
        features: the functions of the pose that posedirs are multiplied with; those of STAR are
            functions of beta_2 as well.
        bound_in: (K, 3) rad, the pose that the template is drawn in; None is the zero pose.
        rest_joints: (K, 3) m, the same for everybody; None if J_regressor finds each person's.
        capsules: tubes with round ends that stand for it in self-contact; see `fit_capsules`.
    """

    template: Array
    shapedirs: Array
    posedirs: Array
    J_regressor: csr_array
    weights: Array
    parents: tuple[int, ...]
    faces: Index
    joint_names: tuple[str, ...]
    mirror: Index | None = None
    landmarks: Mapping[str, Landmarks] = field(default_factory=dict)
    skinning: Skinning = linear_blend
    features: Features = rotation_elements
    name: str = "body"
    card: Mapping[str, Any] = field(default_factory=dict)
    bound_in: Array | None = None
    rest_joints: Array | None = None
    extras: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    capsules: Capsules | None = None
    free: Mapping[str, Block] = field(default_factory=dict)

    FREEABLE: ClassVar[Mapping[str, str]] = {
        "template": "m",
        "shapedirs": "m",
        "posedirs": "m",
        "J_regressor": "1",
        "weights": "1",
        "joints": "m",  # at rest, (K, 3), in place of J_regressor (T + S betas)
    }

    def __post_init__(self) -> None:
        for name in ("skinning", "features"):
            if not callable(getattr(self, name)):
                raise BadBody(
                    f"body {self.name!r}: {name} is a function, such as linear_blend for skinning "
                    f"and rotation_elements for features, not {getattr(self, name)!r:.80}"
                )
        matrices, indices = ("J_regressor",), ("faces", "mirror")
        self.__dict__.update(readonly_parts(self, REALS, matrices, indices, ("landmarks", "free")))
        check_skinned(self)

    @property
    def n_betas(self) -> int:
        """B, the number of shape directions."""
        return int(self.shapedirs.shape[2])

    @property
    def is_smpl(self) -> bool:
        """Whether skinning and pose features are SMPL's, for which there is fast arithmetic."""
        return self.skinning is linear_blend and self.features is rotation_elements

    @property
    def bind_pose(self) -> Array:
        """The pose (K, 3) rad that leaves the template as it is."""
        return super().bind_pose if self.bound_in is None else self.bound_in.copy()

    @property
    def vertex_weights(self) -> Array:
        """How much each vertex follows each joint, (N, K): its skinning weights."""
        return self.weights

    # What a problem is written with.

    @cached_property
    def _offsets(self) -> dict[tuple[str, str], Block]:
        return {}

    @property
    def known_blocks(self) -> tuple[Block, ...]:
        """Every block that this body has made so far."""
        return (*super().known_blocks, *self._offsets.values())

    def offsets(self, name: str, prefix: str = "") -> Block:
        """`offsets` (M, 3) m of a set of landmarks: the same object for the same set and prefix.

        See `landmark_points`. Raises UnknownName, and NotSupported for joints.
        """
        if of_joints(name):
            raise no_offsets("of joints")
        names = landmark_set(self.landmarks, name).names
        check_prefix(prefix)
        if (prefix, name) not in self._offsets:
            block = Block(prefix + "offsets", (len(names), 3), "m", names)
            self._offsets[prefix, name] = block
        return self._offsets[prefix, name]

    def array(self, name: str) -> Array:
        """One of the arrays that can be freed, dense; `joints` are those of the mean person.

        Raises UnknownName.
        """
        return self.numeric.skeleton.mean if of_joints(name) else super().array(name)

    def _replaced(self, **parts: Any) -> "SkinnedBody":
        if "joints" in parts:
            parts["rest_joints"] = parts.pop("joints")
        other = super()._replaced(**parts)
        other.__dict__["_offsets"] = self._offsets
        return other

    def points(
        self, pose: cs.MX, betas: cs.MX, trans: cs.MX, *, vertices: ArrayLike | None = None
    ) -> Points:
        """The posed surface, (3, N) m, or some of it: a list of vertices, or a mask (N,)."""
        symbols = Arguments(self, pose, betas, trans)
        chosen = ALL if vertices is None else chosen_vertices(self, vertices)
        return Points.of(surface_points(self, symbols, self.numeric, chosen), "vertices")

    def joint_points(self, pose: cs.MX, betas: cs.MX, trans: cs.MX) -> Points:
        """The posed joints, (3, K) m."""
        symbols = Arguments(self, pose, betas, trans)
        return Points.of(joint_points(self, symbols, self.numeric), "joints")

    def _mean_points(
        self,
        landmarks: Landmarks,
        name: str,
        symbols: tuple[cs.MX, cs.MX, cs.MX],
        displaced: tuple[Block, cs.MX] | None,
    ) -> Points:
        inputs = Arguments(self, *symbols, displaced)
        return Points.of(landmark_points(self, inputs, self.numeric, landmarks), name)

    # Points in numbers. Any argument may have batch axes in front.

    def vertices(self, pose: Given = None, betas: Given = None, trans: Given = None) -> Array:
        """The posed surface (..., N, 3) m of poses (..., K, 3) or (..., 3 K) rad."""
        batch, (theta, beta, move) = arguments(self, pose, betas, trans)
        numeric = self.numeric
        if self.is_smpl:
            surfaces = batch_points(numeric.chunks, numeric.kinematics.motion(theta, beta), beta)
        else:
            surfaces = _each(numeric.skinned_rest, self.n_vertices, theta, beta)
        return (surfaces + move[:, None]).reshape(*batch, self.n_vertices, 3)

    def joints(self, pose: Given = None, betas: Given = None, trans: Given = None) -> Array:
        """The posed joints (..., K, 3) m."""
        batch, (theta, beta, move) = arguments(self, pose, betas, trans)
        joints = self.kinematics.motion(theta, beta).joints + move[:, None]
        return joints.reshape(*batch, self.n_joints, 3)

    def _displaced(self, name: str, state: tuple[Given, Given, Given], offsets: ArrayLike) -> Array:
        if of_joints(name):
            raise no_offsets("of joints")
        landmarks = landmark_set(self.landmarks, name)
        shifts, count = reals("offsets", offsets), len(landmarks.names)
        if shifts.shape[-2:] != (count, 3):
            raise BadBody(
                f"body {self.name!r} takes offsets of shape (..., {count}, 3) for {count} "
                f"landmarks, not {shifts.shape}"
            )
        batch, (theta, beta, move, shifts) = arguments(self, *state, shifts)
        if self.is_smpl:
            points = self.numeric.landmarks(landmarks).evaluate_batch(theta, beta, move, shifts)
        else:
            posed = self.numeric.displaced_rest(landmarks)
            points = _each(posed, count, theta, beta, shifts) + move[:, None]
        return points.reshape(*batch, count, 3)

    @cached_property
    def numeric(self) -> BodyNumbers:
        """What numbers are computed with; free arrays have the numbers that they start from."""
        # not the body itself: what refers to itself is not freed before the garbage collector runs
        fixed = object.__new__(SkinnedBody)
        fixed.__dict__.update(
            {part.name: getattr(self, part.name) for part in fields(self)}, free={}
        )
        return BodyNumbers(fixed)

    @property
    def kinematics(self) -> Kinematics:
        """The joints' motions and their derivatives in numbers."""
        return self.numeric.kinematics


def _each(graph: cs.Function, count: int, *arguments: Array) -> Array:
    """The points (M, count, 3) of a graph at each of M arguments."""
    points = [np.asarray(graph(*(a.T for a in point))).T for point in zip(*arguments, strict=True)]
    return np.array(points).reshape(len(arguments[0]), count, 3)
