"""The singular values of a Jacobian, and which directions they determine."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from workbench.arrays import Array
from workbench.problem.steps import EPS


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The singular value decomposition of a Jacobian J (m, n), with k = min(m, n).

    A direction whose singular value is not above the tolerance counts as null.

    Attributes:
        s: (k,) the singular values, falling.
        Vt: (n, n) orthonormal rows v: |J v| is s for the first k, and 0 for the others.
        tolerance: the largest singular value that counts as zero.
    """

    s: Array
    Vt: Array
    tolerance: float

    @property
    def rank(self) -> int:
        """The number of singular values above the tolerance."""
        return int(np.sum(self.s > self.tolerance))

    @property
    def determined(self) -> tuple[Array, Array]:
        """The singular values above the tolerance, (rank,), and their directions (rank, n)."""
        above = self.s > self.tolerance
        return self.s[above], self.Vt[: self.s.size][above]


def graded_svd(R: Array, lengths: Array, relative: float) -> tuple[Array, Array]:
    """`s` (k,), falling, and Vt (n, n) of R (k, n), whose columns have these lengths (n,).

    Null directions are found in R with columns of length 1, where their singular values are at most
    `relative` times the largest; along them s is exactly zero here. In the singular values of R
    itself, rounding errors of long columns may be larger than a short column. See Drmac and
    Veselic, New fast and accurate Jacobi SVD algorithm, 2008.
    """
    k, n = R.shape
    read = np.flatnonzero(lengths > 0)
    d, R = lengths[read], R[:, read]
    _, even, Vt = np.linalg.svd(R / d, full_matrices=True)
    rank = int(np.sum(even > relative * even.max(initial=0.0)))
    null = Vt[rank:].T
    null[abs(null) < max(relative, EPS * read.size)] = 0.0
    null = np.linalg.qr(null / d[:, None] * d.min())[0]
    Q = complement(null)
    found, V = _by_jacobi(R @ Q)
    s, directions = np.zeros(k), np.zeros((n, n))
    s[:rank] = found
    directions[:rank, read] = V @ Q.T
    directions[rank : read.size, read] = null.T
    directions[np.arange(read.size, n), np.flatnonzero(lengths == 0)] = 1.0
    return s, directions


def complement(N: Array) -> Array:
    """An orthonormal basis (n, n - d) of the complement of the orthonormal columns of N (n, d).

    Entries that are zero in all columns of N have basis vectors of their own.
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


def largest_eigenvalue(product: Callable[[Array], Array], n: int, accuracy: float) -> float:
    """The size of the eigenvalue of largest size, by Lanczos' method.

    `product` takes a vector (n,) to the matrix times it, and `accuracy` is the relative error. NaN
    where the method does not converge, or a product is not finite.
    """
    first = np.random.default_rng(0).standard_normal(n)
    if n <= 2:  # too small for the method
        matrix = np.array([product(unit) for unit in np.eye(n)])
        return float(np.linalg.norm(matrix, 2)) if np.isfinite(matrix).all() else np.nan
    if not np.isfinite(product(first)).all():
        return np.nan
    operator = LinearOperator((n, n), lambda v: product(v.ravel()), dtype=float)
    try:
        found = eigsh(operator, 1, v0=first, tol=accuracy, return_eigenvectors=False)
    except ArpackNoConvergence:
        return np.nan
    return float(abs(found[0]))


def largest_eigenpairs(
    product: Callable[[Array], Array], n: int, most: int, accuracy: float
) -> tuple[Array, Array]:
    """The `most` largest eigenvalues (q,), falling, of a matrix without negative ones.

    With them come their vectors (n, q), orthonormal. There are fewer where the method does not
    converge, and none where a product is not finite.
    """
    first = np.random.default_rng(0).standard_normal(n)
    if most < 1 or not np.isfinite(product(first)).all():
        return np.zeros(0), np.zeros((n, 0))
    if n <= max(2, most + 1):  # too small for the method
        matrix = np.column_stack([product(unit) for unit in np.eye(n)])
        values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    else:
        operator = LinearOperator((n, n), lambda v: product(v.ravel()), dtype=float)
        try:
            values, vectors = eigsh(operator, most, v0=first, tol=accuracy)
        except ArpackNoConvergence as error:
            values, vectors = error.eigenvalues, error.eigenvectors
    order = np.argsort(-values)[:most]
    return np.asarray(values[order]), np.asarray(vectors[:, order])
