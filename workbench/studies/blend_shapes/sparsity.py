"""Sparse blend shapes: a joint acts on few vertices, and on all others not at all.

STAR (Osman, Bolkart, Black, ECCV 2020) learns which vertices each joint may move, and drives them
by quaternions, four numbers a joint. Here the choice is a convex problem, the group lasso (Yuan
and Lin, J. Royal Statistical Society B 68(1), 2006): minimise

    1/2 |A P - D|^2 / n + penalty sum over joints k and vertices i of |P_ki|

where P_ki are a joint's numbers at a vertex. The larger the penalty, the more of them are zero.
"""

import numpy as np

from workbench.arrays import Array, Mask
from workbench.bodies import SkinnedBody
from workbench.geometry.solids import along_edges, mesh_edges
from workbench.training.blend_shapes import RidgeSums, solve_ridge

STEPS = 400  # of the accelerated proximal gradient method, at most
SETTLED = 1e-5  # a step that changes |P| by less ends it: within a thousandth of the minimum
REFIT_RIDGE = 1e-4  # per pose
FAR = 0.2  # m from the joint: what counts as far in `far_share`
NEAREST = 6  # vertices that stand for a joint whose part does not touch its parent's


def group_lasso(features: Array, wanted: Array, per_joint: int, penalty: float) -> Array:
    """Posedirs (N, 3, F) m, many of them zero.

    Takes feature matrices (n, F), correctives `wanted` (n, N, 3) m, and the penalty in m. The
    method is FISTA (Beck and Teboulle, SIAM J. Imaging Sciences 2(1), 2009), restarted where it
    overshoots (O'Donoghue and Candes, Foundations of Computational Mathematics 15, 2015).
    """
    n, N = len(wanted), wanted.shape[1]
    gram = features.T @ features / n
    products = features.T @ wanted.reshape(n, -1) / n  # (F, 3 N)
    step = 1 / float(np.linalg.eigvalsh(gram)[-1])
    P = ahead = np.zeros_like(products)
    t = 1.0
    for _ in range(STEPS):
        new = _shrunk(ahead - step * (gram @ ahead - products), N, per_joint, step * penalty)
        change = new - P
        if np.vdot(ahead - new, change) > 0:
            t = 1.0  # it overshoots: start the acceleration again
        t_new = (1 + np.sqrt(1 + 4 * t**2)) / 2
        ahead = new + (t - 1) / t_new * change
        P, t = new, t_new
        if np.linalg.norm(change) <= SETTLED * np.linalg.norm(P):
            break
    return np.ascontiguousarray(P.reshape(-1, N, 3).transpose(1, 2, 0))


def refitted(features: Array, wanted: Array, posedirs: Array) -> Array:
    """Least squares on the numbers that are not zero, all of which the lasso made too small."""
    nonzero: Mask = np.any(posedirs, axis=1)
    return solve_ridge(RidgeSums.of([(features, wanted)]), nonzero, REFIT_RIDGE)


def nonzero_share(posedirs: Array) -> float:
    """The share of the numbers that are not zero."""
    return float(np.count_nonzero(posedirs) / posedirs.size)


def _shrunk(P: Array, N: int, per_joint: int, by: float) -> Array:
    """Every group of (F, 3 N) shortened by `by`, or zero if it is shorter than that."""
    groups = P.reshape(-1, per_joint, N, 3)
    length = np.sqrt(np.einsum("kfic,kfic->ki", groups, groups))
    factor = np.maximum(0, 1 - by / np.maximum(length, 1e-300))
    shrunk: Array = (groups * factor[:, None, :, None]).reshape(P.shape)
    return shrunk


def joint_distances(body: SkinnedBody) -> Array:
    """From every joint but the root to every vertex along the mesh, (K - 1, N) m.

    A joint is the ring of vertices where its part meets that of its parent.
    """
    part = body.weights.argmax(axis=1)
    joints, pairs = body.joints(), mesh_edges(body.faces)
    rings = []
    for k, parent in enumerate(body.parents[1:], start=1):
        across = (part[pairs] == k).any(axis=1) & (part[pairs] == parent).any(axis=1)
        ring = np.unique(pairs[across])
        if not len(ring):
            away = np.linalg.norm(body.template - joints[k], axis=1)
            ring = np.argsort(away)[:NEAREST]
        rings.append(ring)
    return along_edges(body.template, body.faces, rings)


def local_ridge(
    features: Array, wanted: Array, distances: Array, penalty: float, ridge: float
) -> Array:
    """Posedirs (N, 3, F) m by ridge regression, with a larger ridge farther from the joint.

    Per pose the ridge of joint k's features at vertex i is penalty d(k, i)^2 + ridge, for feature
    matrices (n, F) with as many features for each joint, correctives `wanted` (n, N, 3) m, and
    distances (K - 1, N) m.
    """
    n, N = len(wanted), wanted.shape[1]
    per_joint = features.shape[1] // len(distances)
    ridges = n * (ridge + penalty * np.repeat(distances.T**2, per_joint, axis=1))
    gram, products = features.T @ features, np.tensordot(wanted, features, (0, 0))  # (N, 3, F)
    solved = (np.linalg.solve(gram + np.diag(ridges[i]), products[i].T).T for i in range(N))
    return np.stack(list(solved))


def far_share(posedirs: Array, distances: Array) -> float:
    """The norm of blend shapes further than FAR from their joint, over the norm of all of them."""
    per_joint = posedirs.shape[2] // len(distances)
    far = np.repeat(distances.T > FAR, per_joint, axis=1)[:, None]
    return float(np.linalg.norm(posedirs * far) / np.linalg.norm(posedirs))
