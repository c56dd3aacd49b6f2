"""Posed joints in numbers, from what the kinematics say, however many vertices there are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.bodies.forward.motion import Motion, Slopes
from workbench.bodies.forward.rows import Target, write
from workbench.bodies.forward.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class JointArithmetic:
    """The posed joints of a body; see Arithmetic.

    With t_k = G'_k (j_k; 1) the posed joint k, and w_ka the axis about which the world turns when
    pose[k, a] grows,

        dt_j/dpose[k, a] = w_ka x (t_j - t_k) for every j below k, and zero for all others.

    Attributes:
        skeleton: the joints at rest.
        ancestors: (K, K), see `kinematics.ancestors`.
    """

    skeleton: Skeleton
    ancestors: Array

    def evaluate(self, motion: Motion, betas: Array) -> JointsAtOrigin:
        """The joints moved by a motion, of the person with these betas (B,)."""
        return JointsAtOrigin(self, motion, betas)

    evaluate_each = evaluate  # at M motions and betas (M, B): the formulas are the same


@dataclass(frozen=True, eq=False)
class JointsAtOrigin:
    """The joints before translation, at one motion and betas (B,); see AtOrigin.

    Where there are M motions and betas (M, B), see ManyAtOrigin.
    """

    of: JointArithmetic
    motion: Motion
    betas: Array

    @property
    def points(self) -> Array:
        """The posed joints before translation, (..., K, 3) m."""
        return self.motion.joints

    def __getitem__(self, some: slice) -> JointsAtOrigin:
        """Those at some of the motions."""
        return JointsAtOrigin(self.of, self.motion[some], self.betas[some])

    def write_jacobian(
        self, slopes: Slopes, into: Mapping[str, Target], scale: Array | None
    ) -> None:
        """Write the transposed derivative into `pose`, `betas` and `trans`, (size, 3 K) each."""
        for role, target in into.items():
            write(target, self.derivative(slopes, role), scale)

    def derivative(self, slopes: Slopes, role: str) -> Array:
        """The transposed derivative by `pose`, `betas` or `trans`, (..., size, 3 K)."""
        if role == "trans":
            return np.tile(np.eye(3), self.points.shape[-2])
        return self._by_pose(slopes) if role == "pose" else self._by_betas(slopes)

    def vjp(self, cotangent: Array) -> tuple[Array, Array, Array]:
        """Gradients of cotangent (K, 3) . points by G (K, 3, 4), features and betas."""
        skeleton = self.of.skeleton
        rest = np.ones((len(cotangent), 4))
        rest[:, :3] = skeleton.positions(self.betas)
        on_rest = np.matmul(cotangent[:, None], self.motion.G[:, :, :3]).ravel()
        on_betas = on_rest @ skeleton.slopes.reshape(len(on_rest), len(self.betas))
        return cotangent[:, :, None] * rest[:, None], np.zeros_like(self.motion.features), on_betas

    def _by_pose(self, slopes: Slopes) -> Array:
        """The transposed derivative of the joints by the pose, (..., 3 K, 3 K)."""
        t = self.points
        *some, K, _ = t.shape
        arms = t.swapaxes(-1, -2)[..., None, :, :] - t[..., None]  # (K, 3, K): from joint k to j
        arms *= self.of.ancestors.T[:, None]
        found: Array = np.matmul(slopes.turns, arms).reshape(*some, K, 3, 3, K)
        return found.swapaxes(-1, -2).reshape(*some, 3 * K, 3 * K)

    def _by_betas(self, slopes: Slopes) -> Array:
        """The transposed derivative of the joints by betas, (..., B, 3 K)."""
        *some, K, _ = self.points.shape
        B = self.betas.shape[-1]
        at_rest = self.motion.G[..., :3] @ self.of.skeleton.slopes  # (K, 3, B)
        moved: Array = at_rest.swapaxes(-1, -3) + slopes.d_shift.reshape(*some, B, 3, K)
        return moved.swapaxes(-1, -2).reshape(*some, B, 3 * K)
