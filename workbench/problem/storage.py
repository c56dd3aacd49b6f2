"""Operations that depend on how a matrix is stored: as an array, by nonzeros, or by blocks.

A Jacobian is an array, or sparse (CSC), or, in a sequence of frames, a `BlockMatrix`; its normal
equations are an array, sparse or a `BandedMatrix`.

A Jacobian is stored sparse if it has more than four million entries of which less than an eighth
can be nonzero. A dense one that does not fit into the free memory is refused before it is
allocated.
"""

from __future__ import annotations

import ctypes
import os
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TypeAlias

import numpy as np
from scipy.sparse import block_array, csc_array, csr_array, vstack

from workbench.arrays import Array, Index, Mask
from workbench.compiling import aligned_zeros, library_or_none, source_beside, vectors
from workbench.errors import TooLarge
from workbench.problem.banded import BandedMatrix, BlockMatrix
from workbench.problem.sparsity import columns_of_nonzeros, sums

Stored: TypeAlias = Array | csc_array  # with all of its zeros, or by its nonzeros
Matrix: TypeAlias = Stored | BlockMatrix
Symmetric: TypeAlias = Stored | BandedMatrix
DENSE_FROM = 2**22  # entries, 32 MB: a smaller matrix is an array, whatever is in it
SPARSE_UP_TO = 1 / 8  # nonzeros an entry: above that an array is smaller and much quicker
SQUARE_UP_TO = 4000  # columns of a sparse matrix whose n x n arrays still fit
ALWAYS_FITS = 2**28  # bytes: not worth asking how much memory is free
GB = 1e9
INSTEAD = "free fewer blocks at a time, or divide the problem, as a long sequence into short ones"


def is_sparse(rows: int, columns: int, nonzeros: int) -> bool:
    """Whether a matrix of this size is stored by its nonzeros."""
    return rows * columns > DENSE_FROM and nonzeros < SPARSE_UP_TO * rows * columns


def dense(matrix: Matrix | Symmetric) -> Array:
    """The matrix as an array. Raises TooLarge where that does not fit into memory."""
    if isinstance(matrix, np.ndarray):
        return matrix
    check_fits(*matrix.shape)
    if isinstance(matrix, BlockMatrix):
        return matrix.dense
    return np.asarray(by_nonzeros(matrix).toarray())


def by_nonzeros(matrix: csc_array | BlockMatrix | BandedMatrix) -> csc_array:
    """The nonzeros of a matrix that is not stored as an array."""
    return matrix if isinstance(matrix, csc_array) else matrix.sparse


def unblocked(matrix: Matrix | Symmetric) -> Stored:
    """The matrix as an array, if it is one, or else by its nonzeros."""
    return matrix if isinstance(matrix, np.ndarray) else by_nonzeros(matrix)


def entries(matrix: Matrix) -> Array:
    """The stored numbers: all of an array, or the nonzeros of a sparse matrix."""
    return matrix if isinstance(matrix, np.ndarray) else np.asarray(by_nonzeros(matrix).data)


def column_norms(matrix: Matrix, normal: Symmetric | None = None) -> Array:
    """The length of every column, (n,); `normal` is J'J, if that is known already.

    Columns whose squares are too large to be numbers are scaled before; those whose squares are
    zero to rounding have the length zero.
    """
    if isinstance(matrix, BlockMatrix):
        return np.sqrt(matrix.column_squares())
    if isinstance(matrix, csc_array):
        return np.sqrt(sums(columns_of_nonzeros(matrix), matrix.data**2, matrix.shape[1]))
    columns = matrix.T  # as it is stored
    if normal is None:
        with np.errstate(over="ignore"):
            norms = np.asarray(np.sqrt(np.vecdot(columns, columns)))
    else:
        norms = np.asarray(np.sqrt(dense(normal).diagonal()))
    if norms.max(initial=0.0) < np.inf:
        return norms
    for i in np.flatnonzero(norms == np.inf):
        largest = np.abs(columns[i]).max()
        if largest < np.inf:
            norms[i] = largest * np.linalg.norm(columns[i] / largest)
    return norms


def row_norms(matrix: Matrix) -> Array:
    """The length of every row, (m,)."""
    if isinstance(matrix, np.ndarray):
        return np.asarray(np.sqrt(np.einsum("ij,ij->i", matrix, matrix)))
    stored = by_nonzeros(matrix)
    return np.sqrt(sums(stored.indices, stored.data**2, stored.shape[0]))


def absolute(matrix: Stored) -> Stored:
    """The absolute value of every entry."""
    return csc_array(abs(matrix)) if isinstance(matrix, csc_array) else np.abs(matrix)


def scaled(matrix: Matrix, factors: Array) -> Matrix:
    """Every column times its factor, (n,)."""
    if isinstance(matrix, BlockMatrix):
        return matrix.scaled(factors)
    return scaled_sparse(matrix, factors) if isinstance(matrix, csc_array) else matrix * factors


