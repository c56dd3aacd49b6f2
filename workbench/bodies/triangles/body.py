"""A body whose triangles deform one by one and are then stitched: SCAPE and BlendSCAPE."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.blocks import Block, Points
from workbench.bodies.body import Body, Given, Landmarks, arguments, regressed
from workbench.bodies.forward.sources import Arguments
from workbench.bodies.readonly import readonly_parts
from workbench.bodies.triangles.surface import (
    PackedTriangles,
    TriangleNumbers,
    deformed,
    surface_points,
)
from workbench.bodies.validation import check_triangles, chosen_vertices
from workbench.errors import BadBody
from workbench.geometry.triangles import Stitching, gradient_derivatives

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody


@dataclass(frozen=True, eq=False)
class TriangleBody(Body):
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

    Points with free arrays have no arithmetic: CasADi differentiates the whole graph, which is fit
    for some hundred faces. Raises BadBody if the arrays do not fit together.

    Attributes (beside those of every Body):
        faces: (F, 3), one connected surface.
        shapedirs: (F, 3, 3, B) per unit of betas.
        posedirs: (F, 3, 3, 3 J) per rad, joint by joint of `near`.
        near: (F, J) the joints, never the root, whose twists a face feels.
        weights: (F, K) how much each face belongs to each part; rows sum to one.
        J_regressor: (K, N) from vertices, at rest or posed, to joints; rows sum to one.
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

    FREEABLE: ClassVar[Mapping[str, str]] = {"template": "m", "shapedirs": "1", "posedirs": "1/rad"}

    def __post_init__(self) -> None:
        reals, matrices = ("template", "shapedirs", "posedirs"), ("weights", "J_regressor")
        parts = readonly_parts(self, reals, matrices, ("faces", "near"), ("landmarks", "free"))
        self.__dict__.update(parts)
        check_triangles(self)

    @property
    def n_faces(self) -> int:
        """F, the number of triangles."""
        return len(self.faces)

    @property
    def n_betas(self) -> int:
        """B, the number of shape directions."""
        return int(self.shapedirs.shape[3])

    @property
    def one_part_per_face(self) -> bool:
        """Whether each face belongs to a single part, as in SCAPE; in BlendSCAPE some do not."""
        return int(self.weights.count_nonzero()) == self.n_faces  # rows sum to one: none is zero

    @property
    def vertex_weights(self) -> Array:
        """How much each vertex follows each joint, (N, K): the mean of its faces' weights."""
        corners = self.faces.ravel()
        shares = np.repeat(self.weights.toarray(), 3, axis=0) / np.bincount(corners)[corners, None]
        weights = np.zeros((self.n_vertices, self.n_joints))
        np.add.at(weights, corners, shares)
        return weights

    def points(
        self, pose: cs.MX, betas: cs.MX, trans: cs.MX, *, vertices: ArrayLike | None = None
    ) -> Points:
        """The posed surface, (3, N) m, or some of it: a list of vertices, or a mask (N,)."""
        symbols = pose, betas, trans
        if vertices is None:
            source = surface_points(Arguments(self, *symbols), self.arithmetic, self.free)
            return Points.of(source, "vertices")
        chosen = chosen_vertices(self, vertices)
        entries = np.arange(len(chosen)), np.array(chosen, dtype=np.int64)
        selection = csr_array((np.ones(len(chosen)), entries), shape=(len(chosen), self.n_vertices))
        return self._means(selection, tuple(f"vertex {i}" for i in chosen), "vertices", symbols)

    def deformed_edges(self, pose: cs.MX, betas: cs.MX) -> cs.MX:
        """X_f e_fi, (3, 2 F) m: the edges of every face in turn, before they are stitched."""
        first, second = deformed(self.arithmetic.packed, pose, betas, self.free)
        return cs.reshape(cs.vertcat(first.T, second.T), 3, 2 * self.n_faces)

    def joint_points(self, pose: cs.MX, betas: cs.MX, trans: cs.MX) -> Points:
        """The joints as the posed surface has them, (3, K) m: J_regressor times its vertices."""
        return self._means(self.J_regressor, self.joint_names, "joints", (pose, betas, trans))

    def _mean_points(
        self,
        landmarks: Landmarks,
        name: str,
        symbols: tuple[cs.MX, cs.MX, cs.MX],
        displaced: tuple[Block, cs.MX] | None,
    ) -> Points:
        return self._means(landmarks.regressor, landmarks.names, name, symbols)

    def _means(
        self,
        regressor: csr_array,
        names: tuple[str, ...],
        name: str,
        symbols: tuple[cs.MX, cs.MX, cs.MX],
    ) -> Points:
        inputs = Arguments(self, *symbols)
        return Points.of(surface_points(inputs, self.arithmetic, self.free, regressor, names), name)

    # Points in numbers. Any argument may have batch axes in front.

    def vertices(self, pose: Given = None, betas: Given = None, trans: Given = None) -> Array:
        """The posed surface (..., N, 3) m of poses (..., K, 3) or (..., 3 K) rad."""
        batch, numbers = arguments(self, pose, betas, trans)
        surfaces = self.arithmetic.evaluate_batch(*numbers)
        return surfaces.reshape(*batch, self.n_vertices, 3)

    def joints(self, pose: Given = None, betas: Given = None, trans: Given = None) -> Array:
        """The joints of the posed surface (..., K, 3) m."""
        return regressed(self.J_regressor, self.vertices(pose, betas, trans))

    def deformations(self, pose: ArrayLike, betas: ArrayLike) -> Array:
        """X_f (F, 3, 3) at pose (K, 3) rad and betas (B,), before stitching."""
        _, (theta, beta, _) = arguments(self, pose, betas, None)
        return self.arithmetic.evaluate(theta[0], beta[0]).deformations

    @cached_property
    def stitching(self) -> Stitching:
        """How the triangles hang together."""
        return Stitching(self.faces, self.n_vertices)

    @cached_property
    def arithmetic(self) -> TriangleNumbers:
        """The surface in numbers."""
        return TriangleNumbers(PackedTriangles(self))


