"""A body whose surface is skinned to its joints: SMPL and its relatives."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout, Points, Values
from workbench.bodies.body import Given, blocks_of, landmark_set, no_offsets, offsets_of
from workbench.bodies.capsules import Capsules
from workbench.bodies.forward import evaluation
from workbench.bodies.forward.features import Features, rotation_elements
from workbench.bodies.forward.freeing import FREEABLE, check_freeable
from workbench.bodies.forward.motion import Kinematics
from workbench.bodies.forward.posed_points import BodyNumbers
from workbench.bodies.forward.skinning import Skinning, linear_blend
from workbench.bodies.forward.sources import (
    Arguments,
    joint_points,
    landmark_points,
    surface_points,
)
from workbench.bodies.forward.surface import ALL
from workbench.bodies.landmarks import Landmarks
from workbench.bodies.readonly import locked, parts_of, readonly_parts, remade
from workbench.bodies.validation import check, chosen_vertices
from workbench.errors import BadBody, NotSupported, UnknownName

REALS = ("template", "shapedirs", "posedirs", "weights", "bound_in", "rest_joints")


@dataclass(frozen=True, eq=False)
class SkinnedBody:
    """N vertices on K joints with B shape directions, in the arrays of SMPL's files.

    Metres, y up, facing +z. The arrays are numbers; those in `free` are symbols in every
    expression as well, so that training a body is a fit with other names free.

    `extras`, such as the principal components of MANO's hands, go where the body goes, and
    `save_body` writes them back.

    A body never changes: it keeps read-only copies of what it is given (float64, int64; read-only
    arrays as they are), and dataclasses.replace makes another. It pickles and copies; the copy
    has the same numbers and blocks of its own. Raises BadBody if the arrays do not fit together.

    Attributes:
        template: (N, 3) m, the mean rest surface.
        shapedirs: (N, 3, B) m per unit of betas.
        posedirs: (N, 3, F) m per unit of pose feature; F is 9 (K - 1) as in SMPL, and
            4 (K - 1) + 1 as in STAR.
        J_regressor: (K, N) from rest vertices to joints; rows sum to one.
        weights: (N, K) skinning weights; rows sum to one.
        parents: (K,) with parents[0] == -1 and parents[k] < k.
        faces: (F, 3).
        joint_names: (K,).
        mirror: (N,) the vertex on the other side of each, or None.
        landmarks: sets of landmarks by name.
        skinning: how the motions of joints are blended.
        features: the functions of the pose that posedirs are multiplied with; those of STAR are
            functions of beta_2 as well.
        name: what the body is called.
        card: where its numbers come from.
        bound_in: (K, 3) rad, the pose that the template is drawn in; None is the zero pose.
        rest_joints: (K, 3) m, the same for everybody; None if J_regressor finds each person's.
        extras: arrays of its file that nothing computes with.
        capsules: tubes with round ends that stand for it in self-contact; see `fit_capsules`.
        free: the arrays that are unknowns, as blocks by name.
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
    _made: dict[str, tuple[Block, Block, Block]] = field(
        default_factory=dict, init=False, repr=False
    )
    _offsets: dict[tuple[str, str], Block] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("skinning", "features"):
            if not callable(getattr(self, name)):
                raise BadBody(
                    f"body {self.name!r}: {name} is a function, such as linear_blend for skinning "
                    f"and rotation_elements for features, not {getattr(self, name)!r:.80}"
                )
        matrices, indices = ("J_regressor",), ("faces", "mirror")
        self.__dict__.update(readonly_parts(self, REALS, matrices, indices, ("landmarks", "free")))
        check(self)

    def __reduce__(self) -> tuple[Any, ...]:
        """Its parts, without the blocks it made and what it computed with."""
        return remade, (SkinnedBody, parts_of(self))

    @property
    def n_vertices(self) -> int:
        """N, the number of vertices."""
        return len(self.template)

    @property
    def n_joints(self) -> int:
        """K, the number of joints, the root included."""
        return len(self.parents)

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
        return np.zeros((self.n_joints, 3)) if self.bound_in is None else self.bound_in.copy()

    @property
    def vertex_weights(self) -> Array:
        """How much each vertex follows each joint, (N, K): its skinning weights."""
        return self.weights

    # What a problem is written with.

    def blocks(self, prefix: str = "") -> tuple[Block, Block, Block]:
        """`pose` (K, 3) rad, `betas` (B,), `trans` (3,) m: the same objects for the same prefix."""
        return blocks_of(self, prefix, self._made)

    def offsets(self, name: str, prefix: str = "") -> Block:
        """`offsets` (M, 3) m of a set of landmarks: the same object for the same set and prefix.

        See `landmark_points`. Raises UnknownName, and NotSupported for joints.
        """
        return offsets_of(self.landmarks, name, prefix, self._offsets)

    @property
    def known_blocks(self) -> tuple[Block, ...]:
        """Every block that this body has made so far."""
        own = (block for blocks in self._made.values() for block in blocks)
        return (*own, *self._offsets.values(), *self.free.values())

    def freed(self, *names: str, prefix: str = "") -> "SkinnedBody":
        """A body with the same numbers, whose named arrays are unknowns in every expression.

        It shares its blocks with this one, so that points of either fit into one problem. `joints`
        (K, 3) m are the joints at rest of every person; if they are free, J_regressor is not used.

        Raises UnknownName, and BadBody for `joints` together with `J_regressor`, of which only one
        would be read.
        """
        check_freeable(self, names)
        made = {n: Block(prefix + n, self.array(n).shape, FREEABLE[n]) for n in names}
        return self._sharing_blocks(replace(self, free={**self.free, **made}))

    def with_values(self, values: Mapping[str, ArrayLike]) -> "SkinnedBody":
        """The trained body: each free array has its value among `values`, and is free no longer.

        Joints that were free become `rest_joints`, the same for every person. J_regressor is kept,
        but does not find them: train it on bodies of several shapes, and then replace `rest_joints`
        by None.

        Raises MissingValue, NotNumbers, ShapeMismatch or NonFiniteValue for a value, and BadBody
        where the arrays no longer fit together, as weights that do not sum to one.
        """
        found: dict[str, Any] = {
            name: locked(Layout((block,)).pack(values).reshape(block.shape))
            for name, block in self.free.items()
        }
        if "joints" in found:
            found["rest_joints"] = found.pop("joints")
        return self._sharing_blocks(replace(self, free={}, **found))

    def _sharing_blocks(self, other: "SkinnedBody") -> "SkinnedBody":
        other.__dict__.update(_made=self._made, _offsets=self._offsets)
        return other

    def start(self, prefix: str = "") -> Values:
        """Values at which the body is its template.

        They are the bind pose, and betas and trans of zero, under names that begin with `prefix`;
        and the present numbers of the arrays that are free, under names of their own.
        """
        pose, betas, trans = self.blocks(prefix)
        return {
            pose.name: self.bind_pose,
            betas.name: np.zeros(betas.shape),
            trans.name: np.zeros(trans.shape),
            **{block.name: self.array(name).copy() for name, block in self.free.items()},
        }

    def points(
        self, pose: cs.MX, betas: cs.MX, trans: cs.MX, *, vertices: ArrayLike | None = None
    ) -> Points:
        """The posed surface, (3, N) m, or some of it: a list of vertices, or a mask (N,)."""
        at = Arguments(self, pose, betas, trans)
        chosen = ALL if vertices is None else chosen_vertices(self, vertices)
        return Points.of(surface_points(self, at, self.numeric, chosen), "vertices")

    def joint_points(self, pose: cs.MX, betas: cs.MX, trans: cs.MX) -> Points:
        """The posed joints, (3, K) m."""
        at = Arguments(self, pose, betas, trans)
        return Points.of(joint_points(self, at, self.numeric), "joints")

    def landmark_points(
        self, name: str, pose: cs.MX, betas: cs.MX, trans: cs.MX, offsets: cs.MX | None = None
    ) -> Points:
        """A named set of landmarks on the posed surface, (3, M) m; `joints` are always there.

        `offsets` (3, M) m displace each landmark at rest, and move with the body: landmark m is
        the mean of its vertices v_i + o_m, each moved as the vertex is. Markers on skin or clothes
        are such landmarks (Loper et al., MoSh, 2014). They are the symbol of `offsets(name)`, or
        an expression of blocks. Raises UnknownName, BadBody, and NotSupported for joints.
        """
        if isinstance(name, str) and name == "joints":
            if offsets is not None:
                raise NotSupported(no_offsets("of joints"))
            return self.joint_points(pose, betas, trans)
        found = landmark_set(self.landmarks, name)
        displaced = None if offsets is None else (self.offsets(name), offsets)
        at = Arguments(self, pose, betas, trans, displaced)
        return Points.of(landmark_points(self, at, self.numeric, found), name)

    # Points in numbers. Any argument may have batch axes in front.

    def vertices(self, pose: Given = None, betas: Given = None, trans: Given = None) -> Array:
        """The posed surface (..., N, 3) m of poses (..., K, 3) or (..., 3 K) rad."""
        return evaluation.vertices(self.numeric, pose, betas, trans)

    def joints(self, pose: Given = None, betas: Given = None, trans: Given = None) -> Array:
        """The posed joints (..., K, 3) m."""
        return evaluation.joints(self.numeric, pose, betas, trans)

    def landmark(
        self,
        name: str,
        pose: Given = None,
        betas: Given = None,
        trans: Given = None,
        offsets: Given = None,
    ) -> Array:
        """A named set of landmarks (..., M, 3) m; `joints` are always there.

        `offsets` (..., M, 3) m displace them at rest, with the errors of `landmark_points`.
        """
        if isinstance(name, str) and name == "joints":
            if offsets is not None:
                raise NotSupported(no_offsets("of joints"))
            return self.joints(pose, betas, trans)
        found = landmark_set(self.landmarks, name)
        if offsets is not None:
            return evaluation.displaced(self.numeric, found, (pose, betas, trans), offsets)
        return evaluation.regressed(found.regressor, self.vertices(pose, betas, trans))

    def landmark_names(self, name: str) -> tuple[str, ...]:
        """The names of the points of a landmark set."""
        return self.joint_names if name == "joints" else landmark_set(self.landmarks, name).names

    def array(self, name: str) -> Array:
        """One of the arrays that can be freed, dense; `joints` are those of the mean person.

        Raises UnknownName.
        """
        if not isinstance(name, str) or name not in FREEABLE:
            raise UnknownName("array of a body", str(name), FREEABLE)
        if name == "joints":
            return self.numeric.skeleton.mean
        array = getattr(self, name)
        return array.toarray() if isinstance(array, csr_array) else array

    @cached_property
    def numeric(self) -> BodyNumbers:
        """What numbers are computed with; free arrays have the numbers that they start from."""
        # not the body itself: what refers to itself is not freed before the garbage collector runs
        parts = {part.name: getattr(self, part.name) for part in fields(self)}
        alone = object.__new__(SkinnedBody)
        alone.__dict__.update(parts | {"free": {}})
        return BodyNumbers(alone)

    @property
    def kinematics(self) -> Kinematics:
        """The joints' motions and their derivatives in numbers."""
        return self.numeric.kinematics
