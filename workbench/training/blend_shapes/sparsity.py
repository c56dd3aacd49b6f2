"""Blend shapes that are mostly nothing: whole joints switched off, vertex by vertex.

STAR (Osman, Bolkart, Black, ECCV 2020) learns which vertices each joint may move, and drives them
by quaternions, four numbers a joint. Here the choice is a convex problem, the group lasso (Yuan
and Lin, J. Royal Statistical Society B 68(1), 2006): minimise

    1/2 |A P - D|^2 / n + price sum over joints k and vertices i of |P_ki|

where P_ki are a joint's numbers at a vertex. The larger the price, the more of them are zero.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEPS = 400  # of the accelerated proximal gradient, at most
SETTLED = 1e-5  # of |P|, what one step still changes: within a thousandth of the least, as measured
REFIT_RIDGE = 1e-4  # per pose


def group_lasso(features: Array, shapes: Array, per_joint: int, price: float) -> Array:
    """Posedirs (N, 3, F), many of them zero: A (n, F), D (n, N, 3) m, price in m.

    Beck and Teboulle's FISTA (SIAM J. Imaging Sciences 2(1), 2009), restarted where it overshoots
    (O'Donoghue and Candes, Foundations of Computational Mathematics 15, 2015).
    """
    n, N = len(shapes), shapes.shape[1]
    gram = features.T @ features / n
    products = features.T @ shapes.reshape(n, -1) / n  # (F, 3 N)
    step = 1 / float(np.linalg.eigvalsh(gram)[-1])
    P = ahead = np.zeros_like(products)
    t = 1.0
    for _ in range(STEPS):
        new = _shrunk(ahead - step * (gram @ ahead - products), N, per_joint, step * price)
        change = new - P
        if np.vdot(ahead - new, change) > 0:
            t = 1.0  # it overshoots: start the acceleration again
        t_new = (1 + np.sqrt(1 + 4 * t**2)) / 2
        ahead = new + (t - 1) / t_new * change
        P, t = new, t_new
        if np.linalg.norm(change) <= SETTLED * np.linalg.norm(P):
            break
    return np.ascontiguousarray(P.reshape(-1, N, 3).transpose(1, 2, 0))


def refitted(features: Array, shapes: Array, posedirs: Array, per_joint: int) -> Array:
    """Least squares on what the lasso has left, which it made too small."""
    n, N = len(shapes), shapes.shape[1]
    gram = features.T @ features + REFIT_RIDGE * n * np.eye(features.shape[1])
    products = (features.T @ shapes.reshape(n, -1)).reshape(-1, N, 3)
    kept = posedirs.any(axis=1)  # (N, F)
    patterns, group = np.unique(kept, axis=0, return_inverse=True)
    found = np.zeros_like(posedirs)
    for g, pattern in enumerate(patterns):
        own, members = np.flatnonzero(pattern), np.flatnonzero(group.ravel() == g)
        if len(own):
            right = products[np.ix_(own, members)].reshape(len(own), -1)
            solved = np.linalg.solve(gram[np.ix_(own, own)], right)
            found[np.ix_(members, np.arange(3), own)] = solved.reshape(
                len(own), len(members), 3
            ).transpose(1, 2, 0)
    return found


def acting_share(posedirs: Array) -> float:
    """The share of numbers that are not zero."""
    return float(np.count_nonzero(posedirs) / posedirs.size)


def _shrunk(P: Array, N: int, per_joint: int, by: float) -> Array:
    """Every group shortened by `by`, or gone: (F, 3 N)."""
    groups = P.reshape(-1, per_joint, N, 3)
    length = np.sqrt(np.einsum("kfic,kfic->ki", groups, groups))
    factor = np.maximum(0, 1 - by / np.maximum(length, 1e-300))
    shrunk: Array = (groups * factor[:, None, :, None]).reshape(P.shape)
    return shrunk
