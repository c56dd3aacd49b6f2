"""Singular values of a matrix some of whose columns are much longer than others."""

import numpy as np
import scipy.linalg

from workbench.arrays import Array
from workbench.problem.steps import EPS


def graded_svd(R: Array, lengths: Array, relative: float) -> tuple[Array, Array]:
    """`s` (k,), falling, and Vt (n, n) of R (k, n), whose columns have these lengths (n,).

    What is not seen is found in columns of length 1: there `relative` times the largest singular
    value tells it from what is seen. In R's own singular values rounding errors of long columns
    may be larger than a short one that is seen. Along unseen directions s is exactly zero here.
    """
    k, n = R.shape
    read = np.flatnonzero(lengths > 0)
    d, R = lengths[read], R[:, read]
    _, even, Vt = np.linalg.svd(R / d, full_matrices=True)
    rank = int(np.sum(even > relative * even.max(initial=0.0)))
    unseen = Vt[rank:].T
    unseen[abs(unseen) < max(relative, EPS * read.size)] = 0.0
    unseen = np.linalg.qr(unseen / d[:, None] * d.min())[0]
    Q = complement(unseen)
    found, V = _by_jacobi(R @ Q)
    s, directions = np.zeros(k), np.zeros((n, n))
    s[:rank] = found
    directions[:rank, read] = V @ Q.T
    directions[rank : read.size, read] = unseen.T
    directions[np.arange(read.size, n), np.flatnonzero(lengths == 0)] = 1.0
    return s, directions


def complement(N: Array) -> Array:
    """(n, n - d) orthonormal: what is at right angles to the orthonormal columns of N (n, d).

    Entries that no column of N has stay by themselves.
    """
    n = len(N)
    part = np.flatnonzero(N.any(axis=1))
    local = scipy.linalg.null_space(N[part].T) if part.size else np.zeros((0, 0))
    Q = np.zeros((n, n - N.shape[1]))
    others = np.setdiff1d(np.arange(n), part)
    Q[others, np.arange(others.size)] = 1.0
    Q[part, others.size :] = local
    return Q


def _by_jacobi(R: Array) -> tuple[Array, Array]:
    """`s` (n,) and Vt (n, n) of R (k, n) of full column rank, small s as accurate as large ones."""
    if not R.shape[1]:
        return np.zeros(0), np.zeros((0, 0))
    found, _, V, work, _, failed = scipy.linalg.lapack.dgejsv(
        R, joba=0, jobu=0, jobv=0, jobr=0, jobt=1, jobp=1
    )
    if failed:
        _, s, Vt = np.linalg.svd(R, full_matrices=False)
        return s, Vt
    return found * (work[0] / work[1]), V.T
