"""What every body is: named blocks in, points out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import prod
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout, Points, Values
from workbench.blocks.checks import reals, texts
from workbench.bodies.readonly import locked, maker_of, readonly_matrix
from workbench.errors import BadBlock, BadBody, NotSupported, UnknownName
from workbench.geometry.meshes import Mesh, fitting_texture

if TYPE_CHECKING:
    import trimesh

Blocks = tuple[Block, Block, Block]
Given = ArrayLike | None  # an argument in numbers; None: as in the template
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Landmarks:
    """M named points, each a weighted mean of the vertices of a surface, such as the nose.

    Raises NotNumbers for a regressor that holds no numbers, and BadBody for names that are not
    texts.

    Attributes:
        names: the name of each point.
        regressor: (M, N) the weights of N vertices; every row sums to one.
    """

    names: tuple[str, ...]
    regressor: csr_array

    def __post_init__(self) -> None:
        regressor = readonly_matrix("the regressor of landmarks", self.regressor)
        names = texts("the names of landmarks", self.names, BadBody)
        self.__dict__.update(names=names, regressor=regressor)

    @property
    def of_vertices(self) -> tuple[csr_array, list[int]]:
        """The regressor (M, n) of the vertices that carry weight, and these, n of them."""
        columns = self.regressor.tocsc()
        used = np.flatnonzero(np.diff(columns.indptr)).tolist()
        return columns[:, used].tocsr(), used

    def __reduce__(self) -> tuple[Any, ...]:
        return Landmarks, (self.names, self.regressor)  # so that a copy is read-only as well


class Body(ABC):
    """A surface of N vertices that a pose of K joints, B betas and a translation move.

    Written in `blocks()`, problems take the points of any body; `vertices` and `joints` are the
    same in numbers, for batches. There are two kinds, SkinnedBody and TriangleBody.

    A body never changes: it keeps read-only copies of what it is given (float64, int64; read-only
    arrays as they are), and dataclasses.replace makes another. It pickles and copies; the copy
    has the same numbers and blocks of its own.

    Attributes:
        template: (N, 3) m, the mean person at rest.
        faces: (F, 3), the corners of each triangle.
        parents: (K,) with parents[0] == -1 and parents[k] < k.
        joint_names: (K,).
        landmarks: sets of landmarks by name.
        name: what the body is called.
        card: where its numbers come from.
        extras: arrays of its file that nothing computes with.
        free: the arrays that are unknowns, as blocks by name; see `freed`.
    """

    template: Array
    faces: Index
    parents: tuple[int, ...]
    joint_names: tuple[str, ...]
    landmarks: Mapping[str, Landmarks]
    name: str
    card: Mapping[str, Any]
    extras: Mapping[str, NDArray[Any]]
    free: Mapping[str, Block]

    FREEABLE: ClassVar[Mapping[str, str]]  # the arrays that can be free, and their units

    def __reduce__(self) -> tuple[Any, ...]:
        """Its parts, without the blocks it made and what it computed with."""
        return maker_of(self), ()

    @property
    def n_vertices(self) -> int:
        """N, the number of vertices of the surface."""
        return len(self.template)

    @property
    def n_joints(self) -> int:
        """K, the number of joints, the root included."""
        return len(self.parents)

    @property
    @abstractmethod
    def n_betas(self) -> int:
        """B, the number of shape coefficients."""

    @property
    def bind_pose(self) -> Array:
        """The pose (K, 3) rad that leaves the template as it is."""
        return np.zeros((self.n_joints, 3))

    @property
    @abstractmethod
    def vertex_weights(self) -> Array:
        """How much each vertex follows each joint, (N, K); rows sum to one."""

    # What a problem is written with.

    @cached_property
    def _blocks(self) -> dict[str, Blocks]:
        return {}

    def blocks(self, prefix: str = "") -> Blocks:
        """`pose` (K, 3) rad, `betas` (B,), `trans` (3,) m: the same objects for the same prefix.

        Raises BadBlock for a prefix that is no text.
        """
        check_prefix(prefix)
        if prefix not in self._blocks:
            self._blocks[prefix] = (
                Block(prefix + "pose", (self.n_joints, 3), "rad", self.joint_names),
                Block(prefix + "betas", (self.n_betas,), "sd"),
                Block(prefix + "trans", (3,), "m", ("x", "y", "z")),
            )
        return self._blocks[prefix]

    @property
    def known_blocks(self) -> tuple[Block, ...]:
        """Every block that this body has made so far."""
        own = (block for blocks in self._blocks.values() for block in blocks)
        return (*own, *self.free.values())

    def offsets(self, name: str, prefix: str = "") -> Block:
        """`offsets` (M, 3) m of a set of landmarks: the same object for the same set and prefix.

        See `landmark_points`. Raises UnknownName, and NotSupported for joints and for a body that
        is no SkinnedBody.
        """
        raise no_offsets(f"on body {self.name!r}, a {type(self).__name__}")

    def array(self, name: str) -> Array:
        """One of the arrays that can be freed, dense. Raises UnknownName."""
        if not isinstance(name, str) or name not in self.FREEABLE:
            raise UnknownName("array to free", str(name), self.FREEABLE)
        array = getattr(self, name)
        return array.toarray() if isinstance(array, csr_array) else array

    def freed(self, *names: str, prefix: str = "") -> Self:
        """A body with the same numbers, whose named arrays are unknowns in every expression.

        It shares its blocks with this one, so that points of either fit into one problem. Raises
        UnknownName, and BadBody for arrays that cannot be free together.
        """
        shapes = {name: self.array(name).shape for name in names}  # raises for what has no name
        free = {n: Block(prefix + n, shape, self.FREEABLE[n]) for n, shape in shapes.items()}
        return self._replaced(free={**self.free, **free})

    def with_values(self, values: Mapping[str, ArrayLike]) -> Self:
        """The trained body: each free array has its value among `values`, and is free no longer.

        Raises MissingValue, NotNumbers, ShapeMismatch or NonFiniteValue for a value, and BadBody
        where the arrays no longer fit together, as weights that do not sum to one.
        """
        arrays = {
            name: locked(Layout((block,)).pack(values).reshape(block.shape))
            for name, block in self.free.items()
        }
        return self._replaced(free={}, **arrays)

    def _replaced(self, **parts: Any) -> Self:
        """A body with other parts and the blocks of this one."""
        other: Self = replace(self, **parts)  # type: ignore[type-var]
        other.__dict__["_blocks"] = self._blocks
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

    @abstractmethod
    def points(
        self, pose: cs.MX, betas: cs.MX, trans: cs.MX, *, vertices: ArrayLike | None = None
    ) -> Points:
        """The posed surface, (3, N) m, or some of it: a list of vertices, or a mask (N,)."""

    @abstractmethod
    def joint_points(self, pose: cs.MX, betas: cs.MX, trans: cs.MX) -> Points:
        """The posed joints, (3, K) m."""

    def landmark_points(
        self, name: str, pose: cs.MX, betas: cs.MX, trans: cs.MX, offsets: cs.MX | None = None
    ) -> Points:
        """A named set of landmarks on the posed surface, (3, M) m; `joints` are always there.

        `offsets` (3, M) m displace each landmark of a SkinnedBody at rest, and move with the body:
        landmark m is the mean of its vertices v_i + o_m, each moved as the vertex is. Markers on
        skin or clothes are such landmarks (Loper et al., MoSh, 2014). They are the symbol of
        `offsets(name)`, or an expression of blocks. Raises UnknownName, BadBody, and NotSupported
        for offsets of joints or of a TriangleBody.
        """
        displaced = None if offsets is None else (self.offsets(name), offsets)
        if of_joints(name):
            return self.joint_points(pose, betas, trans)
        landmarks = landmark_set(self.landmarks, name)
        return self._mean_points(landmarks, name, (pose, betas, trans), displaced)

    @abstractmethod
    def _mean_points(
        self,
        landmarks: Landmarks,
        name: str,
        symbols: tuple[cs.MX, cs.MX, cs.MX],
        displaced: tuple[Block, cs.MX] | None,
    ) -> Points:
        """Landmarks on the posed surface, perhaps displaced by a block of offsets."""

    # Points in numbers. Any argument may have batch axes in front.

    @abstractmethod
    def vertices(self, pose: Given = None, betas: Given = None, trans: Given = None) -> Array:
        """The posed surface (..., N, 3) m of poses (..., K, 3) or (..., 3 K) rad."""

    @abstractmethod
    def joints(self, pose: Given = None, betas: Given = None, trans: Given = None) -> Array:
        """The posed joints (..., K, 3) m."""

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
        if offsets is not None:
            return self._displaced(name, (pose, betas, trans), offsets)
        if of_joints(name):
            return self.joints(pose, betas, trans)
        landmarks = landmark_set(self.landmarks, name)
        return regressed(landmarks.regressor, self.vertices(pose, betas, trans))

    def _displaced(self, name: str, state: tuple[Given, Given, Given], offsets: ArrayLike) -> Array:
        raise no_offsets(f"on body {self.name!r}, a {type(self).__name__}")

    def landmark_names(self, name: str) -> tuple[str, ...]:
        """The names of the points of a landmark set."""
        return self.joint_names if of_joints(name) else landmark_set(self.landmarks, name).names

    @property
    def texture(self) -> tuple[Array | None, Index | None]:
        """Texture coordinates (M, 2), v upwards, and their numbers (F, 3) at the faces' corners.

        They are `vt` and `ft` of the extras, as the files of SMPL and its relatives have them; None
        twice if the file had none that fit the faces.
        """
        vt, ft = self.extras.get("vt"), self.extras.get("ft")
        if vt is None or ft is None or vt.dtype.kind not in "fiu" or ft.dtype.kind not in "iu":
            return None, None
        uv, corners = vt.astype(np.float64), ft.astype(np.int64)
        return (uv, corners) if fitting_texture(self.faces, uv, corners) else (None, None)

    def mesh(self, pose: Given = None, betas: Given = None, trans: Given = None) -> Mesh:
        """The surface in one pose with its texture coordinates, in the body's order.

        Raises BadBody for several poses.
        """
        vertices = self.vertices(pose, betas, trans)
        if vertices.ndim != 2:
            raise BadBody(
                f"a mesh shows body {self.name!r} in one pose, not in a batch {vertices.shape[:-2]}"
            )
        return Mesh(vertices, self.faces, *self.texture)

    def trimesh(
        self, pose: Given = None, betas: Given = None, trans: Given = None
    ) -> trimesh.Trimesh:
        """The surface in one pose as a `trimesh.Trimesh`, vertices and faces in the body's order.

        Raises BadBody for several poses.
        """
        return self.mesh(pose, betas, trans).trimesh()


def check_prefix(prefix: object) -> None:
    """Raise BadBlock unless it is a text."""
    if not isinstance(prefix, str):
        raise BadBlock(f"the prefix of a body's blocks is a text, not a {type(prefix).__name__}")


def of_joints(name: object) -> bool:
    """Whether this is what a body's own joints are called among its sets of landmarks."""
    return isinstance(name, str) and name == "joints"


