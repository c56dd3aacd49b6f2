"""Affine maps of blocks: what stands for a body's pose may be made of several blocks.

A concatenation of pieces, the coefficients of principal components and a block that two bodies
share are all of the form

    a(x) = offset + sum over blocks b of A_b x_b,

with arrays flat, row by row. An argument of another form, or of a form that CasADi's derivatives do
not show, is part of the graph.

A row of the map that only copies one entry of a block, which no other row reads, is differentiated
straight into the Jacobian; others are multiplied by the map.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod

import casadi as cs
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array

from workbench.arrays import Array, Index
from workbench.blocks.functions import Buffered
from workbench.blocks.points import scalars_repeated

DENSE_SHARE = 0.2  # of nonzeros, above which dense products are faster than sparse ones
DENSE_SIZE = 10_000  # entries of a matrix, below which dense products are faster, too
ROUNDING = 1e-12  # of the largest number in it: two computations of one map agree up to this


@dataclass(frozen=True, eq=False)
class Affine:
    """offset + sum over blocks of matrix @ block, as an array of `shape`."""

    shape: tuple[int, ...]  # of the array that the map makes, as a user sees it
    offset: Array  # (size,) the array where all blocks are zero, flat, row by row
    terms: Mapping[str, csr_array]  # of each block the matrix (size, its size) that multiplies it

    @staticmethod
    def of(expression: cs.MX, shape: tuple[int, ...]) -> "Affine | None":
        """The map behind an expression in the symbols of blocks; None if it is not affine.

        The axes of the expression are those of `shape` reversed.
        """
        size = prod(shape)
        if expression.is_symbolic():
            unit = csr_array(eye_array(size, format="csr"))
            return Affine(shape, np.zeros(size), {expression.name(): unit})
        symbols = cs.symvar(expression)
        if not symbols:
            return Affine(shape, np.asarray(cs.evalf(expression)).ravel(order="F"), {})
        column = scalars_repeated(cs.densify(cs.vec(expression)))
        try:
            jacobians = [cs.jacobian(column, symbol) for symbol in symbols]
        except (RuntimeError, NotImplementedError):  # it calls what has no derivative
            return None
        if any(map(cs.symvar, jacobians)):
            return None
        matrices = [_numbers(J) for J in jacobians]
        function = Buffered(cs.Function("argument", symbols, [column]))
        offset = function(*(np.zeros(s.numel()) for s in symbols))[0]
        rng = np.random.default_rng(0)
        for _ in range(2):  # a branch has constant derivatives too, and is not affine
            xs = [rng.standard_normal(s.numel()) for s in symbols]
            mapped = offset + sum(A @ x for A, x in zip(matrices, xs, strict=True))
            error, within = abs(function(*xs)[0] - mapped), ROUNDING * abs(mapped).max(initial=1.0)
            if not np.isfinite(mapped).all() or (error > within).any():
                return None
        names = (symbol.name() for symbol in symbols)
        return Affine(shape, offset, dict(zip(names, matrices, strict=True)))

    @property
    def reads(self) -> tuple[str, ...]:
        """The names of the blocks that it reads."""
        return tuple(self.terms)

    @cached_property
    def plain(self) -> str | None:
        """The name of the one block to which this map is equal; None if there is no such block."""
        if len(self.terms) != 1 or self.offset.any():
            return None
        ((name, matrix),) = self.terms.items()
        n = len(self.offset)
        if matrix.shape != (n, n) or matrix.nnz != n:
            return None
        in_order = np.array_equal(matrix.indices, np.arange(n)) and (matrix.data == 1.0).all()
        return name if in_order and (np.diff(matrix.indptr) == 1).all() else None

    def value(self, values: Mapping[str, Array]) -> Array:
        """Its value, of `shape`; that of a plain block is not copied."""
        if self.plain is not None:
            whole = values[self.plain]
            return whole if whole.shape == self.shape else whole.reshape(self.shape)
        flat = self.offset.copy()
        for name, rows, entries in self._copied:
            flat[rows] += values[name].reshape(-1)[entries]
        for name, rows, matrix in self._combined:
            flat[rows] += matrix @ values[name].reshape(-1)
        return flat.reshape(self.shape)

    def value_batch(self, values: Mapping[str, Array]) -> Array:
        """(M, *shape) of values that have M rows each."""
        if self.plain is not None:
            whole = values[self.plain]
            return whole.reshape(len(whole), *self.shape)
        M = len(next(iter(values.values())))
        flat = np.repeat(self.offset[None], M, axis=0)
        for name, matrix in self.terms.items():
            flat += (matrix @ values[name].reshape(M, -1).T).T
        return flat.reshape(M, *self.shape)

    def vjp(self, gradient: Array) -> dict[str, Array]:
        """The gradients by the blocks, from the gradient by this array; all of them flat."""
        if self.plain is not None:
            return {self.plain: gradient}
        by_block = {name: np.zeros(matrix.shape[1]) for name, matrix in self.terms.items()}
        for name, rows, entries in self._copied:
            np.add.at(by_block[name], entries, gradient[rows])
        for name, rows, matrix in self._combined:
            by_block[name] += gradient[rows] @ matrix
        return by_block

    @cached_property
    def single(self) -> tuple[tuple[str, int] | None, ...]:
        """For each row the block's entry that it equals up to its offset; None for other rows."""
        entry_of: list[tuple[str, int] | None] = [None] * len(self.offset)
        for name, rows, entries in self._copied:
            for row, entry in zip(rows.tolist(), entries.tolist(), strict=True):
                entry_of[row] = name, entry
        return tuple(entry_of)

    @cached_property
    def _copied(self) -> list[tuple[str, Index, Index]]:
        """Rows that are single entries: the block's name, these rows, and which entries."""
        read = sum((np.diff(A.indptr) for A in self.terms.values()), np.zeros(len(self.offset)))
        parts = []
        for name, matrix in self.terms.items():
            nonzero = matrix.tocoo()
            copied = (read[nonzero.row] == 1) & (nonzero.data == 1.0)
            if copied.any():
                parts.append((name, nonzero.row[copied], nonzero.col[copied]))
        return parts

    @cached_property
    def _combined(self) -> list[tuple[str, Index, Array | csr_array]]:
        """All other rows, and the matrices of them."""
        rows = np.flatnonzero([entry is None for entry in self.single])
        parts = ((name, csr_array(matrix[rows])) for name, matrix in self.terms.items())
        return [(name, rows, fast_to_multiply(part)) for name, part in parts if part.nnz]


