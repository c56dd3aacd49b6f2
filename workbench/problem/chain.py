"""A problem's numbers by the chain rule: graphs of the residuals, arithmetic for the points.

The residual is a small graph of the free numbers, the fixed ones and the points, r(x, h, p(x, h)),
and

    dr/dx = r_x + sum over sources of r_p dp/dx.

dp/dx is an array, or sparse for those blocks for which the source says so (its `pattern`). Points
of sources without arithmetic are part of the graph.
"""

import weakref
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as cs
import numpy as np
from scipy.sparse import csc_array, csr_array

from workbench.arrays import Array
from workbench.blocks import Layout, NumericPoints, PointsAt
from workbench.blocks.functions import Buffered, without_calls
from workbench.blocks.layout import all_values
from workbench.blocks.points import distinct
from workbench.compiling import aligned_zeros
from workbench.problem.graph import FORWARD, Graph, split, term_sizes
from workbench.problem.optimality import RowSupport, half_squared
from workbench.problem.sparsity import (
    ChangingTerm,
    DenseTerm,
    Pattern,
    SparseSum,
    SparseTerm,
    entries_at,
    gaps,
)
from workbench.problem.storage import Stored, check_fits, is_sparse
from workbench.residuals import Residual

Term = DenseTerm | SparseTerm | ChangingTerm