def scaled_sparse(matrix: Matrix, factors: Array) -> csc_array:
    """Every column times its factor (n,), by its nonzeros."""
    if isinstance(matrix, np.ndarray):
        return csc_array(matrix * factors)
    stored = by_nonzeros(matrix)
    numbers = stored.data * np.repeat(factors, np.diff(stored.indptr))
    return csc_array((numbers, stored.indices, stored.indptr), shape=stored.shape)


def stacked(matrix: Matrix, below: Array) -> Matrix:
    """The matrix, and more rows below it."""
    if isinstance(matrix, np.ndarray):
        return np.vstack([matrix, below])
    return csc_array(vstack([by_nonzeros(matrix), csc_array(below)]))


def columns_of(matrix: Matrix, part: Index | Mask) -> Stored:
    """Some columns; as an array where they are few, or no longer sparse."""
    chosen = (matrix.sparse if isinstance(matrix, BlockMatrix) else matrix)[:, part]
    if isinstance(chosen, csc_array) and not is_sparse(*chosen.shape, chosen.nnz):
        return np.asarray(chosen.toarray())
    return chosen


def where_not_finite(matrix: Matrix) -> list[tuple[int, int]]:
    """Rows and columns of entries that are NaN or infinite."""
    if not isinstance(matrix, np.ndarray):
        stored = by_nonzeros(matrix).tocoo()
        bad = ~np.isfinite(stored.data)
        return list(zip(stored.row[bad].tolist(), stored.col[bad].tolist(), strict=True))
    return [(int(i), int(j)) for i, j in np.argwhere(~np.isfinite(matrix))]


def check_wide(matrix: Matrix) -> None:
    """Raise TooLarge where a sparse matrix has too many columns for arrays of n x n."""
    m, n = matrix.shape
    if not isinstance(matrix, np.ndarray) and n > SQUARE_UP_TO:
        raise TooLarge(
            f"the singular values of a sparse Jacobian of {m:,} x {n:,} need arrays of {n:,} x "
            f"{n:,}; up to {SQUARE_UP_TO:,} columns have them: free fewer blocks"
        )


def is_long(matrix: Matrix) -> bool:
    """Whether a matrix is that of a sequence of frames, too wide for arrays of n x n."""
    return isinstance(matrix, BlockMatrix) and matrix.shape[1] > SQUARE_UP_TO


def gram(matrix: Matrix) -> Symmetric:
    """The matrix, transposed, times itself, (n, n); infinite where it is too large."""
    with np.errstate(over="ignore", invalid="ignore"):
        if isinstance(matrix, BlockMatrix):
            return matrix.normal()
        if isinstance(matrix, csc_array):
            return gram_of_nonzeros(matrix)
        return np.asarray(matrix.T @ matrix)


def gram_of_nonzeros(matrix: csc_array) -> csc_array:
    """A sparse matrix, transposed, times itself, (n, n)."""
    is_crowded = crowded(matrix)
    if not is_crowded.any():
        gram = csc_array(matrix.T @ matrix)
    else:  # products of columns without zeros are many times as fast by arrays
        S, B = csc_array(matrix[:, ~is_crowded]), dense(csc_array(matrix[:, is_crowded]))
        between = S.T @ B
        blocks = [[S.T @ S, between], [between.T, B.T @ B]]
        position = np.argsort(np.argsort(is_crowded, kind="stable"), kind="stable")
        gram = csc_array(csc_array(block_array(blocks, format="csc"))[:, position])[position]
    return csc_array(csr_array(gram).T)  # itself, as it is symmetric; this is how rows are sorted


def part(matrix: Symmetric, mask: Mask) -> Symmetric:
    """Some rows, and the same columns, of a symmetric matrix."""
    stored = matrix if isinstance(matrix, np.ndarray) else by_nonzeros(matrix)
    return stored[mask][:, mask]


def crowded(matrix: csc_array) -> Mask:
    """The columns (n,) in which more than an eighth of all entries are stored."""
    return np.asarray(np.diff(matrix.indptr) > SPARSE_UP_TO * matrix.shape[0])


def times(matrix: Matrix, other: Array) -> Matrix:
    """The product with another matrix, (n, k)."""
    if isinstance(matrix, np.ndarray):
        return np.asarray(matrix @ other)
    return csc_array(by_nonzeros(matrix) @ csc_array(other))


def distance(first: Matrix, a: float, second: Matrix, b: float) -> float:
    """Frobenius' norm of a times one matrix minus b times another of the same kind."""
    if isinstance(first, np.ndarray) or isinstance(second, np.ndarray):
        return float(np.linalg.norm(a * dense(first) - b * dense(second)))
    return float(np.linalg.norm((a * by_nonzeros(first) - b * by_nonzeros(second)).data))


