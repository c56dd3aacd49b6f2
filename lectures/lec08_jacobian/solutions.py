"""Solutions of lecture 8."""

import numpy as np
import scipy.linalg

import workbench as wb

Array = np.ndarray
EPS = np.finfo(float).eps


def rank(J: Array) -> int:
    s = np.linalg.svd(J, compute_uv=False)
    return int(np.sum(s > EPS * max(J.shape) * s.max()))


def null_space(J: Array) -> Array:
    _, _, Vt = np.linalg.svd(J, full_matrices=True)
    return Vt[rank(J) :].T


def depends(parents: list[int]) -> Array:
    pattern = np.zeros((len(parents), len(parents)), dtype=int)
    for i, parent in enumerate(parents):
        k = parent  # not i itself: a turn about its own place moves what hangs on it
        while k >= 0:
            pattern[i, k] = 1
            k = parents[k]
    return pattern


def rank_of_tree(parents: list[int]) -> int:
    children = [sum(parent == k for parent in parents) for k in range(len(parents))]
    return sum(min(3, n + 1) if n else 0 for n in children)  # 0, 2, 3


def sigmas(J: Array) -> Array:
    _, s, Vt = np.linalg.svd(J, full_matrices=True)
    r = rank(J)
    variance = np.sum((Vt[:r].T / s[:r]) ** 2, axis=1)
    unseen = np.sum(Vt[r:] ** 2, axis=0) > 1e-9
    return np.where(unseen, np.inf, np.sqrt(variance))


def markers() -> list[int]:
    # greedy, by QR with pivoting: what is left of each vertex's rows in the joints' null space
    body = wb.load_body("small")
    pose = 0.3 * np.random.default_rng(8).standard_normal((24, 3))
    by_joints, by_vertices = derivatives(body, pose)
    N = null_space(by_joints)
    left = by_vertices.reshape(-1, 3, 72) @ N  # (N, 3, 32)
    chosen: list[int] = []
    for _ in range(24):
        best = int(np.argmax(np.linalg.norm(left, axis=(1, 2))))
        chosen.append(best)
        Q = scipy.linalg.orth(left[best].T)
        left = left - (left @ Q) @ Q.T
    return chosen


def derivatives(body: wb.SkinnedBody, at: Array) -> tuple[Array, Array]:
    """Of the joints (3 K, 72) and of the vertices (3 N, 72), in metres per radian."""
    pose, betas, trans = (block.symbol for block in body.blocks())
    joints, skin = body.joint_points(pose, betas, trans), body.points(pose, betas, trans)
    values = body.start() | {"pose": at}
    return tuple(
        wb.Problem([residual], ["pose"]).linearize(values).jacobian
        for residual in (
            wb.residuals.landmarks(joints, np.zeros((24, 3)), sigma=1.0),
            wb.residuals.vertices(skin, np.zeros((body.n_vertices, 3)), sigma=1.0),
        )
    )