class Chain:
    """Residual, Jacobian and gradient of a graph whose points come from `sources`.

    `to_residual`, `to_derivative` and `to_size` are its functions of x, the fixed numbers and the
    points; `by_x` and `by_points` say where the derivatives by these are nonzero.
    """

    def __init__(
        self, graph: Graph, sources: Sequence[NumericPoints], free: Layout, fixed: Layout
    ) -> None:
        self.sources, self.free, self._fixed = tuple(sources), free, fixed
        arguments = [graph.x, graph.fixed, *graph.points]
        r = cs.densify(graph.residual)
        self.to_residual = Buffered(cs.Function("residual", arguments, [r]))
        jacobians = [cs.jacobian(r, a, FORWARD) for a in (graph.x, *graph.points)]
        derivative = cs.Function("derivative", arguments, [r, *jacobians])
        self.to_derivative = Buffered(without_calls(derivative))
        self._jacobians: Buffered | None = None  # these alone, if they do not read the points
        read = cs.veccat(*graph.points)
        if self.sources and not any(cs.depends_on(J, read) for J in jacobians):
            self._jacobians = Buffered(cs.Function("jacobians", arguments[:2], jacobians))
        self._constant: list[Array] = []  # their numbers, if they read nothing at all
        numbers = cs.veccat(*arguments[:2])
        if self._jacobians and not any(cs.depends_on(J, numbers) for J in jacobians):
            self._constant = self._jacobians(*(np.zeros(a.numel()) for a in arguments[:2]))
        self.by_x, *self.by_points = (Pattern(J.sparsity()) for J in jacobians)
        readers = Counter(row for p in self.by_points for row in np.unique(p.rows).tolist())
        self._own_rows = [  # where a source has rows for itself, coordinate by coordinate
            pattern.diagonal if all(readers[row] == 1 for row in pattern.rows.tolist()) else None
            for pattern in self.by_points
        ]
        self.to_size = Buffered(cs.Function("term_sizes", arguments, [term_sizes(r, arguments)]))
        self._last: tuple[tuple[bytes, bytes], list[PointsAt]] = ((b"", b""), [])
        self._buffers = BufferPool()

    @staticmethod
    def of(residuals: Sequence[Residual], free: Layout, fixed: Layout) -> "Chain":
        """The chain rule of these residuals, stacked."""
        whitened = cs.vertcat(*[residual.whitened for residual in residuals])
        points = distinct(p for residual in residuals for p in residual.points)
        return Chain(*split(whitened, points, free, fixed), free, fixed)

    def residual(self, x: Array, fixed: Array) -> Array:
        """The whitened residual, (m,)."""
        return self.to_residual(x, fixed, *self._points(x, fixed))[0]

    def linearize(self, x: Array, fixed: Array) -> tuple[Array, Stored]:
        """r (m,) and J (m, n): sparse, or an array stored column by column. Raises TooLarge."""
        if not self.sparse:
            check_fits(*self.by_x.shape)
        places = self._places(x, fixed)
        if self._jacobians is None:
            r, direct, *by_points = self.to_derivative(x, fixed, *(here.points for here in places))
            return r, self._jacobian(places, direct, by_points)
        # the points come last, because they are a byproduct of their derivative
        direct, *by_points = self._constant or self._jacobians(x, fixed)
        J = self._jacobian(places, direct, by_points)
        return self.to_residual(x, fixed, *(here.points for here in places))[0], J

    @cached_property
    def sparse(self) -> bool:
        """Whether the Jacobian is stored by its nonzeros: it is large, and most of it is zero."""
        through_points = sum(term.filled for term in self._terms)
        return is_sparse(*self.by_x.shape, len(self.by_x.rows) + through_points)

    @cached_property
    def pattern(self) -> csc_array:
        """Where the Jacobian can be nonzero, (m, n).

        Where a source has no pattern, each of its points reads all numbers of its blocks.
        """
        places = [self.by_x.places, *(term.places for term in self._terms)]
        return SparseSum(places, self.by_x.shape).pattern

    @cached_property
    def _terms_of(self) -> list[list[tuple[str, Term]]]:
        """For each source, the blocks that it reads and the terms of J that come through them.

        A term holds every entry of the rows that read the source; or, where the source has a
        pattern of this block, the places in which the product dr/dp dp/dx can be nonzero.
        """
        return [
            [
                (name, _term(pattern, source, name, at))
                for name, at in self.free.slices.items()
                if name in source.reads
            ]
            for source, pattern in zip(self.sources, self.by_points, strict=True)
        ]

    @property
    def _terms(self) -> list[Term]:
        return [term for terms in self._terms_of for _, term in terms]

    @cached_property
    def _sparse_sum(self) -> SparseSum:
        places = [term.places for term in self._terms if not isinstance(term, ChangingTerm)]
        return SparseSum([self.by_x.places, *places], self.by_x.shape)

    def _jacobian(
        self, places: Sequence[PointsAt], direct: Array, by_points: list[Array]
    ) -> Stored:
        if self.sparse:
            return self._sparse_jacobian(places, direct, by_points)
        columns, jacobian = self._buffers.array(self.free.size, self.by_x.shape[0])
        for at, rows in self._unwritten:
            columns[at, rows] = 0.0
        own = self.by_x.columns, self.by_x.rows
        if len(direct):
            columns[own] = 0.0
        for term, by_point, product in self._through_points(places, by_points, columns):
            if isinstance(product, csc_array):
                nonzeros = product.tocoo()
                columns[term.columns.start + nonzeros.col, nonzeros.row] += nonzeros.data
            elif by_point is not None:
                columns[term.columns] += (by_point @ product.T).T
        if len(direct):
            columns[own] += direct
        return jacobian.T

    def _sparse_jacobian(
        self, places: Sequence[PointsAt], direct: Array, by_points: list[Array]
    ) -> csc_array:
        """The Jacobian by its nonzeros."""
        numbers, changing = [direct], []
        for term, by_point, product in self._through_points(places, by_points, None):
            if isinstance(term, ChangingTerm):
                changing.append(term.within(product, self.free.size))
            elif isinstance(term, SparseTerm):
                numbers.append(entries_at(product, term.pattern))
            elif by_point is None:
                numbers.append(product)
            else:
                numbers.append((by_point[term.rows] @ product.T).T)
        return sum(changing, self._sparse_sum.matrix(numbers))

    def _through_points(
        self, places: Sequence[PointsAt], by_points: list[Array], columns: Array | None
    ) -> Iterator[tuple[Term, csc_array | csr_array | None, Any]]:
        """The terms of J that come through the points: dr/dp dp/dx for each block of a source.

        With each comes dr/dp (m, 3 N) and dp/dx, transposed, as an array (size, 3 N); or None and
        their product, which is sparse for a sparse term. Where a source has rows for itself, the
        product is an array (size, rows), and it is written to `columns`, J' (n, m), if given.
        """
        for here, pattern, rows, entries, terms in zip(
            places, self.by_points, self._own_rows, by_points, self._terms_of, strict=True
        ):
            dense = {name: term.columns for name, term in terms if isinstance(term, DenseTerm)}
            if columns is not None and rows is not None:
                arrays = {name: columns[at, rows] for name, at in dense.items()}
            else:
                wide = pattern.shape[1]
                arrays = {n: np.zeros((at.stop - at.start, wide)) for n, at in dense.items()}
            if arrays:
                here.write_jacobian(arrays, None if rows is None else entries)
            by_point: csc_array | csr_array | None = None
            if arrays and rows is None:
                by_point = pattern.matrix(entries)
                by_point = by_point.tocsr() if columns is None else by_point
            for name, term in terms:
                if name in arrays:
                    yield term, by_point, arrays[name]
                else:
                    yield term, None, pattern.times(entries, here.jacobian(name))

    @cached_property
    def _unwritten(self) -> list[tuple[slice, slice]]:
        """Columns and rows of J that no source writes whole; they must be zero before."""
        written: dict[str, list[slice]] = {name: [] for name in self.free.slices}
        for rows, terms in zip(self._own_rows, self._terms_of, strict=True):
            for name, term in terms:
                if rows is not None and isinstance(term, DenseTerm):
                    written[name].append(rows)
        m = self.by_x.shape[0]
        return [(self.free.slices[n], rows) for n, own in written.items() for rows in gaps(own, m)]

    def gradient(self, x: Array, fixed: Array) -> tuple[float, Array]:
        """The cost and its gradient (n,); no Jacobian of the points is formed."""
        places = self._places(x, fixed)
        points = [here.points for here in places]
        if self._constant:
            (r,), (direct, *by_points) = self.to_residual(x, fixed, *points), self._constant
        else:
            r, direct, *by_points = self.to_derivative(x, fixed, *points)
        g = self.by_x.vjp(direct, r)
        for here, pattern, entries in zip(places, self.by_points, by_points, strict=True):
            for name, product in here.vjp(pattern.vjp(entries, r)).items():
                if name in self.free.slices:
                    g[self.free.slices[name]] += product
        return half_squared(r), g

    def term_sizes(self, x: Array, fixed: Array) -> Array:
        """The size of each row's terms (m,), estimated: see `term_sizes`."""
        return self.to_size(x, fixed, *self._points(x, fixed))[0]

    @cached_property
    def support(self) -> RowSupport:
        """Which rows each free number can change: directly, and through the points."""
        n, m, k = self.free.size, self.by_x.shape[0], len(self.sources)
        through = np.zeros((n, k), dtype=bool)
        for i, terms in enumerate(self._terms_of):
            for _, term in terms:
                if not isinstance(term, SparseTerm):
                    through[term.columns, i] = True
        readers = np.zeros((k, m), dtype=bool)
        for rows, pattern in zip(readers, self.by_points, strict=True):
            rows[pattern.rows] = True
        sparse = [term.places for term in self._terms if isinstance(term, SparseTerm)]
        own = SparseSum([self.by_x.places, *sparse], (m, n)).pattern
        return RowSupport(csr_array(through), csr_array(readers), csr_array(own.T))

    def _points(self, x: Array, fixed: Array) -> list[Array]:  # (N, 3) each
        return [here.points for here in self._places(x, fixed)]

    def _places(self, x: Array, fixed: Array) -> Sequence[PointsAt]:
        """Each source's points at the free numbers x and the fixed ones, kept for the next call."""
        if not self.sources:
            return ()
        last, key = self._last, (x.tobytes(), fixed.tobytes())  # once: a thread may replace it
        if key != last[0]:
            values = all_values(self.free, x, self._fixed, fixed)
            self._last = last = key, [source.evaluate(values) for source in self.sources]
        return last[1]


