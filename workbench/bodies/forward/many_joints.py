"""Posed joints of many bodies at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.arrays import Array, Index
from workbench.bodies.forward.kinematics import ancestors
from workbench.bodies.forward.posing import world_rotations
from workbench.bodies.forward.skeleton import Skeleton
from workbench.geometry.rotation import matrix_from_vector


@dataclass(frozen=True, eq=False)
class ManyJoints:
    """A body's posed joints alone: `world_motions` of kinematics, all of a generation at once.

    Attributes:
        mean: (K - 1, 3) m, each bone of the mean person in its parent's frame.
        moves: (B, 3 (K - 1)) m, what each of the betas adds to the bones.
        root: (3,) and (B, 3) m, the place of the root and what each of the betas adds to it.
        generations: the joints at each distance from the root, with their parents.
    """

    mean: Array
    moves: Array
    root: tuple[Array, Array]
    generations: list[tuple[Index, Index]]

    @staticmethod
    def of(skeleton: Skeleton, bind_pose: Array, tree: tuple[int, ...]) -> ManyJoints:
        """The bones, linear in betas as the skeleton is."""
        at, by_betas = skeleton.mean, skeleton.slopes
        K, _, B = by_betas.shape
        local, parents = matrix_from_vector(bind_pose), np.array(tree)
        up = parents[1:]
        turned = world_rotations(local, tree)[up]
        mean = np.einsum("kdc,kd->kc", turned, at[1:] - at[up])
        moves = np.einsum("kdc,kdb->bkc", turned, by_betas[1:] - by_betas[up])
        depth = ancestors(tree).sum(axis=1) - 1
        levels = (np.flatnonzero(depth == d) for d in range(1, int(depth.max()) + 1))
        return ManyJoints(
            mean,
            moves.reshape(B, 3 * (K - 1)),
            (at[0], by_betas[0].T),
            [(k, parents[k]) for k in levels],
        )

    def __call__(self, pose: Array, betas: Array) -> Array:
        """The joints (M, K, 3) m for pose (M, K, 3) rad and betas (M, B), untranslated."""
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
