"""The joints of a body for many poses at once, a generation of the skeleton after the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.arrays import Array, Index
from workbench.bodies.forward.kinematics import ancestors
from workbench.bodies.forward.motion import Motion
from workbench.bodies.forward.posing import world_rotations
from workbench.bodies.forward.skeleton import Skeleton
from workbench.geometry.rotation import matrix_from_vector


@dataclass(frozen=True, eq=False)
class JointBatch:
    """A body's posed joints and their motions; the formulas are those of `kinematics`.

    Attributes:
        skeleton: where the joints are at rest.
        bind: (K, 3, 3) the rotations of the joints in the bind pose, in their parents' frames.
        bound: (K, 3, 3) the same in the world.
        mean: (K - 1, 3) m, each bone of the mean person in its parent's frame.
        moves: (B, 3 (K - 1)) m, what each of the betas adds to the bones.
        generations: the joints at each distance from the root, with their parents.
    """

    skeleton: Skeleton
    bind: Array
    bound: Array
    mean: Array
    moves: Array
    generations: list[tuple[Index, Index]]

    @staticmethod
    def of(skeleton: Skeleton, bind_pose: Array, tree: tuple[int, ...]) -> JointBatch:
        """The bones, linear in betas as the skeleton is."""
        at, by_betas = skeleton.mean, skeleton.slopes
        K, _, B = by_betas.shape
        local, parents = matrix_from_vector(bind_pose), np.array(tree)
        bound, up = world_rotations(local, tree), parents[1:]
        mean = np.einsum("kdc,kd->kc", bound[up], at[1:] - at[up])
        moves = np.einsum("kdc,kdb->bkc", bound[up], by_betas[1:] - by_betas[up])
        depth = ancestors(tree).sum(axis=1) - 1
        levels = (np.flatnonzero(depth == d) for d in range(1, int(depth.max()) + 1))
        return JointBatch(
            skeleton,
            local,
            bound,
            mean,
            moves.reshape(B, 3 * (K - 1)),
            [(k, parents[k]) for k in levels],
        )

    def __call__(self, pose: Array, betas: Array) -> Array:
        """The joints (M, K, 3) m for pose (M, K, 3) rad and betas (M, B), untranslated."""
        return self._posed(pose, betas)[2]

    def motions(self, pose: Array, betas: Array) -> Motion:
        """The motions for pose (M, K, 3) rad and betas (M, B)."""
        local, world, joints = self._posed(pose, betas)
        M, K = joints.shape[:2]
        G = np.empty((M, K, 3, 4))
        turn = np.matmul(world, self.bound.transpose(0, 2, 1), out=G[..., :3])
        slopes = self.skeleton.slopes
        at_rest = self.skeleton.mean + (betas @ slopes.reshape(3 * K, -1).T).reshape(M, K, 3)
        G[..., 3] = joints - np.einsum("mkdc,mkc->mkd", turn, at_rest)
        return Motion(G, (local - self.bind)[:, 1:].reshape(M, 9 * (K - 1)), joints)

    def _posed(self, pose: Array, betas: Array) -> tuple[Array, Array, Array]:
        """Rotations in the parents' frames and in the world (M, K, 3, 3), and joints (M, K, 3)."""
        M, K = pose.shape[:2]
        # SciPy's, for many: CasADi's own takes most of the time to convert its arguments
        turns = Rotation.from_rotvec(np.array(pose).reshape(-1, 3))
        local = turns.as_matrix().reshape(M, K, 3, 3)
        bones = self.mean + (betas @ self.moves).reshape(M, K - 1, 3)
        world, joints = local.copy(), np.empty((M, K, 3))
        joints[:, 0] = self.skeleton.mean[0] + betas @ self.skeleton.slopes[0].T
        for k, up in self.generations:
            above = world[:, up]
            joints[:, k] = joints[:, up] + np.einsum("mkdc,mkc->mkd", above, bones[:, k - 1])
            world[:, k] = above @ local[:, k]
        return local, world, joints