def _term(pattern: Pattern, source: NumericPoints, name: str, columns: slice) -> Term:
    """The term of J in the columns of a block, through the points of a source."""
    rows, nonzeros = np.unique(pattern.rows), source.nonzeros(name)
    if nonzeros is not None:
        return ChangingTerm(rows, columns, nonzeros)
    of_points = source.pattern(name)
    if of_points is None:
        return DenseTerm(rows, columns)
    return SparseTerm(pattern.reached(of_points), columns)


WORTH_KEEPING = 2**20  # bytes: memory for less is quick to get
KEPT_BUFFERS = 2  # that wait to be used again: a solver compares two linearizations


@dataclass(frozen=True, eq=False)
class BufferPool:
    """Memory for arrays of one size after the other.

    An operating system clears new memory page by page, which for a large Jacobian takes as long as
    computing it. An array's memory is free when the array and all views of it are gone. Whoever
    gets it again finds in it what was written there before: hence others can only read it.
    """

    _free: list[Array] = field(default_factory=list)
    _in_use: dict[int, weakref.ref[Array]] = field(default_factory=dict)  # by the buffer

    def array(self, rows: int, columns: int) -> tuple[Array, Array]:
        """An array (rows, columns) to write to, and the same for everybody else to read.

        It holds zeros, or what the last array of this size held. It is free to be used again when
        the second one is gone.
        """
        size = 8 * rows * columns
        if size < WORTH_KEEPING:
            array = np.zeros((rows, columns))
            return array, array
        try:
            buffer = self._free.pop()  # at once, whatever other threads do
        except IndexError:
            buffer = aligned_zeros((rows * columns,), np.float64)
        if buffer.nbytes != size:
            buffer = aligned_zeros((rows * columns,), np.float64)
        # all views hold it, as its base is no array, and none can be made writeable
        to_read = np.frombuffer(memoryview(buffer.data).toreadonly())
        # it calls back while it is held; `weakref.finalize` takes three times as long
        self._in_use[id(buffer)] = weakref.ref(to_read, lambda _: self._take_back(buffer))
        return buffer.reshape(rows, columns), to_read.reshape(rows, columns)

    def _take_back(self, buffer: Array) -> None:
        del self._in_use[id(buffer)]
        if len(self._free) < KEPT_BUFFERS:
            self._free.append(buffer)
