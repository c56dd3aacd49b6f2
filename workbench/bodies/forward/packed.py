"""What a body computes numbers with, made from its arrays when it is first asked for."""

from __future__ import annotations

from functools import cached_property

import casadi as cs
import numpy as np

from workbench.bodies.forward import surface
from workbench.bodies.forward.arithmetic import arithmetic_of
from workbench.bodies.forward.arrays import ALL, SkinnedArrays, Vertices
from workbench.bodies.forward.freed_numbers import FreedSurface
from workbench.bodies.forward.joint_numbers import NumericJoints
from workbench.bodies.forward.landmark_numbers import NumericLandmarks
from workbench.bodies.forward.many_joints import ManyJoints
from workbench.bodies.forward.motion import Kinematics
from workbench.bodies.forward.numeric import Chunk, chunks_of
from workbench.bodies.forward.numeric_sources import NumericSurface
from workbench.bodies.forward.rest_points import RestPoints
from workbench.bodies.forward.skeleton import Skeleton
from workbench.bodies.landmarks import Landmarks


class PackedBody:
    """A skinned body's kinematics, its arrays packed for arithmetic, and its points in numbers."""

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
        return Kinematics(self.skeleton, self.arrays.bind_pose, self.arrays.parents)

    @cached_property
    def chunks(self) -> list[Chunk]:
        """All vertices."""
        return chunks_of(self.arrays, ALL)

    @cached_property
    def joints(self) -> NumericJoints:
        """The posed joints."""
        body = self.arrays
        many = ManyJoints.of(self.skeleton, body.bind_pose, body.parents)
        return NumericJoints(self.kinematics, many, body.parents)

    def surface(self, vertices: Vertices) -> NumericSurface:
        """All vertices of an SMPL body, or some."""
        some = vertices if isinstance(vertices, slice) else list(vertices)
        chunks = (lambda: self.chunks) if some == ALL else (lambda: chunks_of(self.arrays, some))
        return NumericSurface(self.kinematics, arithmetic_of(self.arrays, some, chunks), chunks)

    def freed(self, vertices: Vertices) -> FreedSurface:
        """Vertices of an SMPL body, some of whose arrays are given when they are asked for."""
        chosen = np.arange(self.arrays.n_vertices)[vertices]
        return FreedSurface(self.arrays, self.kinematics, chosen)

    def rest_points(self, landmarks: Landmarks) -> RestPoints:
        """The rest points of a linearly blended body's landmarks."""
        if landmarks not in self._rest_points:
            regressor, used = landmarks.of_vertices
            self._rest_points[landmarks] = RestPoints.of(self.arrays, used, regressor)
        return self._rest_points[landmarks]

    def landmarks(self, landmarks: Landmarks) -> NumericLandmarks:
        """Weighted means of an SMPL body's vertices."""
        return NumericLandmarks(self.kinematics, self.rest_points(landmarks), self.arrays.parents)

    @cached_property
    def skinned_rest(self) -> cs.Function:
        """(pose, betas) -> the posed surface before translation, (3, N), for any skinning."""
        K, _, B = self.skeleton.slopes.shape
        pose, betas = cs.MX.sym("pose", 3, K), cs.MX.sym("betas", B)
        nowhere = cs.MX(cs.DM.zeros(3))
        expression = surface.posed(self.arrays, pose, betas, nowhere)
        return cs.Function("skinned_rest", [pose, betas], [expression])
