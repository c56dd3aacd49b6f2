"""The half of a body that does not know how many vertices there are: its kinematics, derived."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from workbench.blocks.buffered import Buffered
from workbench.blocks.many import Many, Mapped
from workbench.bodies.kinematics import binding_motions, bones_of, pose_features, world_motions
from workbench.geometry.rotation import rodrigues

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """What the kinematics say at one pose and shape; K joints, B betas."""

    G: Array  # (K, 3, 4): rest to posed
    features: Array  # (9 (K - 1),)
    joints: Array  # (K, 3) m, posed


@dataclass(frozen=True, eq=False)
class Slopes:
    """How a motion changes with pose and betas."""

    turns: Array  # (K, 9, 3): rows (a, d), u -> (axis of pose[k, a] x u)_d
    d_features: Array  # (K - 1, 3, 9): joint k + 1's features by its own three numbers
    d_shift: Array  # (3 B, K): rows (b, d), the last column of G_k by betas[b]


class Kinematics:
    """A body's joints, motions and features as CasADi functions of pose and betas, and back."""

    def __init__(self, body: SkinnedBody) -> None:
        self._sizes = K, B = body.n_joints, body.n_betas
        pose, betas = cs.SX.sym("pose", 3, K), cs.SX.sym("betas", B)
        mean = body.J_regressor @ body.template  # (K, 3)
        moves = body.J_regressor @ body.shapedirs.reshape(body.n_vertices, 3 * B)  # (K, 3 B)
        moved = cs.DM(moves.reshape(3 * K, B)) @ betas
        rest = cs.SX(cs.DM(mean.T)) + cs.reshape(moved, 3, K)
        R, R_bind = rodrigues(pose), rodrigues(cs.SX(cs.DM(body.bind_pose.T)))
        G, joints = binding_motions(R, R_bind, rest, body.parents)
        features = pose_features(R, R_bind)
        world = world_motions(R, bones_of(rest, R_bind, body.parents), body.parents)
        turns, d_features = [], []
        for k, R_k in enumerate(cs.horzsplit(R, 3)):
            up = world[body.parents[k]][0] if k else cs.SX.eye(3)
            for column in cs.horzsplit(cs.jacobian(cs.vec(R_k), pose[:, k]), 1):
                turn = up @ (cs.reshape(column, 3, 3) @ R_k.T) @ up.T  # [axis]x, in the world
                turns.append(turn)
            if k:
                d_features.append(cs.jacobian(cs.vec(R_k.T), pose[:, k]))
        stacked = cs.horzcat(*G)  # (3, 4 K)
        shift = cs.horzcat(*[motion[:, 3] for motion in G])  # (3, K)
        by_betas = [cs.reshape(c, 3, K) for c in cs.horzsplit(cs.jacobian(cs.vec(shift), betas), 1)]
        outputs = [cs.vertcat(*[cs.vec(motion.T) for motion in G]), features, joints]
        slopes = [
            cs.vertcat(*[cs.vec(turn.T) for turn in turns]),
            cs.vertcat(*[cs.vec(d) for d in d_features]) if d_features else cs.SX(0, 1),
            cs.vertcat(*[cs.vec(d.T) for d in by_betas]) if B else cs.SX(0, 1),
        ]
        self._motion, self._slopes = (
            Buffered(cs.Function("kinematics", [pose, betas], [cs.densify(part) for part in parts]))
            for parts in (outputs, slopes)
        )
        pull_G = cs.SX.sym("pull_G", 3, 4 * K)
        pull_f = cs.SX.sym("pull_f", features.shape[0])
        felt = cs.dot(pull_G, stacked) + cs.dot(pull_f, features)
        back = [cs.densify(cs.gradient(felt, pose)), cs.densify(cs.gradient(felt, betas))]
        self._back = Buffered(cs.Function("adjoint", [pose, betas, pull_G, pull_f], back))

    def motion(self, pose: Array, betas: Array) -> Motion:
        """At pose (K, 3) rad and betas (B,)."""
        K, _ = self._sizes
        G, features, joints = self._motion(pose, betas)
        return Motion(G.reshape(K, 3, 4), features, joints.reshape(K, 3))

    def motions(self, pose: Array, betas: Array) -> tuple[Array, Array]:
        """G (M, K, 3, 4) and features (M, F), at poses (M, K, 3) rad and betas (M, B)."""
        K, _ = self._sizes
        G, features, _joints = self._motions(pose.reshape(len(pose), 3 * K), betas)
        return G.reshape(len(pose), K, 3, 4), features

    @cached_property
    def _motions(self) -> Many:
        return Mapped(self._motion.function, (False, False))

    def slopes(self, pose: Array, betas: Array) -> Slopes:
        """Of the motion at pose (K, 3) rad and betas (B,)."""
        K, B = self._sizes
        turns, d_features, d_shift = self._slopes(pose, betas)
        return Slopes(
            turns.reshape(K, 9, 3),
            d_features.reshape(max(0, K - 1), 3, 9),
            d_shift.reshape(3 * B, K),
        )

    def adjoint(
        self, pose: Array, betas: Array, on_G: Array, on_features: Array
    ) -> tuple[Array, Array]:
        """The gradients (K, 3) and (B,) of sum(on_G * G) + on_features . f, on_G (K, 3, 4)."""
        on_pose, on_betas = self._back(pose, betas, on_G.transpose(0, 2, 1), on_features)
        return on_pose.reshape(pose.shape), on_betas
