"""Solutions of lecture 18."""

import numpy as np

Array = np.ndarray


def pose_of(mean: Array, components: Array, z: Array) -> Array:
    return mean + np.tensordot(z, components, axes=1)


def components_needed(deviations: Array, share: float) -> int:
    variance = deviations**2
    return int(np.argmax(np.cumsum(variance) >= share * variance.sum() * (1 - 1e-12))) + 1


def mirrored(vertices: Array, pose: Array) -> tuple[Array, Array]:
    return vertices * [-1.0, 1.0, 1.0], pose * [1.0, -1.0, -1.0]


def whole_pose(body: Array, left: Array, right: Array) -> Array:
    return np.concatenate([body[:22], left, right])


def seen_turns(joints: Array, points: Array, moved_by: Array) -> int:
    J = np.zeros((len(points), 3, len(joints), 3))
    for m, point in enumerate(points):
        for k, joint in enumerate(joints):
            if moved_by[m, k]:
                for axis in range(3):
                    J[m, :, k, axis] = np.cross(np.eye(3)[axis], point - joint)
    return int(np.linalg.matrix_rank(J.reshape(3 * len(points), -1), tol=1e-9))
