"""Affine maps of blocks: what stands for a body's pose may be made of several blocks.

A concatenation of pieces, the coefficients of principal components and a block that two bodies
share are all of the form

    a(x) = offset + sum over blocks b of A_b x_b,

with arrays flat, row by row. An argument of another form, or of a form that CasADi's derivatives do
not show, is part of the graph.

A row of the map that only copies one entry of a block, which no other row reads, is differentiated
straight into the Jacobian; other rows are differentiated by the argument and multiplied by the map.
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

FILLED = 0.2  # share of nonzeros above which dense products are faster than sparse ones
SMALL = 10_000  # entries of a matrix below which dense products are faster, too
SAME = 1e-12  # of the largest number in it: two computations of one map agree up to rounding


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
            at = [rng.standard_normal(s.numel()) for s in symbols]
            known = offset + sum(A @ x for A, x in zip(matrices, at, strict=True))
            within = SAME * np.abs(known).max(initial=1.0)
            if not np.isfinite(known).all() or (np.abs(function(*at)[0] - known) > within).any():
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
        found = self.offset.copy()
        for name, rows, entries in self._copied:
            found[rows] += values[name].reshape(-1)[entries]
        for name, rows, matrix in self._combined:
            found[rows] += matrix @ values[name].reshape(-1)
        return found.reshape(self.shape)

    def value_batch(self, values: Mapping[str, Array]) -> Array:
        """(M, *shape) of values that have M rows each."""
        if self.plain is not None:
            whole = values[self.plain]
            return whole.reshape(len(whole), *self.shape)
        M = len(next(iter(values.values())))
        found = np.repeat(self.offset[None], M, axis=0)
        for name, matrix in self.terms.items():
            found += (matrix @ values[name].reshape(M, -1).T).T
        return found.reshape(M, *self.shape)

    def vjp(self, gradient: Array) -> dict[str, Array]:
        """The gradients by the blocks, from the gradient by this array; all of them flat."""
        if self.plain is not None:
            return {self.plain: gradient}
        found = {name: np.zeros(matrix.shape[1]) for name, matrix in self.terms.items()}
        for name, rows, entries in self._copied:
            np.add.at(found[name], entries, gradient[rows])
        for name, rows, matrix in self._combined:
            found[name] += gradient[rows] @ matrix
        return found

    @cached_property
    def single(self) -> tuple[tuple[str, int] | None, ...]:
        """For each row the block's entry that it equals up to its offset; None for other rows."""
        found: list[tuple[str, int] | None] = [None] * len(self.offset)
        for name, rows, entries in self._copied:
            for row, entry in zip(rows.tolist(), entries.tolist(), strict=True):
                found[row] = name, entry
        return tuple(found)

    @cached_property
    def _copied(self) -> list[tuple[str, Index, Index]]:
        """Rows that are single entries: the block's name, these rows, and which entries."""
        read = sum((np.diff(A.indptr) for A in self.terms.values()), np.zeros(len(self.offset)))
        found = []
        for name, matrix in self.terms.items():
            nonzero = matrix.tocoo()
            copied = (read[nonzero.row] == 1) & (nonzero.data == 1.0)
            if copied.any():
                found.append((name, nonzero.row[copied], nonzero.col[copied]))
        return found

    @cached_property
    def _combined(self) -> list[tuple[str, Index, Array | csr_array]]:
        """All other rows, and the matrices of them."""
        rows = np.flatnonzero([at is None for at in self.single])
        parts = ((name, csr_array(matrix[rows])) for name, matrix in self.terms.items())
        return [(name, rows, filled(part)) for name, part in parts if part.nnz]


def alone(maps: Sequence[Affine]) -> tuple[tuple[tuple[str, int] | None, ...], ...]:
    """For each row of each map the entry of a block that it is, if no other row reads that entry.

    A change of such an entry changes this row by the same, and nothing else.
    """
    readers: dict[str, NDArray[np.int_]] = {}
    for one in maps:
        for name, matrix in one.terms.items():
            counts = np.bincount(matrix.indices, minlength=matrix.shape[1])
            readers[name] = counts + readers[name] if name in readers else counts
    return tuple(
        tuple(at if at is not None and readers[at[0]][at[1]] == 1 else None for at in one.single)
        for one in maps
    )


def place_of(rows: Sequence[tuple[str, int] | None]) -> tuple[str, int] | None:
    """Where in one block consecutive rows are its consecutive entries, or None if they are not."""
    first = rows[0]
    if first is None:
        return None
    name, entry = first
    in_order = all(row == (name, entry + i) for i, row in enumerate(rows))
    return (name, entry) if in_order else None


def filled(matrix: csr_array) -> Array | csr_array:
    """The matrix as a dense array, if it is small or few of its entries are zero."""
    size = matrix.shape[0] * matrix.shape[1]
    return matrix.toarray() if matrix.nnz > FILLED * size or size < SMALL else matrix


def _numbers(J: cs.MX) -> csr_array:
    found = csr_array(cs.evalf(J).sparse()) if J.nnz() else csr_array(J.shape)
    found.eliminate_zeros()
    return found
