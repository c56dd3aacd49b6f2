"""What a body computes numbers with, made from its arrays when it is first asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache, cached_property, partial
from typing import TYPE_CHECKING

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.bodies.forward import arithmetic, surface
from workbench.bodies.forward.arithmetic import arithmetic_of
from workbench.bodies.forward.arrays import ALL, SkinnedArrays, Vertices
from workbench.bodies.forward.freed_numbers import BLOCKS, FreedSurface
from workbench.bodies.forward.joint_batch import JointBatch
from workbench.bodies.forward.joint_kernels import CompiledJoints
from workbench.bodies.forward.joint_numbers import JointArithmetic
from workbench.bodies.forward.landmark_numbers import LandmarkArithmetic
from workbench.bodies.forward.landmark_symbols import posed_landmarks
from workbench.bodies.forward.motion import Kinematics
from workbench.bodies.forward.numeric import Chunk, batch_points, chunks_of
from workbench.bodies.forward.numeric_sources import PosedPoints
from workbench.bodies.forward.rest_points import RestPoints
from workbench.bodies.forward.skeleton import Skeleton

if TYPE_CHECKING:
    from workbench.bodies.body import Landmarks
    from workbench.bodies.capsules import Capsules


class NumericBody:
    """A skinned body's kinematics, its arrays in the order of arithmetic, and its points."""

    def __init__(self, arrays: SkinnedArrays) -> None:
        self.arrays = arrays
        self._rest_points: dict[Landmarks, RestPoints] = {}

    @cached_property
    def skeleton(self) -> Skeleton:
        """Where the joints are at rest."""
        return Skeleton.of(self.arrays)

    @cached_property
    def kinematics(self) -> Kinematics:
        """The joints' motions and their derivatives."""
        of = self.skeleton, self.arrays.bind_pose, self.arrays.parents
        worthwhile = self.arrays.n_vertices >= arithmetic.WORTH_COMPILING
        return Kinematics(*of, CompiledJoints.of(*of) if worthwhile else None)

    @cached_property
    def joint_batch(self) -> JointBatch:
        """The joints' motions for many poses at once."""
        return JointBatch.of(self.skeleton, self.arrays.bind_pose, self.arrays.parents)

    @cached_property
    def chunks(self) -> list[Chunk]:
        """The arrays of all vertices, in chunks of vertices."""
        return chunks_of(self.arrays, ALL)

    @cached_property
    def joints(self) -> PosedPoints:
        """The posed joints in numbers."""
        of_joints = JointArithmetic(self.skeleton, self.kinematics.ancestors)
        return PosedPoints(self.kinematics, of_joints, self.joint_batch)

    def surface(self, vertices: Vertices) -> PosedPoints:
        """All vertices of an SMPL body, or some."""
        some = vertices if isinstance(vertices, slice) else list(vertices)
        chunks = cache(lambda: self.chunks if some == ALL else chunks_of(self.arrays, some))

        def many(poses: Array, betas: Array) -> Array:
            return batch_points(chunks(), self.joint_batch.motions(poses, betas), betas)

        return PosedPoints(self.kinematics, arithmetic_of(self.arrays, some, chunks), many)

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

    def landmark_arithmetic(self, landmarks: Landmarks) -> LandmarkArithmetic:
        """The arithmetic of weighted means of an SMPL body's vertices."""
        return LandmarkArithmetic(self.rest_points(landmarks), self.kinematics.ancestors)

    def landmarks(self, landmarks: Landmarks) -> PosedPoints:
        """Weighted means of an SMPL body's vertices, with offsets or without."""
        return self._at_rest_points(self.landmark_arithmetic(landmarks))

    def capsules(self, capsules: Capsules) -> PosedPoints:
        """The ends of capsules; see LandmarkArithmetic."""
        points = self.capsule_rest(capsules)
        return self._at_rest_points(LandmarkArithmetic(points, self.kinematics.ancestors))

    def _at_rest_points(self, of_landmarks: LandmarkArithmetic) -> PosedPoints:
        def many(poses: Array, betas: Array, *offsets: Array) -> Array:
            motions = self.joint_batch.motions(poses, betas)
            return of_landmarks.evaluate_batch(motions, betas, *offsets)

        return PosedPoints(self.kinematics, of_landmarks, many)

    def displaced_rest(self, landmarks: Landmarks) -> cs.Function:
        """A function (pose, betas, offsets) -> the untranslated landmarks (3, L), any skinning."""
        K, _, B = self.skeleton.slopes.shape
        pose, betas = cs.MX.sym("pose", 3, K), cs.MX.sym("betas", B)
        offsets = cs.MX.sym("offsets", 3, len(landmarks.names))
        symbols, rest_points = (pose, betas, cs.MX.zeros(3)), partial(self.rest_points, landmarks)
        found = posed_landmarks(self.arrays, landmarks, rest_points, symbols, offsets)
        return cs.Function("displaced_rest", [pose, betas, offsets], [found])

    def capsule_rest(self, capsules: Capsules) -> RestPoints:
        """The ends of capsules as rest points, each on one joint, without pose blend shapes."""
        P = 2 * len(capsules.names)
        slopes = capsules.end_slopes.reshape(P, 3, -1).transpose(2, 1, 0)
        return RestPoints(
            np.repeat(capsules.joints, 2),
            np.arange(P),
            np.zeros(0, dtype=np.int64),
            capsules.ends.reshape(P, 3).T.ravel(),
            np.ascontiguousarray(slopes).reshape(-1, 3 * P),
            np.zeros((0, 3 * P)),
            np.ones(P),
        )

    @cached_property
    def skinned_rest(self) -> cs.Function:
        """A function (pose, betas) -> the untranslated posed surface (3, N), for any skinning."""
        K, _, B = self.skeleton.slopes.shape
        pose, betas = cs.MX.sym("pose", 3, K), cs.MX.sym("betas", B)
        nowhere = cs.MX(cs.DM.zeros(3))
        expression = surface.posed(self.arrays, pose, betas, nowhere)
        return cs.Function("skinned_rest", [pose, betas], [expression])