def blend_scape(body: SkinnedBody, n_near: int = 2) -> TriangleBody:
    """BlendSCAPE on a skinned body's mesh, tree and shape space; its posedirs are zero.

    A face's weights are the mean of its corners'. Its shapedirs are the gradients of the body's,
    so that unposed both have the same vertices. Each face feels the twists of the `n_near` joints
    nearest to it, of those where its part meets others. The card is the skinned body's, whose
    numbers these are; its `extras` stay behind.

    Raises BadBody for a body that is drawn in another pose than zero, whose joints are given, or
    whose mesh is in pieces.
    """
    if body.bind_pose.any():
        raise BadBody(
            f"body {body.name!r} is drawn in a bent pose; a triangle body's template is unposed"
        )
    if body.rest_joints is not None:
        raise BadBody(
            f"body {body.name!r} is given its joints, and a triangle body finds them on its "
            "surface; give it a J_regressor, with dataclasses.replace(body, rest_joints=None)"
        )
    corners = body.weights[body.faces]  # (F, 3, K)
    weights = corners.mean(axis=1)
    joints = body.numeric.skeleton.mean
    near = nearest_joints(
        body.template[body.faces].mean(axis=1), joints, weights.argmax(axis=1), body.parents, n_near
    )
    return TriangleBody(
        template=body.template,
        faces=body.faces,
        shapedirs=gradient_derivatives(body.template, body.shapedirs, body.faces),
        posedirs=np.zeros((len(body.faces), 3, 3, 3 * near.shape[1])),
        near=near,
        weights=csr_array(weights),
        J_regressor=body.J_regressor,
        parents=body.parents,
        joint_names=body.joint_names,
        landmarks=body.landmarks,
        name=f"{body.name}, BlendSCAPE",
        card={"made_of": f"body {body.name!r}, whose card follows", **body.card},
    )


def scape(body: SkinnedBody, n_near: int = 2) -> TriangleBody:
    """SCAPE: as `blend_scape`, each face following the one part that it belongs to most."""
    return one_part(blend_scape(body, n_near), f"{body.name}, SCAPE")


def one_part(body: TriangleBody, name: str) -> TriangleBody:
    """A triangle body whose faces each follow the part of their largest weight alone."""
    part = body.weights.toarray().argmax(axis=1)
    hot = csr_array((np.ones(len(part)), (np.arange(len(part)), part)), shape=body.weights.shape)
    return replace(body, weights=hot, name=name)


def nearest_joints(
    middles: Array, joints: Array, part: Index, parents: tuple[int, ...], count: int
) -> Index:
    """For faces with these `middles` (F, 3) m on these parts (F,) the joints they feel, (F, count).

    First come the joints where the part meets others, its own and its children's, the nearest
    first; then, where these are too few, the nearest of the others. The root bends nothing; fewer
    than `count` joints give fewer columns.
    """
    K = len(parents)
    count = min(count, K - 1)
    up = np.array(parents)
    meets = (np.arange(K) == part[:, None]) | (up == part[:, None])  # (F, K)
    distances = np.linalg.norm(middles[:, None] - joints, axis=2)
    far = 1 + distances.max(initial=0.0)
    order = np.argsort((distances + far * ~meets)[:, 1:], axis=1, kind="stable")
    return np.asarray(1 + order[:, :count], dtype=np.int64)
