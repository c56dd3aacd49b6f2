"""Blend shapes that stay near their joint: MANO's price on distance.

Left alone, least squares lets an elbow move a hip wherever the two went together in the data. MANO
(Romero, Tzionas, Black, ACM TOG 36(6), 2017) prices every joint's blend shapes by the squared
geodesic distance from the joint: sum over k, i of d(k, i)^2 |P_ki|^2.
"""

import numpy as np
from numpy.typing import NDArray

from workbench.bodies import SkinnedBody
from workbench.geometry.geodesics import along_edges
from workbench.geometry.solids import edges
from workbench.training.blend_shapes.regression import local_ridge

Array = NDArray[np.float64]
FAR = 0.2  # m from the joint: what is meant by far in `far_share`
NEAREST = 6  # vertices that stand for a joint whose part does not touch its parent's


def joint_distances(body: SkinnedBody) -> Array:
    """From every joint but the root to every vertex along the mesh, (K - 1, N) m.

    A joint is the ring of vertices where its part meets that of its parent.
    """
    part = body.weights.argmax(axis=1)
    joints, pairs = body.joints(), edges(body.faces)
    rings = []
    for k, parent in enumerate(body.parents[1:], start=1):
        across = (part[pairs] == k).any(axis=1) & (part[pairs] == parent).any(axis=1)
        ring = np.unique(pairs[across])
        if not len(ring):
            away = np.linalg.norm(body.template - joints[k], axis=1)
            ring = np.argsort(away)[:NEAREST]
        rings.append(ring)
    return along_edges(body.template, body.faces, rings)


def local_ridge_at(
    features: Array, shapes: Array, distances: Array, price: float, least: float
) -> Array:
    """Posedirs (N, 3, F) with a price, per pose, of price d^2 + least, d in m from the joint.

    A (n, F), with as many features for each joint; D (n, N, 3) m; distances (K - 1, N) m.
    """
    per_joint = features.shape[1] // len(distances)
    prices = least + price * np.repeat(distances.T**2, per_joint, axis=1)
    return local_ridge(features, shapes, prices)


def far_share(posedirs: Array, distances: Array) -> float:
    """|P farther than FAR from its joint| / |P|: how much of them is not local."""
    per_joint = posedirs.shape[2] // len(distances)
    far = np.repeat(distances.T > FAR, per_joint, axis=1)[:, None]
    return float(np.linalg.norm(posedirs * far) / np.linalg.norm(posedirs))
