"""What every predictor learns from: poses, and the synthetic teacher's surface in each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as cs
import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.bodies.forward import surface as symbolic
from workbench.bodies.forward.features import Features, Posture
from workbench.synthetic.teacher import Teacher
from workbench.training.skinning_pass import bent


@dataclass(frozen=True, eq=False)
class PosedSurfaces:
    """The mean person in n poses.

    Attributes:
        poses: (n, K, 3) in radians.
        vertices: (n, N, 3) in metres, the teacher's surface in each pose.
    """

    poses: Array
    vertices: Array

    @staticmethod
    def of(teacher: Teacher, poses: Array) -> PosedSurfaces:
        """The surfaces of a teacher in poses (n, K, 3) rad."""
        return PosedSurfaces(poses, np.stack([teacher.vertices(pose) for pose in poses]))

    def __len__(self) -> int:
        return len(self.poses)

    def some(self, chosen: slice | Index) -> PosedSurfaces:
        """The chosen poses and their surfaces alone."""
        return PosedSurfaces(self.poses[chosen], self.vertices[chosen])


def correctives(body: SkinnedBody, posed: PosedSurfaces) -> Array:
    """What must be added to the rest surface so that the body's skinning gives the posed surface.

    (n, N, 3) m: M_i^-1 (v_i - m_i) - T_i, where skinning takes every vertex v to M_i v + m_i.
    """
    motions = _vertex_motions(body)
    found = np.empty_like(posed.vertices)
    for i, pose in enumerate(posed.poses):
        at = np.asarray(motions(pose.T)).T.reshape(4, body.n_vertices, 3)
        M, m = (at[1:] - at[0]).transpose(1, 2, 0), at[0]
        found[i] = np.linalg.solve(M, (posed.vertices[i] - m)[..., None])[..., 0] - body.template
    return found


def feature_matrix(body: SkinnedBody, features: Features, poses: Array) -> Array:
    """The features of the mean person in poses (n, K, 3) rad, one row for each pose: (n, F)."""
    pose = cs.MX.sym("pose", 3, body.n_joints)
    column = features(Posture.of(pose, cs.DM(body.bind_pose.T), cs.MX.zeros(body.n_betas)))
    f = cs.Function("features", [pose], [cs.densify(column)])
    return np.array([np.asarray(f(theta.T)).ravel() for theta in poses])


def with_blend_shapes(body: SkinnedBody, features: Features, posedirs: Array) -> SkinnedBody:
    """The body with other features and their pose blend shapes (N, 3, F) m."""
    return replace(body, features=features, posedirs=posedirs)


def rms_error(features: Array, wanted: Array, posedirs: Array) -> float:
    """Root mean square length, in m, of the part of correctives (n, N, 3) not explained.

    The explained part is `posedirs` (N, 3, F) times `features` (n, F).
    """
    return rms_length(wanted - bent(posedirs, features))


def rms_length(vectors: Array) -> float:
    """Root mean square length of vectors (..., 3), in their unit."""
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=-1))))


def _vertex_motions(body: SkinnedBody) -> cs.Function:
    """pose -> (3, 4 N): where skinning takes the origin and the three unit vectors."""
    pose, N = cs.MX.sym("pose", 3, body.n_joints), body.n_vertices
    at = symbolic.posture(body, pose, cs.MX.zeros(body.n_betas))
    G, _ = symbolic.motions(body, at)
    weights = symbolic.weights(body)
    corners = np.vstack([np.zeros(3), np.eye(3)])
    moved = [
        body.skinning(cs.MX(cs.DM(np.tile(corner, (N, 1)).T)), G, weights) for corner in corners
    ]
    return cs.Function("vertex_motions", [pose], [cs.horzcat(*moved)])