def landmark_set(sets: Mapping[str, T], name: str) -> T:
    """One of a body's sets of landmarks. Raises UnknownName."""
    if not isinstance(name, str) or name not in sets:
        raise UnknownName("landmark set", str(name), ("joints", *sets))
    return sets[name]


def no_offsets(of_what: str) -> NotSupported:
    """The error for offsets of points that can have none."""
    return NotSupported(
        f"there are no offsets {of_what}: they displace vertices at rest, of which the landmarks "
        "of a SkinnedBody are means; take a landmark set of such a body, such as one with a single "
        "vertex for each point"
    )


def why_not_skinned(body: object, what: str, instead: str) -> str:
    """Why `what` cannot be had of this body, which is no SkinnedBody; empty if it is one.

    `instead` says what to do with a body of another kind.
    """
    if not isinstance(body, Body):
        return (
            f"{what} is made of a SkinnedBody, not of something of type {type(body).__name__}; "
            "load_body has one"
        )
    if hasattr(body, "skinning"):
        return ""
    kind = type(body).__name__
    return f"{what} is made of a SkinnedBody, but body {body.name!r} is a {kind}; {instead}"


def regressed(regressor: csr_array, points: Array) -> Array:
    """Weighted means (..., M, 3) of points (..., N, 3), for a regressor (M, N)."""
    flat = np.moveaxis(points, -2, 0).reshape(points.shape[-2], -1)
    means = (regressor @ flat).reshape(regressor.shape[0], *points.shape[:-2], 3)
    return np.moveaxis(means, 0, -2)


