"""Bases of spaces: of what constraints span and leave free, and of null spaces by few entries.

A row of one entry, such as that of a bound, holds an unknown exactly. Other rows count in length 1.
"""

from collections.abc import Iterable

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.optimize import linprog

from workbench.arrays import Array, Index, Mask
from workbench.problem.steps import EPS

BY_LINEAR_PROGRAM = 400  # entries up to which a linear program looks for few of them
NEW_SINE = 1e-6  # of the angle to the directions so far, above which a direction is new
CLEARLY_NEW_SINE = 0.1  # of this angle, above which vectors are kept as they are
OLD_SINE = 1e-3  # of this angle, up to which a vector of few entries is one of those before
MOST_SORTED = 3  # vectors, up to which all that are tried are compared
PIVOTS_EACH = 3  # times as many pivots as vectors: of some the sparsest vector is there already
ROUNDING = 1e-7  # of the largest entry: less is none


def null_basis(A: Array, tolerance: float) -> Array:
    """Orthonormal (n, d): right singular vectors of A (m, n) of values up to `tolerance`."""
    n = A.shape[1]
    if not n:
        return np.zeros((0, 0))
    R = scipy.linalg.qr(A, mode="r")[0][:n] if len(A) > n else A
    _, s, Vt = np.linalg.svd(R, full_matrices=True)
    return np.asarray(Vt[int(np.sum(s > tolerance)) :].T)


def beyond(known: Array, vectors: Array) -> tuple[Array, Array]:
    """An orthonormal basis of the space that `vectors` add to that of `known`.

    Also the combinations of `vectors`, so within their support, that are furthest from `known`.
    """
    rest = vectors - known @ (known.T @ vectors)
    rest -= known @ (known.T @ rest)
    U, s, Vt = np.linalg.svd(rest, full_matrices=False)
    if s.size == vectors.shape[1] and (s > CLEARLY_NEW_SINE).all():
        return U, vectors
    return U[:, s > NEW_SINE], np.asarray(vectors @ Vt[s > NEW_SINE].T)


def sparsest(basis: Array, known: Array) -> Array:
    """Vectors (n, d) of length 1 with few nonzeros that span the same space together with `known`.

    Each minimizes sum |v_i| among the vectors whose entry at a pivot is 1, by a linear program
    over the basis and over `known`. With more than 400 entries they are the vectors that are 1 at
    one pivot and 0 at the others.
    """
    n, d = basis.shape
    if not d:
        return basis
    pivots = scipy.linalg.qr(basis.T, mode="r", pivoting=True)[1]
    if n > BY_LINEAR_PROGRAM:
        return _echelon(basis, pivots[:d])
    space = np.column_stack([basis, known])
    space = space / np.linalg.norm(space, axis=0)
    candidates: Iterable[Array] = (_least(space, int(i)) for i in pivots[: PIVOTS_EACH * d])
    if d <= MOST_SORTED:  # those of the fewest entries first
        candidates = sorted(candidates, key=lambda v: np.count_nonzero(_is_large(v)))
    chosen: list[Array] = []
    spanned = np.linalg.qr(known)[0] if known.shape[1] else known
    for v in candidates:
        new = v - spanned @ (spanned.T @ v)
        new -= spanned @ (spanned.T @ new)
        if np.linalg.norm(new) > OLD_SINE * np.linalg.norm(v):
            chosen.append(_polished(v, space))
            spanned = np.column_stack([spanned, new / np.linalg.norm(new)])
        if len(chosen) == d:
            break
    left = beyond(spanned, basis)[0][:, : d - len(chosen)]
    return np.column_stack([*(v[:, None] for v in chosen), left])


def _is_large(v: Array) -> Mask:
    """Which entries of v are more than rounding, beside its largest one; in each column."""
    return np.asarray(abs(v) > ROUNDING * abs(v).max(axis=0))


def _least(space: Array, pivot: int) -> Array:
    """The vector v (n,) in the span of `space` (n, k) of the least sum |v_i| with v[pivot] = 1."""
    n, k = space.shape
    # v = space c = plus - minus; least sum of both
    solution = linprog(
        np.concatenate([np.zeros(k), np.ones(2 * n)]),
        A_eq=np.vstack(
            [
                np.hstack([space, -np.eye(n), np.eye(n)]),
                np.concatenate([space[pivot], np.zeros(2 * n)]),
            ]
        ),
        b_eq=np.append(np.zeros(n), 1.0),
        bounds=[(None, None)] * k + [(0, None)] * (2 * n),
        method="highs",
    )
    return np.zeros(n) if solution.x is None else np.asarray(space @ solution.x[:k])


def _echelon(basis: Array, pivots: NDArray[np.signedinteger]) -> Array:
    """A basis of the same space, each vector 1 at its own pivot and 0 at the others'."""
    vectors = np.linalg.solve(basis[pivots].T, basis.T).T
    vectors[~_is_large(vectors)] = 0
    return np.asarray(vectors / np.linalg.norm(vectors, axis=0))


def _polished(v: Array, space: Array) -> Array:
    """v of length 1, its tiny entries set to zero exactly where the space allows it."""
    large = _is_large(v)
    if large.all():
        return np.asarray(v / np.linalg.norm(v))
    allowed = null_basis(space[~large], 1e-9 * float(np.linalg.norm(space, 2)))
    exact = space @ (allowed @ (allowed.T @ np.linalg.lstsq(space, v)[0]))
    exact = np.where(large, exact, 0.0)
    if np.linalg.norm(exact - v) > 1e-5 * np.linalg.norm(v):
        exact = v
    return np.asarray(exact / np.linalg.norm(exact))


# What constraints span.


def row_space(rows: Array) -> Array:
    """An orthonormal basis (r, n) of the span of rows (k, n)."""
    fixed, read, rank, Vt = _spanned(rows)
    space = np.zeros((fixed.size + rank, rows.shape[1]))
    space[np.arange(fixed.size), fixed] = 1.0
    space[fixed.size :, read] = Vt[:rank]
    return space


def tangent_space(rows: Array) -> Array:
    """An orthonormal basis (n, n - r) of what rows (k, n) leave free.

    For each unknown that no row reads it has a unit vector.
    """
    fixed, read, rank, Vt = _spanned(rows)
    unread = np.setdiff1d(np.arange(rows.shape[1]), np.append(fixed, read))
    space = np.zeros((rows.shape[1], unread.size + len(Vt) - rank))
    space[unread, np.arange(unread.size)] = 1.0
    space[read, unread.size :] = Vt[rank:].T
    return space


def _spanned(rows: Array) -> tuple[Index, Index, int, Array]:
    """The unknowns that rows of one entry fix; those that the others read, their rank, and Vt."""
    single = np.count_nonzero(rows, axis=1) == 1
    fixed = rows[single].any(axis=0)
    others = rows[rows.any(axis=1) & ~single]
    others = np.where(fixed, 0.0, others / np.linalg.norm(others, axis=1)[:, None])
    others = others[np.linalg.norm(others, axis=1) > EPS]
    read = np.flatnonzero(others.any(axis=0))
    _, s, Vt = np.linalg.svd(others[:, read], full_matrices=True)
    rank = int(np.sum(s > EPS * max(1, len(others), read.size)))
    return np.flatnonzero(fixed), read, rank, Vt
