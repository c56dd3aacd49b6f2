"""Blend shapes that stay near their joint: MANO's penalty on distance.

Without a penalty, least squares lets an elbow move a hip wherever the two moved together in the
data. Romero, Tzionas and Black (Embodied Hands, ACM TOG 36(6), 2017) penalise every joint's blend
shapes by the squared geodesic distance from the joint: sum over k, i of d(k, i)^2 |P_ki|^2.
"""

import numpy as np

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.geometry.mesh_graph import along_edges
from workbench.geometry.solids import mesh_edges

FAR = 0.2  # m from the joint: what counts as far in `far_share`
NEAREST = 6  # vertices that stand for a joint whose part does not touch its parent's


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