def arguments(
    body: Body, pose: Given, betas: Given, trans: Given, offsets: Array | None = None
) -> tuple[tuple[int, ...], list[Array]]:
    """The batch, and M of each: (M, K, 3), (M, B), (M, 3), and offsets (M, L, 3) if there are any.

    What is None is as in the template; betas may be shorter than B. Raises BadBody or NotNumbers.
    """
    theta, K = reals("pose", body.bind_pose if pose is None else pose), body.n_joints
    if theta.shape[-2:] != (K, 3):
        if theta.shape[-1:] != (3 * K,):
            raise BadBody(
                f"body {body.name!r} has {K} joints and takes a pose of shape (..., {K}, 3) or "
                f"(..., {3 * K}), not {theta.shape}"
            )
        theta = theta.reshape(*theta.shape[:-1], K, 3)
    beta, B = reals("betas", np.zeros(0) if betas is None else betas), body.n_betas
    if beta.ndim == 0 or beta.shape[-1] > B:
        raise BadBody(f"body {body.name!r} takes up to {B} betas, not an array {beta.shape}")
    beta = np.pad(beta, [(0, 0)] * (beta.ndim - 1) + [(0, B - beta.shape[-1])])
    move = reals("trans", np.zeros(3) if trans is None else trans)
    if move.shape[-1:] != (3,):
        raise BadBody(f"body {body.name!r} takes a trans of shape (..., 3), not {move.shape}")
    parts = {"pose": (theta, 2), "betas": (beta, 1), "trans": (move, 1)}
    if offsets is not None:
        parts["offsets"] = offsets, 2
    try:
        batch = np.broadcast_shapes(*(a.shape[:-axes] for a, axes in parts.values()))
    except ValueError:
        *first, last = (f"{name} {a.shape}" for name, (a, _) in parts.items())
        raise BadBody(
            f"the batches of {', '.join(first)} and {last} do not fit each other"
        ) from None
    tails = ((a, a.shape[-axes:]) for a, axes in parts.values())
    return batch, [
        np.broadcast_to(a, batch + tail).reshape(prod(batch), *tail) for a, tail in tails
    ]
