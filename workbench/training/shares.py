"""Least squares over shares, numbers that are not negative and sum to one; the joint regressor.

An active-set method that ends at the exact solution (Nocedal and Wright, Numerical Optimization,
2nd ed., algorithm 16.3). It solves the Lagrange equations for the shares above zero. A share that
would become negative is fixed at zero; of the shares at zero, the one that lowers the cost most is
freed. Every change lowers the cost, so that no active set occurs twice.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.optimize
from scipy.sparse import csr_array

from workbench.arrays import Array, Mask
from workbench.errors import WorkbenchError

MOST_WEIGHTS = 4  # joints that move one vertex
ROUNDING = 1e-13  # of the largest diagonal entry: a smaller gradient is rounding
ROW_REACH, FEWEST_IN_REACH = 0.2, 60  # m from a joint; vertices that a row may use at least


class NoShares(WorkbenchError):
    """Numbers that are not finite, or an active set that did not settle."""


def shares(gram: Array, right: Array, start: Array) -> Array:
    """The w (n,) that minimises w.G w / 2 - right.w with w >= 0 and sum w = 1.

    `gram` (n, n) is symmetric and not indefinite, and `right` is in its range, as B'B and B'v are.
    `start` (n,) fulfils the constraints.
    """
    allowed = np.ones((1, len(right)), dtype=bool)
    return np.asarray(many_shares(gram[None], right[None], start[None], allowed)[0])


def many_shares(grams: Array, rights: Array, starts: Array, allowed: Mask) -> Array:
    """The shares (m, n) of m such problems; those that are not `allowed` (m, n) stay zero.

    All problems make their steps together, each until it is solved. Raises NoShares for numbers
    that are not finite.
    """
    if not (np.isfinite(grams).all() and np.isfinite(rights).all()):
        raise NoShares("numbers that are not finite have no shares")
    scales = np.diagonal(grams, axis1=1, axis2=2).max(axis=1)
    scales = np.where(scales == 0, 1.0, scales)
    W, free = starts.copy(), starts > 0
    barred = ~allowed  # and what was freed and fixed again at once: its gradient is rounding
    going = np.arange(len(W))
    for _ in range(20 * W.shape[1] + 20):
        G, c = grams[going] / scales[going, None, None], rights[going] / scales[going, None]
        w, own, closed = W[going], free[going], barred[going]
        best = _balanced(G, c, own)
        low = own & (best <= 0)
        leaving, feasible = np.flatnonzero(low.any(axis=1)), np.flatnonzero(~low.any(axis=1))
        # Shares that would be negative: go as far as the first of them is zero, and fix it there.
        falls = w[leaving] - best[leaving]
        lengths = np.where(falls > 0, w[leaving] / np.where(falls > 0, falls, 1.0), 0.0)
        lengths = np.where(low[leaving], lengths, np.inf)
        first = lengths.argmin(axis=1)
        length = lengths[np.arange(len(leaving)), first].clip(max=1.0)
        closed[leaving, first] |= length <= 0
        w[leaving] += length[:, None] * (best[leaving] - w[leaving])
        own[leaving, first] = False
        w[leaving] = np.where(own[leaving], w[leaving].clip(0), 0.0)
        # None of them: free the one that lowers the cost most, if any does.
        w[feasible] = best[feasible]
        gradient = (G[feasible] @ w[feasible, :, None])[..., 0] - c[feasible]
        reduced = gradient - np.sum(gradient * w[feasible], axis=1, keepdims=True)
        reduced[own[feasible] | closed[feasible]] = 0
        k = reduced.argmin(axis=1)
        least = -ROUNDING * np.maximum(1.0, np.abs(c[feasible]).max(axis=1))
        solved = reduced[np.arange(len(feasible)), k] >= least
        own[feasible[~solved], k[~solved]] = True
        done = feasible[solved]
        w[done] /= w[done].sum(axis=1, keepdims=True)
        W[going], free[going], barred[going] = w, own, closed
        going = np.delete(going, done)
        if not len(going):
            return W
    raise NoShares(f"shares of {W.shape[1]} did not settle")


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


def _balanced(grams: Array, rights: Array, free: Mask) -> Array:
    """The w (m, n) that minimise w.G w / 2 - c.w with sum w = 1 and zeros where they are not free.

    The shortest, if there are several.
    """
    m, most = len(grams), max(1, int(free.sum(axis=1).max(initial=1)))
    order = np.argsort(~free, axis=1, kind="stable")[:, :most]  # the free ones come first
    own = np.take_along_axis(free, order, axis=1)
    rows = np.arange(m)[:, None]
    K = np.ones((m, most + 1, most + 1))
    K[:, :most, :most] = grams[rows[..., None], order[:, :, None], order[:, None, :]]
    K[:, :most, :most] *= own[:, :, None] & own[:, None, :]
    K[:, :most, most] = K[:, most, :most] = own
    K[:, most, most] = 0
    k = np.arange(most)
    K[:, k, k] = np.where(own, K[:, k, k], 1.0)  # what is not free has an equation w = 0
    right = np.concatenate([rights[rows, order] * own, np.ones((m, 1))], axis=1)
    solutions, exact = _solved(K, right)
    for i in np.flatnonzero(~exact):
        solutions[i] = np.linalg.lstsq(K[i], right[i], rcond=None)[0]
    w = np.zeros_like(rights)
    np.put_along_axis(w, order, solutions[:, :most] * own, axis=1)
    return w


def _solved(K: Array, right: Array) -> tuple[Array, Mask]:
    """Solutions of K (m, k, k) x = right (m, k), and whether each is one."""
    try:
        solutions = np.linalg.solve(K, right[..., None])[..., 0]
    except np.linalg.LinAlgError:  # which of them is singular is not said
        if len(K) == 1:
            return np.zeros_like(right), np.zeros(1, dtype=bool)
        half = len(K) // 2
        halves = _solved(K[:half], right[:half]), _solved(K[half:], right[half:])
        return np.concatenate([x for x, _ in halves]), np.concatenate([ok for _, ok in halves])
    errors = np.linalg.norm((K @ solutions[..., None])[..., 0] - right, axis=1)
    exact: Mask = errors < 1e-12 * np.maximum(1.0, np.linalg.norm(solutions, axis=1))
    return np.asarray(solutions, dtype=float), exact


def kkt_residuals(grams: Array, rights: Array, W: Array, allowed: Mask) -> Array:
    """The residual (m,) of the Karush-Kuhn-Tucker conditions of each row of W (m, n).

    Only weights that are `allowed` (m, n) count. It has no unit: gradients are divided by the
    largest diagonal entry of the matrix.
    """
    scales = np.diagonal(grams, axis1=1, axis2=2).max(axis=1)
    scales = np.where(scales == 0, 1.0, scales)
    gradient = ((grams @ W[..., None])[..., 0] - rights) / scales[:, None]
    reduced = gradient - np.sum(gradient * W, axis=1, keepdims=True)
    positive = W > 0
    violation = np.where(positive, np.abs(reduced), -reduced)
    worst = np.where(allowed, violation, 0.0).max(axis=1, initial=0.0)
    unlike = np.maximum(np.abs(W.sum(axis=1) - 1), -W.min(axis=1))
    return np.asarray(np.maximum(worst, unlike))


def few_shares(grams: Array, rights: Array, starts: Array, most: int) -> tuple[Array, Array]:
    """Shares (m, n) of which at most `most` are above zero in each row; their KKT residuals (m,).

    They are not worse than those of the start. Of the C(n, most) sets of shares two are tried:
    the largest ones without the limit, and those of the start, which has at most `most`.
    """
    all_allowed = np.ones(rights.shape, dtype=bool)
    W, allowed = many_shares(grams, rights, starts, all_allowed), all_allowed
    many = np.flatnonzero((W > 0).sum(axis=1) > most)
    if len(many):
        G, c, start, unlimited = grams[many], rights[many], starts[many], W[many]
        largest = np.zeros_like(start, dtype=bool)
        np.put_along_axis(largest, np.argsort(-unlimited, axis=1, kind="stable")[:, :most], True, 1)
        lowest, chosen = np.full(len(many), np.inf), largest
        for sets in (largest, start > 0):
            first = np.where(sets, unlimited, 0.0)
            total = first.sum(axis=1, keepdims=True)
            first = np.where(total > 0, first / np.where(total > 0, total, 1.0), start)
            w = many_shares(G, c, first, sets)
            cost = 0.5 * np.einsum("mi,mij,mj->m", w, G, w) - np.sum(c * w, axis=1)
            better = cost < lowest
            lowest = np.where(better, cost, lowest)
            W[many[better]] = w[better]
            chosen = np.where(better[:, None], sets, chosen)
        allowed = allowed.copy()
        allowed[many] = chosen
    return W, kkt_residuals(grams, rights, W, allowed)


@dataclass(frozen=True, eq=False)
class JointRegressor:
    """A regressor, which computes joints from vertices.

    Attributes:
        matrix: (K, N), the weights of vertices; each row sums to one.
        rms: (K,) in metres, the distance of each regressed joint from the given ones.
        kkt: the largest residual of the Karush-Kuhn-Tucker conditions.
    """

    matrix: csr_array
    rms: Array
    kkt: float


def fit_joint_regressor(templates: Array, joints: Array, rings: csr_array) -> JointRegressor:
    """The shares (K, N) that give joints (S, K, 3) from templates (S, N, 3), row by row.

    min |T_s R' - J_s|^2 with R >= 0 and rows that sum to one, over the vertices within 20 cm
    of the joint. Few shapes do not decide a row: many give the same joints on all shapes in the
    affine span of these. What is found has at most 3 S entries above zero. The root's row is that
    of `rings` (K, N).
    """
    S, N, _ = templates.shape
    rows, rms, worst = np.zeros((joints.shape[1], N)), np.zeros(joints.shape[1]), 0.0
    rows[0], means = rings[[0]].toarray()[0], templates.mean(axis=0)
    for k in range(1, joints.shape[1]):
        distance = np.linalg.norm(means - joints[:, k].mean(axis=0), axis=1)
        order = np.argsort(distance, kind="stable")
        near = order[: max(FEWEST_IN_REACH, int(np.count_nonzero(distance < ROW_REACH)))]
        offsets = (templates[:, near] - joints[:, None, k]).transpose(0, 2, 1).reshape(3 * S, -1)
        row = shares_to_zero(offsets)
        gram, allowed = (offsets.T @ offsets)[None], np.ones((1, len(near)), dtype=bool)
        kkt = kkt_residuals(gram, np.zeros((1, len(near))), row[None], allowed)
        worst = max(worst, float(kkt[0]))
        rows[k, near] = row
        rms[k] = np.sqrt(np.mean((offsets @ row) ** 2) * 3)
    return JointRegressor(csr_array(rows), rms, worst)


def at_most(weights: Array, most: int) -> Array:
    """The `most` largest shares of each row, scaled to sum to one."""
    order = np.argsort(-weights, axis=1, kind="stable")[:, :most]
    kept = np.zeros_like(weights)
    np.put_along_axis(kept, order, np.take_along_axis(weights, order, axis=1), axis=1)
    kept[kept < 1e-4 * kept.max(axis=1, keepdims=True)] = 0
    return np.asarray(kept / kept.sum(axis=1, keepdims=True))
