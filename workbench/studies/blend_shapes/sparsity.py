"""Sparse blend shapes: a joint acts on few vertices, and on all others not at all.

STAR (Osman, Bolkart, Black, ECCV 2020) learns which vertices each joint may move, and drives them
by quaternions, four numbers a joint. Here the choice is a convex problem, the group lasso (Yuan
and Lin, J. Royal Statistical Society B 68(1), 2006): minimise

    1/2 |A P - D|^2 / n + penalty sum over joints k and vertices i of |P_ki|

where P_ki are a joint's numbers at a vertex. The larger the penalty, the more of them are zero.
"""

import numpy as np

from workbench.arrays import Array, Mask
from workbench.training.ridge import Sums, solve_ridge

STEPS = 400  # of the accelerated proximal gradient method, at most
SETTLED = 1e-5  # a step that changes |P| by less ends it: within a thousandth of the minimum
REFIT_RIDGE = 1e-4  # per pose


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
    return solve_ridge(Sums.of([(features, wanted)]), nonzero, REFIT_RIDGE)


def nonzero_share(posedirs: Array) -> float:
    """The share of the numbers that are not zero."""
    return float(np.count_nonzero(posedirs) / posedirs.size)


def _shrunk(P: Array, N: int, per_joint: int, by: float) -> Array:
    """Every group of (F, 3 N) shortened by `by`, or zero if it is not as long."""
    groups = P.reshape(-1, per_joint, N, 3)
    length = np.sqrt(np.einsum("kfic,kfic->ki", groups, groups))
    factor = np.maximum(0, 1 - by / np.maximum(length, 1e-300))
    shrunk: Array = (groups * factor[:, None, :, None]).reshape(P.shape)
    return shrunk
