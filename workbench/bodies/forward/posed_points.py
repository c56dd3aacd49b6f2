"""Points of a body in numbers: at a pose, betas and a translation, and offsets of landmarks if any.

The kinematics are found once for a pose; from them and the betas, one of three kinds of arithmetic
finds points before translation: `NumpyMesh` or `CompiledMesh`, `LandmarkPoints`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from typing import TYPE_CHECKING, TypeAlias

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks.points import PointsOfEach, stacked
from workbench.bodies.forward import surface
from workbench.bodies.forward.compiled import CompiledJoints, CompiledMesh, Packing
from workbench.bodies.forward.few_points import LandmarkPoints, LandmarkPointsAt, RestPoints
from workbench.bodies.forward.freed import BLOCKS, FreedSurface
from workbench.bodies.forward.kinematics import Skeleton
from workbench.bodies.forward.mesh import NumpyMesh, VertexChunk, batch_points, chunks_of
from workbench.bodies.forward.motion import JointMotion, Kinematics, PointsAtMotion
from workbench.bodies.forward.named_points import BodyPoints, BodyPointsAt, RowTarget
from workbench.bodies.forward.surface import ALL, Vertices

if TYPE_CHECKING:
    from workbench.bodies.body import Landmarks
    from workbench.bodies.capsules import Capsules
    from workbench.bodies.skinned import SkinnedBody

WORTH_COMPILING = 1000  # vertices: with fewer NumPy needs at most two milliseconds
LARGE_PART = 100  # vertices, from which on a part of a body with so many is compiled as well
LARGE_TREE = 16  # joints, from which on kinematics are compiled

Arithmetic: TypeAlias = NumpyMesh | CompiledMesh | LandmarkPoints


@dataclass(frozen=True, eq=False)
class PosedPoints(BodyPoints):
    """Points of a body that follow from its kinematics.

    `arithmetic` has the points before translation at one motion and shape, and `many` those
    (M, N, 3) m at M of them, where the arithmetic takes one alone.
    """

    kinematics: Kinematics
    arithmetic: Arithmetic
    many: Callable[[JointMotion, Array], Array] | None = None

    def evaluate(self, pose: Array, betas: Array, trans: Array, *offsets: Array) -> PosedPointsAt:
        """The points at one pose, betas, translation, and offsets (N, 3) m of landmarks."""
        motion = self.kinematics.motion_kept(pose, betas)
        return PosedPointsAt(self.arithmetic, motion, betas, trans, offsets)

    def evaluate_each(
        self, poses: Array, betas: Array, trans: Array, *offsets: Array
    ) -> list[PosedPointsAt]:
        """The points at each of M poses (M, K, 3) rad, betas (M, B) and translations (M, 3) m.

        The kinematics of all of them are computed together.
        """
        motions = self.kinematics.motion(poses, betas).each()
        each = zip(motions, betas, trans, *offsets, strict=True)
        return [PosedPointsAt(self.arithmetic, g, b, t, tuple(more)) for g, b, t, *more in each]

    def together(self, names: Mapping[str, str], *arguments: Array) -> PointsOfEach | None:
        """The same by arithmetic on all of them; None for a surface, which takes one at a time."""
        if isinstance(self.arithmetic, NumpyMesh | CompiledMesh):
            return None
        return PosedFrames(self, self.arithmetic, names, arguments)

    def evaluate_batch(self, poses: Array, betas: Array, trans: Array, *offsets: Array) -> Array:
        """The points (M, N, 3) m of M poses, betas and translations, all at once."""
        motion = self.kinematics.motion(poses, betas)
        if self.many is not None:
            at_origin = self.many(motion, betas)
        else:
            at_origin = self.arithmetic.at(motion, betas, *offsets).points
        return np.asarray(at_origin + trans[:, None])


@dataclass(frozen=True, eq=False)
class PosedPointsAt(BodyPointsAt):
    """The points at one motion, betas (B,) and trans (3,) m.

    `offsets` is empty, or holds the offsets (N, 3) m that displace landmarks at rest.
    """

    arithmetic: Arithmetic
    motion: JointMotion
    betas: Array
    trans: Array
    offsets: tuple[Array, ...] = ()

    @cached_property
    def at_origin(self) -> PointsAtMotion:
        """The points before translation."""
        return self.arithmetic.at(self.motion, self.betas, *self.offsets)

    @cached_property
    def points(self) -> Array:
        """The points, (N, 3) m."""
        at_origin = self.at_origin.points
        points = np.empty_like(at_origin)
        for d in range(3):  # one coordinate at a time, so that the inner loop runs along points
            np.add(at_origin[:, d], self.trans[d], out=points[:, d])
        return points

    def write_jacobian(self, into: Mapping[str, RowTarget], scale: Array | None) -> None:
        """Write the transposed derivative into `pose`, `betas` and so on, (size, 3 N) each."""
        self.at_origin.write_jacobian(self.motion.derivatives, into, scale)

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        """The gradients of cotangent (3 N,) . points by `pose`, `betas` and so on, flat."""
        on_points = cotangent.reshape(-1, 3)
        on_G, on_features, on_betas = self.at_origin.vjp(on_points)
        on_pose, by_joints = self.motion.vjp(on_G, on_features)
        gradients = {"pose": on_pose.ravel(), "betas": on_betas + by_joints}
        if self.offsets:
            gradients["offsets"] = self.at_origin.vjp_of_offsets(on_points).ravel()
        return {**gradients, "trans": on_points.sum(axis=0)}


@dataclass(frozen=True, eq=False)
class PosedFrames:
    """Joints or landmarks at M poses (M, K, 3) rad, betas (M, B) and trans (M, 3) m, by one call.

    See PointsOfEach. `names` are the blocks that hold the arguments, by the words for these, and
    `arguments` the poses, betas and translations, and offsets (M, N, 3) m if any.
    """

    of: PosedPoints
    arithmetic: LandmarkPoints
    names: Mapping[str, str]
    arguments: tuple[Array, ...]

    @cached_property
    def points(self) -> Array:
        """The points, (M, N, 3) m."""
        return np.asarray(self._at_origin.points + self.arguments[2][:, None])

    @cached_property
    def _at_origin(self) -> LandmarkPointsAt:
        poses, betas, _, *offsets = self.arguments
        return self.arithmetic.at(self.of.kinematics.motion(poses, betas), betas, *offsets)

    def write_jacobians(self, some: slice, into: Mapping[str, Array]) -> None:
        """Write the derivatives at some of the poses, (some, 3 N, size)."""
        landmarks = self._at_origin[some]
        by = landmarks.motion.derivatives
        for role, name in self.names.items():
            if name in into:
                into[name][:] = landmarks.derivative(by, role).swapaxes(-1, -2)

    def vjps(self, cotangents: Array) -> dict[str, Array]:
        """The gradients (M, size) of cotangent (M, 3 N) . points by each block."""
        pairs = zip(self.of.evaluate_each(*self.arguments), cotangents, strict=True)
        gradients = stacked([points.vjp(cotangent) for points, cotangent in pairs])
        return {name: gradients[role] for role, name in self.names.items() if role in gradients}


class BodyNumbers:
    """What a skinned body computes numbers with, made from its arrays when first asked for."""

    def __init__(self, arrays: SkinnedBody) -> None:
        self.arrays = arrays
        self._rest_points: dict[Landmarks, RestPoints] = {}

    @cached_property
    def skeleton(self) -> Skeleton:
        """Where the joints are at rest."""
        return Skeleton.of(self.arrays)

    @cached_property
    def kinematics(self) -> Kinematics:
        """The joints' motions and their derivatives."""
        parts = self.skeleton, self.arrays.bind_pose, self.arrays.parents
        large = self.arrays.n_vertices >= WORTH_COMPILING or self.arrays.n_joints >= LARGE_TREE
        return Kinematics(*parts, CompiledJoints.of(*parts) if large else None)

    @cached_property
    def chunks(self) -> list[VertexChunk]:
        """The arrays of all vertices, in chunks of vertices."""
        return chunks_of(self.arrays, ALL)

    @cached_property
    def packing(self) -> Packing:
        """How compiled arithmetic stores the body's directions."""
        return Packing.of(self.arrays)

    @cached_property
    def joints(self) -> PosedPoints:
        """The posed joints in numbers."""
        points = LandmarkPoints.of_joints(self.skeleton, self.kinematics.ancestors)
        return PosedPoints(self.kinematics, points)

    def chunks_of(self, some: slice | list[int]) -> list[VertexChunk]:
        """The arrays of all vertices or some, in chunks of vertices."""
        return self.chunks if some == ALL else chunks_of(self.arrays, some)

    def surface(self, vertices: Vertices) -> PosedPoints:
        """All vertices of an SMPL body, or some."""
        chosen = vertices if isinstance(vertices, slice) else list(vertices)
        chunks = cache(partial(self.chunks_of, chosen))

        def many(motion: JointMotion, betas: Array) -> Array:
            return batch_points(chunks(), motion, betas)

        return PosedPoints(self.kinematics, self.mesh(chosen), many)

    def mesh(self, some: slice | list[int] = ALL) -> NumpyMesh | CompiledMesh:
        """The arithmetic of all vertices or some, compiled where that pays and works.

        The library is that of the whole surface, so that a part of one is worth it sooner.
        """
        body = self.arrays
        count = body.n_vertices if isinstance(some, slice) else len(some)
        if body.n_vertices >= WORTH_COMPILING and count >= min(LARGE_PART, WORTH_COMPILING):
            compiled = CompiledMesh.of(body, some, self.packing)
            if compiled is not None:
                return compiled
        return NumpyMesh(self.chunks_of(some), body.parents)

    def freed(
        self, vertices: Vertices, arguments: Sequence[str], free: Mapping[str, str]
    ) -> FreedSurface:
        """Vertices of an SMPL body, some of whose arrays are in the blocks `free`.

        `arguments` are the blocks of pose, betas and trans.
        """
        chosen = np.arange(self.arrays.n_vertices)[vertices]
        names = dict(zip(BLOCKS, arguments, strict=True)) | {**free}
        return FreedSurface(self.arrays, self.kinematics, chosen, names)

    def rest_points(self, landmarks: Landmarks) -> RestPoints:
        """The rest points of a linearly blended body's landmarks."""
        if landmarks not in self._rest_points:
            regressor, used = landmarks.of_vertices
            self._rest_points[landmarks] = RestPoints.of(self.arrays, used, regressor)
        return self._rest_points[landmarks]

    def landmarks(self, landmarks: Landmarks) -> PosedPoints:
        """Weighted means of an SMPL body's vertices, with offsets or without."""
        points = LandmarkPoints(self.rest_points(landmarks), self.kinematics.ancestors)
        return PosedPoints(self.kinematics, points)

    def capsules(self, capsules: Capsules) -> PosedPoints:
        """The ends of capsules."""
        points = LandmarkPoints(RestPoints.of_capsules(capsules), self.kinematics.ancestors)
        return PosedPoints(self.kinematics, points)

    def displaced_rest(self, landmarks: Landmarks) -> cs.Function:
        """A function (pose, betas, offsets) -> the untranslated landmarks (3, L), any skinning."""
        pose, betas = self._symbols
        offsets = cs.MX.sym("offsets", 3, len(landmarks.names))
        symbols, rest_points = (pose, betas, cs.MX.zeros(3)), partial(self.rest_points, landmarks)
        expression = surface.posed_landmarks(self.arrays, landmarks, rest_points, symbols, offsets)
        return cs.Function("displaced_rest", [pose, betas, offsets], [expression])

    @cached_property
    def skinned_rest(self) -> cs.Function:
        """A function (pose, betas) -> the untranslated posed surface (3, N), for any skinning."""
        pose, betas = self._symbols
        expression = surface.posed(self.arrays, pose, betas, cs.MX(cs.DM.zeros(3)))
        return cs.Function("skinned_rest", [pose, betas], [expression])

    @property
    def _symbols(self) -> tuple[cs.MX, cs.MX]:
        K, _, B = self.skeleton.by_betas.shape
        return cs.MX.sym("pose", 3, K), cs.MX.sym("betas", B)
