"""Posed joints of many bodies at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.arrays import Array, Index
from workbench.bodies.forward.skeleton import Skeleton
from workbench.geometry.rotation import matrix_from_vector


@dataclass(frozen=True, eq=False)
class ManyJoints:
    """A body's posed joints alone: `world_motions` of kinematics, all of a generation at once."""

    mean: Array  # (K - 1, 3) m, each bone in its parent's frame
    moves: Array  # (B, 3 (K - 1)) m
    root: tuple[Array, Array]  # (3,) and (B, 3) m
    generations: list[tuple[Index, Index]]  # joints, and their parents

    @staticmethod
    def of(skeleton: Skeleton, bind_pose: Array, tree: tuple[int, ...]) -> ManyJoints:
        """The bones, linear in betas as the skeleton is."""
        at, by_betas = skeleton.mean, skeleton.slopes
        K, _, B = by_betas.shape
        local, parents = matrix_from_vector(bind_pose), np.array(tree)
        bound = [local[0]]
        for k in range(1, K):
            bound.append(bound[parents[k]] @ local[k])
        up = parents[1:]
        turned = np.array(bound)[up].reshape(-1, 3, 3)
        mean = np.einsum("kdc,kd->kc", turned, at[1:] - at[up])
        moves = np.einsum("kdc,kdb->bkc", turned, by_betas[1:] - by_betas[up])
        depth = np.zeros(K, dtype=int)
        for k in range(1, K):
            depth[k] = depth[parents[k]] + 1
        each = (np.flatnonzero(depth == d) for d in range(1, int(depth.max(initial=0)) + 1))
        return ManyJoints(
            mean,
            moves.reshape(B, 3 * (K - 1)),
            (at[0], by_betas[0].T),
            [(k, parents[k]) for k in each],
        )

    def __call__(self, pose: Array, betas: Array) -> Array:
        """(M, K, 3) m for pose (M, K, 3) rad and betas (M, B), before translation."""
        M, K = pose.shape[:2]
        # SciPy's, for many: CasADi's own takes most of the time to convert its arguments
        R = Rotation.from_rotvec(pose.reshape(-1, 3)).as_matrix().reshape(M, K, 3, 3)
        bones = self.mean + (betas @ self.moves).reshape(M, K - 1, 3)
        joints = np.empty((M, K, 3))
        joints[:, 0] = self.root[0] + betas @ self.root[1]
        for k, up in self.generations:
            above = R[:, up]  # in the world by now
            joints[:, k] = joints[:, up] + np.einsum("mkdc,mkc->mkd", above, bones[:, k - 1])
            R[:, k] = above @ R[:, k]
        return joints
