"""How much of the shape of people their poses explain, where poses were not taken away."""

import numpy as np

from workbench.arrays import Array
from workbench.geometry.rigid import procrustes
from workbench.training.registrations import Registrations, batches

SHOWN = 3  # shape directions for which the share of pose is measured


def pose_share(people: Array, poses: Array) -> tuple[float, ...]:
    """How much of each first principal coordinate a linear function of pose explains.

    The adjusted R^2 of people (P, N, 3) on poses (P, K, 3) rad without the root's, which is R^2
    minus what as many random numbers would explain.
    """
    away = (people - people.mean(axis=0)).reshape(len(people), -1)
    U, s, _ = np.linalg.svd(away, full_matrices=False)
    turns = poses[:, 1:].reshape(len(poses), -1)
    A = np.concatenate([np.ones((len(poses), 1)), turns[:, turns.std(axis=0) > 1e-9]], axis=1)
    rank, P = int(np.linalg.matrix_rank(A)), len(people)
    if rank >= P:
        return tuple(float("nan") for _ in range(SHOWN))
    shares = []
    for coordinate in (U * s)[:, :SHOWN].T:
        left = coordinate - A @ np.linalg.lstsq(A, coordinate, rcond=None)[0]
        unexplained = float(left @ left / (coordinate @ coordinate))
        shares.append(1 - unexplained * (P - 1) / (P - rank))
    return tuple(shares)


def aligned(registrations: Registrations) -> Array:
    """Every mesh moved rigidly onto the first, (P, N, 3) m, in the pose in which it was."""
    meshes: list[Array] = []
    for batch in batches(registrations):
        for vertices in batch.vertices:
            first = meshes[0] if meshes else vertices
            meshes.append(procrustes(vertices, first)(vertices))
    return np.stack(meshes)
