"""Least squares over shares: numbers that are not negative and sum to one.

An active-set method that ends at the exact solution (Nocedal and Wright, Numerical Optimization,
2nd ed., algorithm 16.3): on the shares above zero the equations of Lagrange are solved; a share
that would become negative is held at zero; the one at zero that would lower the cost most is let
go. Each lets the cost fall, so no set comes twice.
"""

import numpy as np
import scipy.linalg
import scipy.optimize
from numpy.typing import NDArray

from workbench.errors import WorkbenchError

Array = NDArray[np.float64]
PULL = 1e-13  # of the largest diagonal entry: a gradient below it is rounding


class NoShares(WorkbenchError):
    """The active set went on changing: the numbers are not what they should be."""


def shares(gram: Array, right: Array, start: Array) -> Array:
    """The w (n,) least in w.G w / 2 - right.w, w >= 0, sum w = 1, from a w that is such.

    `gram` (n, n) is symmetric and not indefinite, `right` in its range, as B'B and B'v are.
    """
    scale = float(np.diag(gram).max()) or 1.0
    G, c, w = gram / scale, right / scale, start.copy()
    free = w > 0
    barred = np.zeros_like(free)  # were let go and came back at once: their pull is rounding
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
    """The w (n,) least in |A w|, w >= 0, sum w = 1, for A (m, n) that may have any rank.

    Without the sum, least squares of [A; 1] w = [0; 1] over w >= 0 has the same direction: for
    w = t s with shares s it is t^2 |A s|^2 + (t - 1)^2, whose least over t grows with |A s|.
    Lawson and Hanson's method then needs no products of A, and half the digits are not lost.
    """
    n = A.shape[1]
    size = float(np.abs(A).max()) or 1.0
    Q, R = scipy.linalg.qr(np.concatenate([A / size, np.ones((1, n))]), mode="economic")
    w, _ = scipy.optimize.nnls(R, Q[-1], maxiter=100 * n)
    return np.asarray(w / w.sum())


def _balanced(G: Array, c: Array) -> Array:
    """The w least in w.G w / 2 - c.w with sum w = 1; the shortest where there are many."""
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


def kkt_residual(gram: Array, right: Array, w: Array, allowed: NDArray[np.bool_]) -> float:
    """How far w is from the conditions of Karush, Kuhn and Tucker, within what is allowed.

    Free of units: gradients are over the largest diagonal entry of the matrix.
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
    """At most `most` shares above zero, not worse than the start's; and their KKT residual.

    Which of them is a choice among C(n, most) sets: tried are those that are largest without the
    limit and those of the start, which has no more than `most`.
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
