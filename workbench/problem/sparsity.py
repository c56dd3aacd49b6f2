"""Where a Jacobian can be nonzero, and sums of parts that are stored by their nonzeros."""

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.csgraph import connected_components

from workbench.arrays import Array, Index

Places = tuple[NDArray[np.signedinteger], NDArray[np.signedinteger]]  # rows, and columns


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
    places, pattern_places = (
        columns_of_nonzeros(each) * matrix.shape[0] + each.indices for each in (matrix, pattern)
    )
    numbers = np.zeros(pattern.nnz)
    numbers[np.searchsorted(pattern_places, places)] = matrix.data
    return numbers


class Pattern:
    """The places of the entries of a sparse Jacobian, column by column, as in CasADi."""

    def __init__(self, sparsity: cs.Sparsity) -> None:
        self.shape: tuple[int, int] = sparsity.shape
        self._starts = np.array(sparsity.colind(), dtype=np.int64)
        self.rows = np.array(sparsity.row(), dtype=np.int64)
        self.columns = np.repeat(np.arange(self.shape[1]), np.diff(self._starts))

    @property
    def places(self) -> Places:
        """The rows and the columns of its entries."""
        return self.rows, self.columns

    @cached_property
    def diagonal(self) -> slice | None:
        """The rows of the matrix if it is a single diagonal over all columns, else None.

        It is one where the residual reads the coordinates of points one by one.
        """
        first, n = int(self.rows[0]) if len(self.rows) else 0, self.shape[1]
        once = np.array_equal(self.columns, np.arange(n))
        in_order = once and np.array_equal(self.rows, first + np.arange(n))
        return slice(first, first + n) if in_order else None

    def vjp(self, entries: Array, r: Array) -> Array:
        """The matrix with these entries, transposed, times r."""
        if self.diagonal is not None:
            return entries * r[self.diagonal]
        product = np.bincount(self.columns, entries * r[self.rows], minlength=self.shape[1])
        return np.asarray(product, dtype=float)  # counts, where there are no entries

    def matrix(self, entries: Array) -> csc_array:
        """The matrix with these entries."""
        return csc_array((entries, self.rows, self._starts), shape=self.shape)

    def times(self, entries: Array, other: csc_array) -> csc_array:
        """The matrix with these entries times another sparse one, rows rising in each column."""
        diagonal = self.diagonal
        if diagonal is None:
            product = csc_array(self.matrix(entries) @ other)
        else:
            numbers, rows = entries[other.indices] * other.data, other.indices + diagonal.start
            shape = self.shape[0], other.shape[1]
            product = csc_array((numbers, rows, other.indptr), shape=shape)
        product.sort_indices()
        return product

    def reached(self, other: csc_array) -> csc_array:
        """Where the product `times` can be nonzero, whatever the entries of both are."""
        ones = np.ones(other.nnz)  # sums of which never cancel
        pattern = csc_array((ones, other.indices, other.indptr), shape=other.shape)
        return self.times(np.ones(len(self.rows)), pattern)


class DenseTerm(NamedTuple):
    """A dense part of a matrix: all entries in some rows, rising, of some columns."""

    rows: Index
    columns: slice

    @property
    def filled(self) -> int:
        """How many entries it has."""
        return int(len(self.rows) * (self.columns.stop - self.columns.start))

    @property
    def places(self) -> Places:
        """The rows and the columns of its entries, column by column."""
        columns = np.arange(self.columns.start, self.columns.stop)
        return np.tile(self.rows, len(columns)), np.repeat(columns, len(self.rows))


class SparseTerm(NamedTuple):
    """A sparse part of a matrix: the entries of some columns that `pattern` (m, size) stores.

    In each column of the pattern, rows rise.
    """

    pattern: csc_array
    columns: slice

    @property
    def filled(self) -> int:
        """How many entries it has."""
        return int(self.pattern.nnz)

    @property
    def places(self) -> Places:
        """The rows and the columns of its entries, in the order of the pattern."""
        return self.pattern.indices, columns_of_nonzeros(self.pattern) + self.columns.start


class ChangingTerm(NamedTuple):
    """A sparse part of a matrix whose at most `filled` entries change their places.

    `rows` are those in which it can have entries, rising.
    """

    rows: Index
    columns: slice
    filled: int

    @property
    def places(self) -> Places:
        """The rows and the columns where there may be an entry at some point."""
        return DenseTerm(self.rows, self.columns).places

    def within(self, entries: csc_array, n: int) -> csc_array:
        """The part's entries at one point (m, size), as part of a matrix (m, n)."""
        before, after = self.columns.start, n - self.columns.stop
        starts = np.pad(entries.indptr, (before, after), mode="edge")
        return csc_array((entries.data, entries.indices, starts), shape=(entries.shape[0], n))


def gaps(covered: Sequence[slice], count: int) -> list[slice]:
    """The runs of `count` rows that are in none of some slices, which do not overlap."""
    covered_edges = sorted((rows.start, rows.stop) for rows in covered)
    edges = [0, *(edge for pair in covered_edges for edge in pair), count]
    return [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b > a]


class SparseSum:
    """A sparse matrix (m, n) that is a sum of entries, given by parts: (rows, columns) of each.

    The entry of the sum to which each number is added is found once; the sum is then fast.
    """

    def __init__(self, parts: Iterable[Places], shape: tuple[int, int]) -> None:
        self.shape = m, n = shape
        flat = [columns.ravel().astype(np.int64) * m + rows.ravel() for rows, columns in parts]
        keys = np.concatenate([np.zeros(0, dtype=np.int64), *flat])
        places = np.sort(keys)  # np.unique takes five times as long for millions
        places = places[np.diff(places, prepend=-1) > 0]
        columns, self._rows = np.divmod(places, m)
        self._starts = np.searchsorted(columns, np.arange(n + 1))
        self._where = np.searchsorted(places, keys)

    @property
    def pattern(self) -> csc_array:
        """Where the sum can be nonzero."""
        ones = np.ones(len(self._rows), dtype=bool)
        return csc_array((ones, self._rows, self._starts), shape=self.shape)

    def matrix(self, numbers: Sequence[Array]) -> csc_array:
        """The sum of the numbers of all parts, each in the order of its places."""
        addends = np.concatenate([np.zeros(0), *(part.ravel() for part in numbers)])
        total = sums(self._where, addends, len(self._rows))
        return csc_array((total, self._rows, self._starts), shape=self.shape)
