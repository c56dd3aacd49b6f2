"""Points inside or on a body as weighted means of its vertices: joints and keypoints."""

from collections.abc import Sequence

import numpy as np
import scipy.linalg
import scipy.optimize

from workbench.arrays import Array, Index
from workbench.geometry.mirror import opposites

ROW_SUM_FIRMNESS = 10.0  # m: how strongly a row is held to the sum one before it is scaled to it
FEWEST_CANDIDATES, MOST_CANDIDATES = 30, 600
MOST_NONZEROS = 40


def regress(
    people: Array, points: Array, names: Sequence[str], mirror: Index, radius: float
) -> Array:
    """A regressor (M, N): rows are not negative, sum to one, and are alike on both sides.

    It gives `points` (P, M, 3) from the vertices `people` (P, N, 3), in the least-squares sense,
    among the vertices within `radius` m of each point. Rows on the right are those of the left,
    reflected; rows on the midline weigh a vertex and its opposite alike.
    """
    regressor = np.zeros((len(names), people.shape[1]))
    means = people.mean(axis=0)
    for k, opposite in enumerate(opposites(names)):
        if opposite < k:  # the joint on the left has been done
            regressor[k] = regressor[opposite][mirror]
            continue
        near = _near(means, points[:, k].mean(axis=0), radius)
        partners = mirror if opposite == k else np.arange(len(mirror))
        pairs = np.unique([sorted((v, partners[v])) for v in near], axis=0)
        weights = _row(people, points[:, k], pairs)
        most = np.argsort(-weights)[: MOST_NONZEROS // (2 if opposite == k else 1)]
        weights = _row(people, points[:, k], pairs := pairs[most[weights[most] > 0]])
        for side in (0, 1):
            np.add.at(regressor[k], pairs[:, side], weights / 2)
    return regressor


def _near(vertices: Array, point: Array, radius: float) -> Index:
    """The vertices within a radius, at most so many of them, evenly over the distances."""
    distances = np.linalg.norm(vertices - point, axis=1)
    order = np.argsort(distances, kind="stable")
    order = order[: max(np.count_nonzero(distances < radius), FEWEST_CANDIDATES)]
    return order[:: -(-len(order) // MOST_CANDIDATES)]


def _row(people: Array, points: Array, pairs: Index) -> Array:
    """Weights (C,) >= 0 of pairs of vertices (C, 2), summing to one, that give the points."""
    middles = people[:, pairs].mean(axis=2)  # (P, C, 3)
    away = (middles - points[:, None]).transpose(0, 2, 1).reshape(-1, len(pairs))
    firm = ROW_SUM_FIRMNESS * np.sqrt(len(people))
    A = np.concatenate([away, np.full((1, len(pairs)), firm)])
    Q, R = scipy.linalg.qr(A, mode="economic")  # the same least squares, with fewer rows
    weights, _ = scipy.optimize.nnls(R, firm * Q[-1], maxiter=100 * len(pairs))
    scaled: Array = weights / weights.sum()
    return scaled
