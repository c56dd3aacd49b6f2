"""What the gradients of constraints and bounds span, and along what they let a point move.

A row of one entry, such as that of a bound, holds an unknown exactly: the bases below have a unit
vector for it, or a zero in every vector. Other rows count in length 1, so that the units of
constraints change no rank.
"""

import numpy as np

from workbench.arrays import Array, Mask
from workbench.problem.steps import EPS


def held(rows: Array) -> tuple[Mask, Array]:
    """Which unknowns rows of one entry hold (n,), and what the others of rows (k, n) still forbid.

    These (l, n) were scaled to length 1 before what is held was taken from them. Rows of which
    only rounding is left then are dropped, and so are rows of zeros.
    """
    alone = np.count_nonzero(rows, axis=1) == 1
    still = np.asarray(rows[alone].any(axis=0), dtype=bool)
    others = rows[rows.any(axis=1) & ~alone]
    others = np.where(still, 0.0, others / np.linalg.norm(others, axis=1)[:, None])
    return still, others[np.linalg.norm(others, axis=1) > EPS]


def row_space(rows: Array) -> Array:
    """An orthonormal basis (r, n) of the span of rows (k, n)."""
    still, others = held(rows)
    read = np.flatnonzero(others.any(axis=0))
    _, s, Vt = np.linalg.svd(others[:, read], full_matrices=False)
    count, fixed = _rank(s, others[:, read]), np.flatnonzero(still)
    found = np.zeros((fixed.size + count, rows.shape[1]))
    found[np.arange(fixed.size), fixed] = 1.0
    found[fixed.size :, read] = Vt[:count]
    return found


def tangent_space(rows: Array) -> Array:
    """An orthonormal basis (n, n - r) of what rows (k, n) leave free.

    For each unknown that no row reads it has a unit vector.
    """
    still, others = held(rows)
    read = np.flatnonzero(others.any(axis=0))
    _, s, Vt = np.linalg.svd(others[:, read], full_matrices=True)
    local = Vt[_rank(s, others[:, read]) :].T
    unread = np.setdiff1d(np.flatnonzero(~still), read)
    found = np.zeros((rows.shape[1], unread.size + local.shape[1]))
    found[unread, np.arange(unread.size)] = 1.0
    found[read, unread.size :] = local
    return found


def _rank(s: Array, rows: Array) -> int:
    """How many singular values of rows of length 1 and less are more than rounding."""
    return int(np.sum(s > EPS * max(1, *rows.shape)))
