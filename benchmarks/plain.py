"""Linear blend skinning as one would write it, in NumPy or in jax.numpy."""

from dataclasses import dataclass
from typing import Any

import numpy as np

import workbench as wb


@dataclass(frozen=True, eq=False)
class Arrays:
    """A body's arrays in the order that matrix products like; joints follow betas directly."""

    template: Any  # (3 N,) m
    shapedirs: Any  # (B, 3 N)
    posedirs: Any  # (9 (K - 1), 3 N)
    weights: Any  # (N, K)
    joints: Any  # (3 K,) m
    joint_shapedirs: Any  # (B, 3 K)

    @staticmethod
    def of(body: wb.SkinnedBody) -> "Arrays":
        """Of a body of the workbench."""
        N, K, B = body.n_vertices, body.n_joints, body.n_betas
        moved = body.J_regressor @ body.shapedirs.reshape(N, 3 * B)  # (K, 3 B)
        return Arrays(
            body.template.ravel(),
            np.ascontiguousarray(body.shapedirs.reshape(3 * N, B).T),
            np.ascontiguousarray(body.posedirs.reshape(3 * N, -1).T),
            body.weights,
            (body.J_regressor @ body.template).ravel(),
            np.ascontiguousarray(moved.reshape(3 * K, B).T),
        )


def vertices(xp: Any, arrays: Any, parents: tuple[int, ...], x: Any) -> Any:
    """(N, 3) m at x = (pose, betas, trans), flat, computed by the module xp; arrays in order."""
    template, shapedirs, posedirs, weights, joints, joint_shapedirs = arrays
    K, B = len(parents), len(shapedirs)
    pose, betas, trans = x[: 3 * K].reshape(K, 3), x[3 * K : 3 * K + B], x[3 * K + B :]
    R = rotations(xp, pose)
    rest = (joints + betas @ joint_shapedirs).reshape(K, 3)
    turned, at = [R[0]], [rest[0]]
    for k in range(1, K):
        parent = parents[k]
        turned.append(turned[parent] @ R[k])
        at.append(turned[parent] @ (rest[k] - rest[parent]) + at[parent])
    Q, t = xp.stack(turned), xp.stack(at)
    shift = t - xp.einsum("kdc,kc->kd", Q, rest)
    G = xp.concatenate([Q, shift[:, :, None]], axis=2).reshape(K, 12)
    features = (R[1:] - xp.eye(3)).reshape(-1)
    v = (template + betas @ shapedirs + features @ posedirs).reshape(-1, 3)
    M = (weights @ G).reshape(-1, 3, 4)
    return xp.einsum("ndc,nc->nd", M[:, :, :3], v) + M[:, :, 3] + trans


def rotations(xp: Any, pose: Any) -> Any:
    """exp([pose_k]x), (K, 3, 3), by Rodrigues' formula, smooth at zero."""
    t = xp.sqrt((pose**2).sum(axis=1) + 1e-32)[:, None, None]
    zero = xp.zeros_like(pose[:, 0])
    a, b, c = pose[:, 0], pose[:, 1], pose[:, 2]
    S = xp.stack([zero, -c, b, c, zero, -a, -b, a, zero], axis=1).reshape(-1, 3, 3)
    return xp.eye(3) + xp.sin(t) / t * S + 2 * (xp.sin(t / 2) / t) ** 2 * (S @ S)
