"""What depends on how a Jacobian is stored: as an array, or by its nonzeros, column by column."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_array, csc_array, issparse, vstack

from workbench.errors import TooLarge
from workbench.problem.memory import check_fits

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Matrix: TypeAlias = Array | csc_array
DENSE_FROM = 2**22  # entries, 32 MB: a smaller matrix is an array, whatever is in it
SPARSE_UP_TO = 1 / 8  # nonzeros an entry: above that an array is smaller and much quicker
WIDE = 4000  # columns of a sparse matrix whose n x n arrays still fit


def is_sparse(rows: int, columns: int, nonzeros: int) -> bool:
    """Whether a matrix of this size is stored by its nonzeros."""
    return rows * columns > DENSE_FROM and nonzeros < SPARSE_UP_TO * rows * columns


def dense(matrix: Matrix) -> Array:
    """The matrix as an array. Raises TooLarge where that does not fit into memory."""
    if not isinstance(matrix, csc_array):
        return matrix
    check_fits(*matrix.shape, "a dense Jacobian", "free fewer blocks at a time")
    return np.asarray(matrix.toarray())


def entries(matrix: Matrix) -> Array:
    """What is stored: all numbers of an array, the nonzeros of a sparse matrix."""
    return np.asarray(matrix.data) if isinstance(matrix, csc_array) else matrix


def column_norms(matrix: Matrix) -> Array:
    """The length of every column, (n,).

    Columns whose squares are too large to be numbers are scaled before; those whose squares are
    zero to rounding have the length zero.
    """
    if isinstance(matrix, csc_array):
        return np.sqrt(_sums(matrix, matrix.data**2))
    columns = matrix.T  # as it is stored
    with np.errstate(over="ignore"):
        norms = np.asarray(np.sqrt(np.vecdot(columns, columns)))
    for i in np.flatnonzero(norms == np.inf):
        largest = np.abs(columns[i]).max()
        if largest < np.inf:
            norms[i] = largest * np.linalg.norm(columns[i] / largest)
    return norms


def row_norms(matrix: Matrix) -> Array:
    """The length of every row, (m,)."""
    if isinstance(matrix, csc_array):
        squares = np.bincount(matrix.indices, matrix.data**2, minlength=matrix.shape[0])
        return np.asarray(np.sqrt(squares))
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", matrix, matrix)))


def scaled(matrix: Matrix, factors: Array) -> Matrix:
    """Every column times its factor, (n,)."""
    if isinstance(matrix, csc_array):
        found = matrix.data * np.repeat(factors, np.diff(matrix.indptr))
        return csc_array((found, matrix.indices, matrix.indptr), shape=matrix.shape)
    return matrix * factors


def stacked(matrix: Matrix, below: Array) -> Matrix:
    """The matrix, and more rows below it."""
    if isinstance(matrix, csc_array):
        return csc_array(vstack([matrix, csc_array(below)]))
    return np.vstack([matrix, below])


def columns_of(matrix: Matrix, part: NDArray[np.int64] | Mask) -> Matrix:
    """Some columns; as an array where they are few, or no longer sparse."""
    some = matrix[:, part]
    if isinstance(some, csc_array) and not is_sparse(*some.shape, some.nnz):
        return np.asarray(some.toarray())
    return some


def where_not_finite(matrix: Matrix) -> list[tuple[int, int]]:
    """Rows and columns of entries that are NaN or infinite."""
    if isinstance(matrix, csc_array):
        stored = matrix.tocoo()
        bad = ~np.isfinite(stored.data)
        return list(zip(stored.row[bad].tolist(), stored.col[bad].tolist(), strict=True))
    return [(int(i), int(j)) for i, j in np.argwhere(~np.isfinite(matrix))]


def check_wide(matrix: Matrix) -> None:
    """Raise TooLarge where a sparse matrix has too many columns for arrays of n x n."""
    m, n = matrix.shape
    if issparse(matrix) and n > WIDE:
        raise TooLarge(
            f"the singular values of a sparse Jacobian of {m:,} x {n:,} need arrays of {n:,} x "
            f"{n:,}; up to {WIDE:,} columns have them: free fewer blocks"
        )


def gram(matrix: Matrix) -> Matrix:
    """The matrix, transposed, times itself, (n, n)."""
    if not isinstance(matrix, csc_array):
        return np.asarray(matrix.T @ matrix)
    full = crowded(matrix)
    if not full.any():
        found = csc_array(matrix.T @ matrix)
    else:  # products of columns without zeros are many times as fast by arrays
        S, B = csc_array(matrix[:, ~full]), dense(csc_array(matrix[:, full]))
        between = S.T @ B
        parts = [[S.T @ S, between], [between.T, B.T @ B]]
        place = np.argsort(np.argsort(full, kind="stable"), kind="stable")
        found = csc_array(csc_array(block_array(parts, format="csc"))[:, place])[place]
    found.sort_indices()
    return found


def crowded(matrix: csc_array) -> Mask:
    """The columns (n,) in which more than an eighth of all entries are stored."""
    return np.asarray(np.diff(matrix.indptr) > SPARSE_UP_TO * matrix.shape[0])


def times(matrix: Matrix, other: Array) -> Matrix:
    """The product with another matrix, (n, k)."""
    if isinstance(matrix, csc_array):
        return csc_array(matrix @ csc_array(other))
    return np.asarray(matrix @ other)


def entries_at(matrix: csc_array, pattern: csc_array) -> Array:
    """The entries of a matrix in the places of a pattern, column by column; it has no others."""
    if matrix.nnz == pattern.nnz:
        return np.asarray(matrix.data)
    m = matrix.shape[0]
    places, there = (
        np.repeat(np.arange(one.shape[1]), np.diff(one.indptr)) * m + one.indices
        for one in (matrix, pattern)
    )
    found = np.zeros(pattern.nnz)
    found[np.searchsorted(there, places)] = matrix.data
    return found


def distance(one: Matrix, a: float, other: Matrix, b: float) -> float:
    """Frobenius' norm of a times one matrix minus b times another of the same kind."""
    if isinstance(one, csc_array) and isinstance(other, csc_array):
        return float(np.linalg.norm((a * one - b * other).data))
    return float(np.linalg.norm(a * dense(one) - b * dense(other)))


def _sums(matrix: csc_array, values: Array) -> Array:
    """Of each column of values that stand where the matrix has its nonzeros, (n,)."""
    columns = np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))
    return np.bincount(columns, values, minlength=matrix.shape[1]).astype(float, copy=False)
