"""A body whose triangles deform one by one and are stitched: SCAPE and BlendSCAPE."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from workbench.blocks import Block, Points, Values
from workbench.blocks.checks import texts
from workbench.bodies import evaluation
from workbench.bodies.arguments import Arguments
from workbench.bodies.body import Blocks, blocks_of, check_prefix, landmark_set
from workbench.bodies.landmarks import Landmarks
from workbench.bodies.owned import (
    given_up,
    owned,
    owned_extras,
    owned_index,
    owned_mapping,
    owned_matrix,
)
from workbench.bodies.triangles.arithmetic import Arithmetic
from workbench.bodies.triangles.arrays import TriangleArrays
from workbench.bodies.triangles.sources import SurfaceMeans, TriangleSurface
from workbench.bodies.triangles.validation import check
from workbench.bodies.validation import chosen_vertices
from workbench.errors import BadBody, NotNumbers
from workbench.geometry.stitching import Stitching

Array = NDArray[np.float64]


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
    """

    template: Array  # (N, 3) m
    faces: NDArray[np.int64]  # (F, 3), one connected surface
    shapedirs: Array  # (F, 3, 3, B) per unit of betas
    posedirs: Array  # (F, 3, 3, 3 J) per rad, joint by joint of `near`
    near: NDArray[np.int64]  # (F, J): the joints, never the root, whose twists a face feels
    weights: csr_array  # (F, K), rows sum to one
    J_regressor: csr_array  # (K, N), rows sum to one: joints from vertices, rest or posed
    parents: tuple[int, ...]  # parents[0] == -1, and parents[k] < k
    joint_names: tuple[str, ...]
    landmarks: Mapping[str, Landmarks] = field(default_factory=dict)
    name: str = "triangle body"
    card: Mapping[str, Any] = field(default_factory=dict)  # where the numbers come from
    extras: Mapping[str, NDArray[Any]] = field(default_factory=dict)  # of its file, for others
    _made: dict[str, Blocks] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        try:
            kept: dict[str, Any] = {
                n: owned(n, getattr(self, n)) for n in ("template", "shapedirs", "posedirs")
            }
            kept |= {n: owned_matrix(n, getattr(self, n)) for n in ("weights", "J_regressor")}
            kept |= {n: owned_index(n, getattr(self, n)) for n in ("faces", "near")}
            kept["parents"] = tuple(owned_index("parents", self.parents).ravel().tolist())
            kept["landmarks"] = owned_mapping(f"body {self.name!r}: landmarks", self.landmarks)
            kept["extras"] = owned_mapping("extras", owned_extras(self.extras))
        except NotNumbers as error:
            raise BadBody(f"body {self.name!r}: {error}") from None
        kept["joint_names"] = texts(f"body {self.name!r}: joint_names", self.joint_names, BadBody)
        self.__dict__.update(kept)
        check(self)

    def __reduce__(self) -> tuple[Any, ...]:
        """Its parts, without the blocks it made and what it computed with."""
        parts = {part.name: getattr(self, part.name) for part in fields(self) if part.init}
        plain = {name: dict(getattr(self, name)) for name in ("landmarks", "extras")}
        return _made_of, (parts | plain,)

    @property
    def n_vertices(self) -> int:
        """N."""
        return len(self.template)

    @property
    def n_faces(self) -> int:
        """F."""
        return len(self.faces)

    @property
    def n_joints(self) -> int:
        """K, the root included."""
        return len(self.parents)

    @property
    def n_betas(self) -> int:
        """B."""
        return int(self.shapedirs.shape[3])

    @property
    def bind_pose(self) -> Array:
        """The pose (K, 3) rad that leaves the template as it is: zero."""
        return np.zeros((self.n_joints, 3))

    # What a problem is written with.

    def blocks(self, prefix: str = "") -> Blocks:
        """`pose` (K, 3) rad, `betas` (B,), `trans` (3,) m: the same objects for the same prefix."""
        check_prefix(prefix)
        if prefix not in self._made:
            self._made[prefix] = blocks_of(prefix, self.joint_names, self.n_betas)
        return self._made[prefix]

    @property
    def known_blocks(self) -> tuple[Block, ...]:
        """Every block that this body has made so far."""
        return tuple(b for blocks in self._made.values() for b in blocks)

    def start(self, prefix: str = "") -> Values:
        """The template as values: zero pose, mean shape, at the origin."""
        return {block.name: np.zeros(block.shape) for block in self.blocks(prefix)}

    def points(
        self, pose: cs.MX, betas: cs.MX, trans: cs.MX, *, vertices: ArrayLike | None = None
    ) -> Points:
        """The posed surface, (3, N) m, or some of it: a list of vertices, or a mask (N,)."""
        surface = self._surface(pose, betas, trans)
        if vertices is None:
            return Points.of(surface, "vertices")
        chosen = chosen_vertices(self, vertices)
        some = np.arange(len(chosen)), np.array(chosen, dtype=np.int64)
        selection = csr_array((np.ones(len(chosen)), some), shape=(len(chosen), self.n_vertices))
        labels = tuple(f"vertex {i}" for i in chosen)
        return Points.of(SurfaceMeans(surface, selection, labels), "vertices")

    def joint_points(self, pose: cs.MX, betas: cs.MX, trans: cs.MX) -> Points:
        """The joints as the posed surface has them, (3, K) m: J_regressor times its vertices."""
        surface = self._surface(pose, betas, trans)
        # not the bare names: the rank law of a chain of bones does not hold for these
        labels = tuple(f"{name} of the surface" for name in self.joint_names)
        return Points.of(SurfaceMeans(surface, self.J_regressor, labels), "joints")

    def landmark_points(self, name: str, pose: cs.MX, betas: cs.MX, trans: cs.MX) -> Points:
        """A named set of landmarks on the posed surface, (3, M) m; `joints` are always there."""
        if name == "joints":
            return self.joint_points(pose, betas, trans)
        found = landmark_set(self.landmarks, name)
        surface = self._surface(pose, betas, trans)
        return Points.of(SurfaceMeans(surface, found.regressor, found.names), name)

    def _surface(self, pose: cs.MX, betas: cs.MX, trans: cs.MX) -> TriangleSurface:
        at: Arguments[TriangleArrays] = Arguments(self, pose, betas, trans)
        return TriangleSurface(at, self.arithmetic)

    # Numbers, for those who want no symbols. Any argument may have a batch in front.

    def vertices(
        self,
        pose: ArrayLike | None = None,
        betas: ArrayLike | None = None,
        trans: ArrayLike | None = None,
    ) -> Array:
        """The posed surface (..., N, 3) m of poses (..., K, 3) or (..., 3 K) rad."""
        batch, theta, beta, move = evaluation.arguments(self, pose, betas, trans)
        found = np.empty((len(theta), self.n_vertices, 3))
        for i in range(len(theta)):
            found[i] = self.arithmetic.at(theta[i], beta[i]).points + move[i]
        return found.reshape(*batch, self.n_vertices, 3)

    def joints(
        self,
        pose: ArrayLike | None = None,
        betas: ArrayLike | None = None,
        trans: ArrayLike | None = None,
    ) -> Array:
        """The joints of the posed surface (..., K, 3) m."""
        return evaluation.regressed(self.J_regressor, self.vertices(pose, betas, trans))

    def landmark(
        self,
        name: str,
        pose: ArrayLike | None = None,
        betas: ArrayLike | None = None,
        trans: ArrayLike | None = None,
    ) -> Array:
        """A named set of landmarks (..., M, 3) m; `joints` are always there."""
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
        return self.arithmetic.at(theta[0], beta[0]).deformations

    @cached_property
    def stitching(self) -> Stitching:
        """How the triangles hang together."""
        return Stitching(self.faces, self.n_vertices)

    @cached_property
    def arithmetic(self) -> Arithmetic:
        """The arrays packed for arithmetic."""
        return Arithmetic(self)


def _made_of(parts: dict[str, Any]) -> TriangleBody:
    """A body of parts that are nobody else's, as a pickle or a copy hands them over."""
    for part in parts.values():
        if isinstance(part, np.ndarray):
            given_up(part)
    return TriangleBody(**parts)
