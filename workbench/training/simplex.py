"""Least squares over shares: numbers that are not negative and sum to one.

An active-set method that ends at the exact solution (Nocedal and Wright, Numerical Optimization,
2nd ed., algorithm 16.3). It solves the Lagrange equations for the shares above zero. A share that
would become negative is fixed at zero; of the shares at zero, the one that lowers the cost most is
freed. Every change lowers the cost, so that no active set occurs twice.
"""

import numpy as np
import scipy.linalg
import scipy.optimize

from workbench.arrays import Array, Mask
from workbench.errors import WorkbenchError

PULL = 1e-13  # of the largest diagonal entry: a smaller gradient is rounding


class NoShares(WorkbenchError):
    """The active set did not settle, as happens with numbers that are not finite."""


def shares(gram: Array, right: Array, start: Array) -> Array:
    """The w (n,) that minimises w.G w / 2 - right.w with w >= 0 and sum w = 1.

    `gram` (n, n) is symmetric and not indefinite, and `right` is in its range, as B'B and B'v are.
    `start` (n,) fulfils the constraints.
    """
    scale = float(np.diag(gram).max()) or 1.0
    G, c, w = gram / scale, right / scale, start.copy()
    free = w > 0
    barred = np.zeros_like(free)  # freed and fixed again at once: their gradient is rounding
    for _ in range(20 * len(w) + 20):
        own = np.flatnonzero(free)
        best = np.zeros_like(w)
        best[own] = _balanced(G[np.ix_(own, own)], c[own])
        low = own[best[own] <= 0]
        if len(low):
            falls = w[low] - best[low]
            shares_of_way = np.where(falls > 0, w[low] / np.where(falls > 0, falls, 1.0), 0.0)
            first = int(np.argmin(shares_of_way))
            way = min(1.0, float(shares_of_way[first]))
            barred = barred if way > 0 else barred | (np.arange(len(w)) == low[first])
            w = w + way * (best - w)
            w[low[first]], free[low[first]] = 0.0, False
            w = np.where(free, w.clip(0), 0.0)
            continue
        w = best
        slope = G @ w - c
        pull = slope - slope @ w
        pull[free | barred] = 0
        k = int(np.argmin(pull))
        if pull[k] >= -PULL * max(1.0, float(abs(c).max())):
            return np.asarray(w / w.sum())
        free[k] = True
    raise NoShares(f"shares of {len(w)} did not settle; are the numbers finite?")


def shares_to_zero(A: Array) -> Array:
    """The w (n,) that minimises |A w| with w >= 0 and sum w = 1, for A (m, n) of any rank.

    Least squares of [A; 1] w = [0; 1] over w >= 0 has a solution in the same direction: for
    w = t s with shares s the cost is t^2 |A s|^2 + (t - 1)^2, whose minimum over t grows with
    |A s|. Lawson and Hanson's method then needs no product A'A, which would lose half the digits.
    """
    n = A.shape[1]
    size = float(np.abs(A).max()) or 1.0
    Q, R = scipy.linalg.qr(np.concatenate([A / size, np.ones((1, n))]), mode="economic")
    w, _ = scipy.optimize.nnls(R, Q[-1], maxiter=100 * n)
    return np.asarray(w / w.sum())


def _balanced(G: Array, c: Array) -> Array:
    """The w that minimises w.G w / 2 - c.w with sum w = 1; the shortest if there are several."""
    n = len(c)
    K = np.ones((n + 1, n + 1))
    K[:n, :n], K[n, n] = G, 0
    right = np.append(c, 1.0)
    try:
        found = np.linalg.solve(K, right)
        if np.linalg.norm(K @ found - right) < 1e-12 * max(1.0, float(np.linalg.norm(found))):
            return np.asarray(found[:n])
    except np.linalg.LinAlgError:
        pass
    return np.asarray(np.linalg.lstsq(K, right, rcond=None)[0][:n])


def kkt_residual(gram: Array, right: Array, w: Array, allowed: Mask) -> float:
    """The residual of the Karush-Kuhn-Tucker conditions at w, for the weights that are allowed.

    It has no unit: gradients are divided by the largest diagonal entry of the matrix.
    """
    scale = float(np.diag(gram).max()) or 1.0
    slope = (gram @ w - right) / scale
    pull = (slope - slope @ w)[allowed]
    taken = w[allowed] > 0
    return max(
        float(np.abs(pull[taken]).max(initial=0)),
        float(-pull[~taken].min(initial=0)),
        abs(float(w.sum()) - 1),
        float(-w.min()),
    )


def few_shares(gram: Array, right: Array, start: Array, most: int) -> tuple[Array, float]:
    """Shares of which at most `most` are above zero, and their KKT residual.

    They are not worse than those of the start. Of the C(n, most) sets of shares two are tried:
    the largest ones without the limit, and those of the start, which has at most `most`.
    """
    every = np.ones(len(right), dtype=bool)
    whole = shares(gram, right, start)
    if np.count_nonzero(whole) <= most:
        return whole, kkt_residual(gram, right, whole, every)
    found: list[tuple[float, Array, float]] = []
    for chosen in (np.argsort(-whole, kind="stable")[:most], np.flatnonzero(start)):
        own, w = np.ix_(chosen, chosen), np.zeros_like(start)
        first = whole[chosen] if whole[chosen].sum() > 0 else start[chosen]
        w[chosen] = shares(gram[own], right[chosen], first / first.sum())
        allowed = np.zeros_like(every)
        allowed[chosen] = True
        cost = float(0.5 * w @ gram @ w - right @ w)
        found.append((cost, w, kkt_residual(gram, right, w, allowed)))
    _, w, residual = min(found, key=lambda one: one[0])
    return w, residual
