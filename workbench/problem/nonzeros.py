"""Sparse matrices by their nonzeros: where they stand, and how they are read off."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.csgraph import connected_components

from workbench.arrays import Array, Index


def columns_of_nonzeros(matrix: csc_array) -> Index:
    """The column in which each stored entry stands, (nnz,)."""
    return np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))


def rows_of_nonzeros(matrix: csr_array) -> Index:
    """The row in which each stored entry stands, (nnz,)."""
    return np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))


def tied_columns(pattern: coo_array) -> list[Index]:
    """The columns in groups, in ascending order, such that no row has entries in two of them."""
    m, n = pattern.shape
    ends = (pattern.row, m + pattern.col)
    ties = coo_array((np.ones(pattern.nnz), ends), shape=(m + n, m + n))
    label = np.unique(connected_components(ties, directed=False)[1][m:], return_inverse=True)[1]
    return np.split(np.argsort(label, kind="stable"), np.cumsum(np.bincount(label))[:-1])


def sums(places: NDArray[np.signedinteger], values: Array, size: int) -> Array:
    """The sum (size,) of the values in each place, zero where there are none."""
    return np.bincount(places, values, minlength=size).astype(float, copy=False)


def entries_at(matrix: Array | csc_array, pattern: csc_array) -> Array:
    """The entries of a matrix in the places of a pattern, column by column.

    A sparse matrix has no other entries; in an array, other places are not read.
    """
    if isinstance(matrix, np.ndarray):
        return np.asarray(matrix[pattern.indices, columns_of_nonzeros(pattern)])
    if matrix.nnz == pattern.nnz:
        return np.asarray(matrix.data)
    places, there = (
        columns_of_nonzeros(one) * matrix.shape[0] + one.indices for one in (matrix, pattern)
    )
    found = np.zeros(pattern.nnz)
    found[np.searchsorted(there, places)] = matrix.data
    return found