def alone(maps: Sequence[Affine]) -> tuple[tuple[tuple[str, int] | None, ...], ...]:
    """For each row of each map the entry of a block that it is, if no other row reads that entry.

    A change of such an entry changes this row by the same, and nothing else.
    """
    readers: dict[str, NDArray[np.int_]] = {}
    for map_ in maps:
        for name, matrix in map_.terms.items():
            counts = np.bincount(matrix.indices, minlength=matrix.shape[1])
            readers[name] = counts + readers[name] if name in readers else counts
    return tuple(
        tuple(e if e is not None and readers[e[0]][e[1]] == 1 else None for e in map_.single)
        for map_ in maps
    )


def place_of(rows: Sequence[tuple[str, int] | None]) -> tuple[str, int] | None:
    """Where in one block consecutive rows are its consecutive entries, or None if they are not."""
    first = rows[0]
    if first is None:
        return None
    name, entry = first
    in_order = all(row == (name, entry + i) for i, row in enumerate(rows))
    return (name, entry) if in_order else None


def fast_to_multiply(matrix: csr_array) -> Array | csr_array:
    """The matrix as a dense array, if it is small or few of its entries are zero."""
    size = matrix.shape[0] * matrix.shape[1]
    return matrix.toarray() if matrix.nnz > DENSE_SHARE * size or size < DENSE_SIZE else matrix


def _numbers(J: cs.MX) -> csr_array:
    matrix = csr_array(cs.evalf(J).sparse()) if J.nnz() else csr_array(J.shape)
    matrix.eliminate_zeros()
    return matrix