def check_fits(rows: int, columns: int) -> None:
    """Raise TooLarge unless a dense Jacobian fits twice into the memory that is free."""
    size = 8 * rows * columns
    if size <= ALWAYS_FITS:
        return
    free = free_memory()
    if free is not None and 2 * size > free:  # a factorization of it takes as much again
        raise TooLarge(
            f"a dense Jacobian of {rows:,} x {columns:,} takes {size / GB:.3g} GB, and a step "
            f"with it as much again; {free / GB:.2g} GB of memory are free; {INSTEAD}"
        )


def free_memory() -> int | None:
    """The bytes that this process may still allocate; None where the system does not tell.

    It is the available memory of the machine, or what a limit of the process or of its container
    leaves if that is less. Only Linux tells.
    """
    limits: list[int] = []
    with suppress(OSError, ValueError):
        facts = dict(line.split(":", 1) for line in Path("/proc/meminfo").read_text().splitlines())
        limits.append(1024 * int(facts["MemAvailable"].split()[0]))
    with suppress(OSError, ValueError, ImportError):
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        used = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
        if limit != resource.RLIM_INFINITY:
            limits.append(max(0, limit - used))
    with suppress(OSError, ValueError):
        group = Path("/sys/fs/cgroup")
        limit = int((group / "memory.max").read_text())  # "max" is no number: no limit
        limits.append(max(0, limit - int((group / "memory.current").read_text())))
    return min(limits, default=None)


LIBRARY = "normal-equations"
COMPILED_FROM = 2e7  # multiplications, m n^2: of fewer, BLAS is as fast as a call of anything
COMPILED_COLUMNS = 200  # at most: the sums of more do not stay near the processor (measured)
TRIED_SHAPE = 301, 13  # of the matrix that the library is tried on: two full blocks and a part


def normal_equations(J: object, r: Array) -> tuple[Array, Array] | None:
    """J'J (n, n) and J'r (n,), for J (m, n) and r (m,); None where they come from elsewhere.

    That is so where J is small, is no array that is stored column by column, or nothing can be
    compiled.
    """
    if not isinstance(J, np.ndarray):
        return None
    m, n = J.shape
    if J.strides[0] != 8 or J.dtype != np.float64 or m != len(r) or not worthwhile(m, n):
        return None
    compiled = compiled_gram()
    if compiled is None:
        return None
    return compiled.products(J, np.ascontiguousarray(r, dtype=np.float64))


def worthwhile(m: int, n: int) -> bool:
    """Whether a Jacobian (m, n) is large enough, and not too wide."""
    return n <= COMPILED_COLUMNS and m * n * n >= COMPILED_FROM


@cache
def compiled_gram() -> CompiledGram | None:
    """The compiled products, loaded once per process; None where there is no compiler."""
    source = "\n".join([vectors(), source_beside(__package__, "gram.c")])
    library = library_or_none(LIBRARY, source, _agrees, "normal equations are computed by BLAS")
    return None if library is None else CompiledGram(library)


@dataclass(frozen=True, eq=False)
class CompiledGram:
    """Products of columns by the functions of `gram.c`."""

    library: ctypes.CDLL
    _buffers: list[Array] = field(default_factory=list)  # memory that is used again

    def products(self, J: Array, r: Array) -> tuple[Array, Array]:
        """J'J (n, n) and J'r (n,), for J (m, n) stored column by column and r (m,)."""
        m, n = J.shape
        columns = np.empty(n + 1, dtype=np.intp)
        columns[:n] = J.ctypes.data + J.strides[1] * np.arange(n)
        columns[n] = r.ctypes.data
        buffer = self._buffer(n + 1)
        products = np.empty((n + 1, n + 1))
        words = m, n + 1, columns.ctypes.data, buffer.ctypes.data, products.ctypes.data
        self.library.gram(*map(ctypes.c_ssize_t, words))
        self._buffers.append(buffer)
        return products[:n, :n].copy(), products[:n, n].copy()

    def _buffer(self, n: int) -> Array:
        """Memory for sums and packed columns, from a run before if that was not for fewer."""
        self.library.room_for.restype = ctypes.c_ssize_t
        size = self.library.room_for(ctypes.c_ssize_t(n))
        with suppress(IndexError):
            buffer = self._buffers.pop()  # at once, whatever other threads do
            if len(buffer) >= size:
                return buffer
        return aligned_zeros((size,), np.float64)


def _agrees(library: ctypes.CDLL) -> bool:
    """Whether the library says what BLAS says, about random columns that are zero in some rows."""
    rng, (m, n) = np.random.default_rng(0), TRIED_SHAPE
    J, r = rng.standard_normal((n, m)).T, rng.standard_normal(m)
    J[: m // 2, : n // 2] = 0.0
    normal, gradient = CompiledGram(library).products(J, r)
    close = np.allclose(normal, J.T @ J, rtol=0, atol=1e-12 * m)
    return close and np.allclose(gradient, J.T @ r, rtol=0, atol=1e-12 * m)
