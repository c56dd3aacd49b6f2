"""What every predictor is taught: poses, and what the teacher's skin does in them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from workbench.bodies import SkinnedBody
from workbench.bodies import surface as symbolic
from workbench.bodies.features import Features, Posture
from workbench.training.embedded.teacher import Teacher

Array = NDArray[np.float64]
Report = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Lesson:
    """n poses (n, K, 3) rad of the mean person and the teacher's surface in them, (n, N, 3) m."""

    poses: Array
    posed: Array

    @staticmethod
    def by(teacher: Teacher, poses: Array) -> Lesson:
        """Show poses to a teacher."""
        return Lesson(poses, np.stack([teacher.vertices(pose) for pose in poses]))

    def __len__(self) -> int:
        return len(self.poses)

    def some(self, chosen: slice | NDArray[np.int64]) -> Lesson:
        """Fewer of them."""
        return Lesson(self.poses[chosen], self.posed[chosen])


def bulges(body: SkinnedBody, lesson: Lesson) -> Array:
    """What must be added to the rest surface for the body's skinning to give the teacher's.

    (n, N, 3) m: M_i^-1 (v_i - m_i) - T_i, skinning being v -> M_i v + m_i for every vertex.
    """
    motions = _vertex_motions(body)
    found = np.empty_like(lesson.posed)
    for i, pose in enumerate(lesson.poses):
        at = np.asarray(motions(pose.T)).T.reshape(4, body.n_vertices, 3)
        M, m = (at[1:] - at[0]).transpose(1, 2, 0), at[0]
        rest = np.linalg.solve(M, (lesson.posed[i] - m)[..., None])[..., 0]
        found[i] = rest - body.template
    return found


def feature_matrix(body: SkinnedBody, features: Features, poses: Array) -> Array:
    """f(theta) of every pose, (n, F)."""
    pose = cs.MX.sym("pose", 3, body.n_joints)
    column = features(Posture.of(pose, cs.DM(body.bind_pose.T)))
    f = cs.Function("features", [pose], [cs.densify(column)])
    return np.array([np.asarray(f(theta.T)).ravel() for theta in poses])


def taught(body: SkinnedBody, features: Features, posedirs: Array) -> SkinnedBody:
    """The body with other features and their shapes (N, 3, F)."""
    return replace(body, features=features, posedirs=posedirs)


def _vertex_motions(body: SkinnedBody) -> cs.Function:
    """pose -> (3, 4 N): where skinning puts the origin and the three unit vectors."""
    pose, N = cs.MX.sym("pose", 3, body.n_joints), body.n_vertices
    betas = cs.MX.zeros(body.n_betas)
    G, _ = symbolic.motions(body, symbolic.posture(body, pose), betas)
    corners = np.vstack([np.zeros(3), np.eye(3)])
    weights = symbolic.weights(body)
    moved = [
        body.skinning(cs.MX(cs.DM(np.tile(corner, (N, 1)).T)), G, weights) for corner in corners
    ]
    return cs.Function("vertex_motions", [pose], [cs.horzcat(*moved)])
