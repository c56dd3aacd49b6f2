"""A body whose triangles deform one by one and are stitched: SCAPE and BlendSCAPE."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout, Points, Values
from workbench.bodies.body import Blocks, Given, blocks_of, landmark_set, no_offsets
from workbench.bodies.forward import evaluation
from workbench.bodies.forward.arguments import Arguments
from workbench.bodies.landmarks import Landmarks
from workbench.bodies.readonly import parts_of, readonly_parts, remade
from workbench.bodies.triangles import surface
from workbench.bodies.triangles.arithmetic import TriangleArithmetic
from workbench.bodies.triangles.packed import PackedTriangles
from workbench.bodies.triangles.sources import mean_points, surface_points
from workbench.bodies.triangles.validation import check
from workbench.bodies.validation import chosen_vertices
from workbench.errors import NotSupported, UnknownName
from workbench.geometry.triangles import Stitching

FREEABLE = {"template": "m", "shapedirs": "1", "posedirs": "1/rad"}  # and their units


@dataclass(frozen=True, eq=False)
class TriangleBody:
    """F triangles on N vertices, moved by K joints and B shape directions.

        X_f = B_f(pose) D_f(betas) Q_f(pose)                                  (3 x 3)
        B_f = sum over k of weights[f, k] R_k        the parts' rotations in the world, blended
        D_f = I + shapedirs[f] betas                 who it is
        Q_f = I + posedirs[f] (twists of the joints near[f])      what bending does to the skin

    and the vertices are those whose edges are nearest to X_f e_f: stitching, one sparse solve.
    With one weight per face this is SCAPE (Anguelov et al. 2005), its Q without the seventh,
    constant, column, which belongs to the template; with several, BlendSCAPE (Hirshberg et al.
    2012), whose B_f is no rotation where parts turn against each other.

    A twist is the joint's own rotation vector as it stands in the pose, in radians: Q grows with
    it and does not come back at 2 pi, which is a property of the model. Stitching leaves the
    place open; here the root joint, as J_regressor finds it on the posed surface, stays where
    the template has it, plus trans. So the root turns the body about the pelvis, and all joints
    are those of the surface: these bodies have no chain of bones.

    Arrays are copied and read-only, as those of SkinnedBody. Raises BadBody if they do not fit.

    Attributes:
        template: (N, 3) m.
        faces: (F, 3), one connected surface.
        shapedirs: (F, 3, 3, B) per unit of betas.
        posedirs: (F, 3, 3, 3 J) per rad, joint by joint of `near`.
        near: (F, J) the joints, never the root, whose twists a face feels.
        weights: (F, K) how much each face belongs to each part; rows sum to one.
        J_regressor: (K, N) from vertices, at rest or posed, to joints; rows sum to one.
        parents: (K,) with parents[0] == -1 and parents[k] < k.
        joint_names: (K,).
        landmarks: sets of landmarks by name.
        name: what the body is called.
        card: where its numbers come from.
        extras: arrays of its file that nothing computes with.
        free: the arrays that are unknowns, by name; see `freed`.
    """

    template: Array
    faces: Index
    shapedirs: Array
    posedirs: Array
    near: Index
    weights: csr_array
    J_regressor: csr_array
    parents: tuple[int, ...]
    joint_names: tuple[str, ...]
    landmarks: Mapping[str, Landmarks] = field(default_factory=dict)
    name: str = "triangle body"
    card: Mapping[str, Any] = field(default_factory=dict)
    extras: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    free: Mapping[str, Block] = field(default_factory=dict)
    _made: dict[str, Blocks] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        reals, matrices = ("template", "shapedirs", "posedirs"), ("weights", "J_regressor")
        parts = readonly_parts(self, reals, matrices, ("faces", "near"), ("landmarks", "free"))
        self.__dict__.update(parts)
        check(self)

    def __reduce__(self) -> tuple[Any, ...]:
        """Its parts, without the blocks it made and what it computed with."""
        return remade, (TriangleBody, parts_of(self))

    @property
    def n_vertices(self) -> int:
        """N, the number of vertices."""
        return len(self.template)

    @property
    def n_faces(self) -> int:
        """F, the number of triangles."""
        return len(self.faces)

    @property
    def n_joints(self) -> int:
        """K, the number of joints, the root included."""
        return len(self.parents)

    @property
    def n_betas(self) -> int:
        """B, the number of shape directions."""
        return int(self.shapedirs.shape[3])

    @property
    def one_part_per_face(self) -> bool:
        """Whether each face belongs to a single part, as in SCAPE; in BlendSCAPE some do not."""
        return int(self.weights.count_nonzero()) == self.n_faces  # rows sum to one: none is zero

    @property
    def bind_pose(self) -> Array:
        """The pose (K, 3) rad that leaves the template as it is: zero."""
        return np.zeros((self.n_joints, 3))

    @property
    def vertex_weights(self) -> Array:
        """How much each vertex follows each joint, (N, K): the mean of its faces' weights."""
        corners = self.faces.ravel()
        shares = np.repeat(self.weights.toarray(), 3, axis=0) / np.bincount(corners)[corners, None]
        found = np.zeros((self.n_vertices, self.n_joints))
        np.add.at(found, corners, shares)
        return found

    # What a problem is written with.

    def blocks(self, prefix: str = "") -> Blocks:
        """`pose` (K, 3) rad, `betas` (B,), `trans` (3,) m: the same objects for the same prefix."""
        return blocks_of(self, prefix, self._made)

    @property
    def known_blocks(self) -> tuple[Block, ...]:
        """Every block that this body has made so far."""
        return (*(b for blocks in self._made.values() for b in blocks), *self.free.values())

    def freed(self, *names: str, prefix: str = "") -> "TriangleBody":
        """The same body, the named arrays being blocks of unknowns in every expression.

        `template`, `shapedirs` and `posedirs` can be free. It shares its blocks with this one, so
        that points of either fit into one problem. Its points have no arithmetic: CasADi
        differentiates the whole graph, which is fit for some hundred faces. Raises UnknownName.
        """
        for name in names:
            if not isinstance(name, str) or name not in FREEABLE:
                raise UnknownName("array to free", str(name), FREEABLE)
        made = {n: Block(prefix + n, getattr(self, n).shape, FREEABLE[n]) for n in names}
        return self._sharing_blocks(replace(self, free={**self.free, **made}))

    def with_values(self, values: Mapping[str, ArrayLike]) -> "TriangleBody":
        """The trained body: each free array has its value among `values`, and is free no longer.

        Raises MissingValue, NotNumbers, ShapeMismatch or NonFiniteValue for a value, and BadBody
        where the arrays no longer fit together.
        """
        found: dict[str, Any] = {
            name: Layout((block,)).pack(values).reshape(block.shape)
            for name, block in self.free.items()
        }
        return self._sharing_blocks(replace(self, free={}, **found))

    def _sharing_blocks(self, other: "TriangleBody") -> "TriangleBody":
        other.__dict__["_made"] = self._made
        return other

    def start(self, prefix: str = "") -> Values:
        """Values at which the body is its template.

        They are a pose, betas and trans of zero, under names that begin with `prefix`; and the
        present numbers of the arrays that are free, under names of their own.
        """
        zeros = {block.name: np.zeros(block.shape) for block in self.blocks(prefix)}
        return zeros | {b.name: getattr(self, name).copy() for name, b in self.free.items()}

    def points(
        self, pose: cs.MX, betas: cs.MX, trans: cs.MX, *, vertices: ArrayLike | None = None
    ) -> Points:
        """The posed surface, (3, N) m, or some of it: a list of vertices, or a mask (N,)."""
        at = Arguments(self, pose, betas, trans)
        if vertices is None:
            return Points.of(surface_points(at, self.arithmetic, self.free), "vertices")
        chosen = chosen_vertices(self, vertices)
        some = np.arange(len(chosen)), np.array(chosen, dtype=np.int64)
        selection = csr_array((np.ones(len(chosen)), some), shape=(len(chosen), self.n_vertices))
        names = tuple(f"vertex {i}" for i in chosen)
        return Points.of(mean_points(at, self.arithmetic, self.free, selection, names), "vertices")

    def deformed_edges(self, pose: cs.MX, betas: cs.MX) -> cs.MX:
        """X_f e_fi, (3, 2 F) m: the edges of every face in turn, before they are stitched."""
        first, second = surface.deformed(self.arithmetic.packed, pose, betas, self.free)
        return cs.reshape(cs.vertcat(first.T, second.T), 3, 2 * self.n_faces)

    def joint_points(self, pose: cs.MX, betas: cs.MX, trans: cs.MX) -> Points:
        """The joints as the posed surface has them, (3, K) m: J_regressor times its vertices."""
        at = Arguments(self, pose, betas, trans)
        regressor, names = self.J_regressor, self.joint_names
        source = mean_points(at, self.arithmetic, self.free, regressor, names)
        return Points.of(source, "joints")

    def landmark_points(
        self,
        name: str,
        pose: cs.MX,
        betas: cs.MX,
        trans: cs.MX,
        offsets: cs.MX | None = None,
    ) -> Points:
        """A named set of landmarks on the posed surface, (3, M) m; `joints` are always there.

        Raises UnknownName, BadBody for arguments of another shape, and NotSupported for offsets,
        which only landmarks of a SkinnedBody can have.
        """
        if offsets is not None:
            raise NotSupported(no_offsets(f"on body {self.name!r}, a TriangleBody"))
        if name == "joints":
            return self.joint_points(pose, betas, trans)
        found = landmark_set(self.landmarks, name)
        at = Arguments(self, pose, betas, trans)
        source = mean_points(at, self.arithmetic, self.free, found.regressor, found.names)
        return Points.of(source, name)

    # Points in numbers. Any argument may have batch axes in front.

    def vertices(self, pose: Given = None, betas: Given = None, trans: Given = None) -> Array:
        """The posed surface (..., N, 3) m of poses (..., K, 3) or (..., 3 K) rad."""
        batch, theta, beta, move = evaluation.arguments(self, pose, betas, trans)
        found = np.empty((len(theta), self.n_vertices, 3))
        for i in range(len(theta)):
            found[i] = self.arithmetic.evaluate(theta[i], beta[i], move[i]).points
        return found.reshape(*batch, self.n_vertices, 3)

    def joints(self, pose: Given = None, betas: Given = None, trans: Given = None) -> Array:
        """The joints of the posed surface (..., K, 3) m."""
        return evaluation.regressed(self.J_regressor, self.vertices(pose, betas, trans))

    def landmark(
        self,
        name: str,
        pose: Given = None,
        betas: Given = None,
        trans: Given = None,
        offsets: Given = None,
    ) -> Array:
        """A named set of landmarks (..., M, 3) m; `joints` are always there.

        Raises UnknownName, and NotSupported for offsets, which only landmarks of a SkinnedBody can
        have.
        """
        if offsets is not None:
            raise NotSupported(no_offsets(f"on body {self.name!r}, a TriangleBody"))
        if name == "joints":
            return self.joints(pose, betas, trans)
        found = landmark_set(self.landmarks, name)
        return evaluation.regressed(found.regressor, self.vertices(pose, betas, trans))

    def landmark_names(self, name: str) -> tuple[str, ...]:
        """The names of the points of a landmark set."""
        return self.joint_names if name == "joints" else landmark_set(self.landmarks, name).names

    def deformations(self, pose: ArrayLike, betas: ArrayLike) -> Array:
        """X_f (F, 3, 3) at pose (K, 3) rad and betas (B,), before stitching."""
        _, theta, beta, _ = evaluation.arguments(self, pose, betas, None)
        return self.arithmetic.evaluate(theta[0], beta[0]).deformations

    @cached_property
    def stitching(self) -> Stitching:
        """How the triangles hang together."""
        return Stitching(self.faces, self.n_vertices)

    @cached_property
    def arithmetic(self) -> TriangleArithmetic:
        """The surface in numbers."""
        return TriangleArithmetic(PackedTriangles(self))
