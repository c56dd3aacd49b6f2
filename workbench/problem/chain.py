"""A problem's numbers by the chain rule: graphs for the residuals, arithmetic for the points.

The residual is a small graph of the free numbers, the fixed ones and the points, r(x, h, p(x, h)).
Where the source of the points knows their derivative by its structure, only the residuals are
derived by CasADi, and

    dr/dx = r_x + sum over sources of r_p dp/dx.

Points of sources without such knowledge are part of the graph, so one way serves all.
"""

from collections.abc import Sequence
from functools import cached_property

import casadi as cs
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array

from workbench.blocks import Layout, NumericPoints, PointsAt
from workbench.blocks.buffered import Buffered
from workbench.blocks.layout import all_values
from workbench.problem.graph import FORWARD, Graph
from workbench.problem.memory import check_fits
from workbench.problem.pattern import Assembly, Part, Pattern, merged
from workbench.problem.rounding import Support, half_squared
from workbench.problem.storage import Matrix, is_sparse

Array = NDArray[np.float64]
INSTEAD = "free fewer blocks at a time, or divide the problem, as a long sequence into short ones"
SUMS = 3  # of what a row is made of, with random weights: one alone may cancel


class Chain:
    """Residual, Jacobian and gradient of a graph whose points come from `sources`."""

    def __init__(
        self, graph: Graph, sources: Sequence[NumericPoints], free: Layout, fixed: Layout
    ) -> None:
        self._sources, self._free, self._fixed = tuple(sources), free, fixed
        arguments = [graph.x, graph.fixed, *graph.points]
        r = cs.densify(graph.residual)
        self._residual = Buffered(cs.Function("residual", arguments, [r]))
        jacobians = [cs.jacobian(r, a, FORWARD) for a in (graph.x, *graph.points)]
        self._derivative = Buffered(cs.Function("derivative", arguments, [r, *jacobians]))
        self._slopes: Buffered | None = None  # the Jacobians alone, if they read no points
        read = cs.veccat(*graph.points)
        if self._sources and not any(cs.depends_on(J, read) for J in jacobians):
            self._slopes = Buffered(cs.Function("slopes", arguments[:2], jacobians))
        self._by_x, *self._by_points = (Pattern(J.sparsity()) for J in jacobians)
        taken = [set(pattern.rows.tolist()) for pattern in self._by_points]
        self._own_rows = [  # where a source has rows for itself, coordinate by coordinate
            pattern.diagonal()
            if not any(taken[i] & other for j, other in enumerate(taken) if j != i)
            else None
            for i, pattern in enumerate(self._by_points)
        ]
        parts = [cs.jtimes(r, a, _weighed(a)) for a in arguments if a.numel()]
        size = cs.sqrt(sum(cs.sum2(part**2) for part in parts)) if parts else cs.MX(*r.shape)
        self._made_of = Buffered(cs.Function("made_of", arguments, [cs.densify(size)]))
        self._last: tuple[bytes, list[PointsAt]] = (b"", [])

    def residual(self, x: Array, fixed: Array) -> Array:
        """r (m,)."""
        return self._residual(x, fixed, *self._points(x, fixed))[0]

    def linearize(self, x: Array, fixed: Array) -> tuple[Array, Matrix]:
        """r (m,) and J (m, n): sparse, or an array stored column by column. Raises TooLarge."""
        m, n = self._by_x.shape
        if not self.sparse:
            check_fits(m, n, "a dense Jacobian", INSTEAD)
        places = self._at(x, fixed)
        if self._slopes is None:
            r, direct, *by_points = self._derivative(x, fixed, *(here.points for here in places))
            J = self._jacobian(places, direct, by_points)
        else:  # the points come last: they are met on the way to their derivative
            direct, *by_points = self._slopes(x, fixed)
            J = self._jacobian(places, direct, by_points)
            r = self._residual(x, fixed, *(here.points for here in places))[0]
        return r, J

    @cached_property
    def sparse(self) -> bool:
        """Whether the Jacobian is stored by its nonzeros: it is large, and most of it is zero."""
        (m, n), parts = self._by_x.shape, self._parts
        through = sum(len(p.rows) * (p.columns.stop - p.columns.start) for _, _, p in parts)
        return is_sparse(m, n, len(self._by_x.rows) + through)

    @property
    def pattern(self) -> csc_array:
        """Where the Jacobian may be nonzero, as far as residuals tell: points by whole blocks."""
        return merged(self._by_x, [part for _, _, part in self._parts])

    @cached_property
    def _parts(self) -> list[tuple[int, str, Part]]:
        """What reaches the residual from one block through one source: every entry of some rows."""
        return [
            (i, name, Part(np.unique(pattern.rows), at))
            for i, (source, pattern) in enumerate(zip(self._sources, self._by_points, strict=True))
            for name, at in self._free.slices.items()
            if name in source.reads
        ]

    @cached_property
    def _assembly(self) -> Assembly:
        return Assembly(self._by_x, [part for _, _, part in self._parts])

    def _jacobian(
        self, places: Sequence[PointsAt], direct: Array, by_points: list[Array]
    ) -> Matrix:
        if self.sparse:
            return self._sparse(places, direct, by_points)
        columns = self._columns(places, by_points)
        columns[self._by_x.columns, self._by_x.rows] += direct
        return columns.T

    def _sparse(
        self, places: Sequence[PointsAt], direct: Array, by_points: list[Array]
    ) -> csc_array:
        """The same by its nonzeros, of which those of one block through one source are dense."""
        assembly = self._assembly
        found = assembly.zeros()
        for i, (here, pattern, own, entries) in enumerate(
            zip(places, self._by_points, self._own_rows, by_points, strict=True)
        ):
            into: dict[str, Array] = {}
            for number, (_, name, part) in self._parts_of(i):
                room = None if own is None else assembly.view(number, found)
                size = part.columns.stop - part.columns.start
                into[name] = np.empty((size, pattern.shape[1])) if room is None else room
            here.tangent(into, None if own is None else entries)
            reduced = None if own is not None else pattern.matrix(entries).tocsr()
            for number, (_, name, part) in self._parts_of(i):
                if reduced is not None:
                    whole = reduced[part.rows] @ into[name].T
                    assembly.add_part(number, whole.T, found)
                elif assembly.view(number, found) is None:
                    assembly.add_part(number, into[name], found)
        assembly.add(direct, found)
        return assembly.matrix(found)

    def _parts_of(self, source: int) -> list[tuple[int, tuple[int, str, Part]]]:
        return [(n, part) for n, part in enumerate(self._parts) if part[0] == source]

    def _columns(self, places: Sequence[PointsAt], by_points: list[Array]) -> Array:
        """What reaches the residual through the points: J transposed, (n, m)."""
        m = self._by_x.shape[0]
        columns = np.empty((self._free.size, m))
        for at in self._not_all_written(m):
            columns[at] = 0.0
        for source, here, pattern, rows, entries in zip(
            self._sources, places, self._by_points, self._own_rows, by_points, strict=True
        ):
            wanted = [(name, at) for name, at in self._free.slices.items() if name in source.reads]
            if rows is not None:
                here.tangent({name: columns[at, rows] for name, at in wanted}, entries)
                continue
            parts = {name: np.empty((at.stop - at.start, pattern.shape[1])) for name, at in wanted}
            here.tangent(parts, None)
            for name, at in wanted:
                columns[at] += (pattern.matrix(entries) @ parts[name].T).T
        return columns

    def _not_all_written(self, m: int) -> list[slice]:
        """The blocks of which no source writes every row: only those have to be zero before."""
        whole = {
            name
            for source, rows in zip(self._sources, self._own_rows, strict=True)
            if rows == slice(0, m)
            for name in source.reads
        }
        return [at for name, at in self._free.slices.items() if name not in whole]

    def gradient(self, x: Array, fixed: Array) -> tuple[float, Array]:
        """The cost and its gradient (n,); no Jacobian of the points is formed."""
        places = self._at(x, fixed)
        r, direct, *by_points = self._derivative(x, fixed, *(here.points for here in places))
        g = self._by_x.pulled(direct, r)
        for here, pattern, entries in zip(places, self._by_points, by_points, strict=True):
            for name, part in here.adjoint(pattern.pulled(entries, r)).items():
                if name in self._free.slices:
                    g[self._free.slices[name]] += part
        return half_squared(r), g

    def made_of(self, x: Array, fixed: Array) -> Array:
        """The size of what each row is made of (m,): sqrt(sum of (dr/da_i a_i)^2), estimated.

        Terms that cancel each other in the residual must not cancel here. The squares of a few
        sums with normal weights are that size in the mean, without the derivatives one by one
        (Hutchinson, A stochastic estimator of the trace of the influence matrix, 1990).
        """
        return self._made_of(x, fixed, *self._points(x, fixed))[0]

    @cached_property
    def support(self) -> Support:
        """Which rows each free number can change: directly, and through the points."""
        n, m = self._free.size, self._by_x.shape[0]
        through = np.zeros((n, len(self._sources)), dtype=bool)
        for i, source in enumerate(self._sources):
            for name, at in self._free.slices.items():
                through[at, i] = name in source.reads
        kinds, group_of = np.unique(through, axis=0, return_inverse=True)
        groups = np.zeros((len(kinds), m), dtype=bool)
        for group, kind in zip(groups, kinds, strict=True):
            for pattern, read in zip(self._by_points, kind, strict=True):
                if read:
                    group[pattern.rows] = True
        group_of = group_of.ravel()
        columns, rows = self._by_x.columns, self._by_x.rows
        alone = ~groups[group_of[columns], rows]  # not counted twice
        ones = np.ones(int(alone.sum()))
        own = csr_array((ones, (columns[alone], rows[alone])), shape=(n, m))
        return Support(groups, group_of, own)

    def _points(self, x: Array, fixed: Array) -> list[Array]:
        """Each source's points, (N, 3)."""
        return [here.points for here in self._at(x, fixed)]

    def _at(self, x: Array, fixed: Array) -> Sequence[PointsAt]:
        """Each source's points as they are at x; kept for the next call there."""
        if not self._sources:
            return ()
        last, key = self._last, x.tobytes() + fixed.tobytes()  # once: a thread may replace it
        if key != last[0]:
            values = all_values(self._free, x, self._fixed, fixed)
            self._last = last = key, [source.at(values) for source in self._sources]
        return last[1]


def _weighed(argument: cs.MX) -> cs.MX:
    """Copies side by side, each entry times a normal weight, the same at every call."""
    rows, columns = argument.shape
    weights = np.random.default_rng(0).standard_normal((rows, SUMS * columns))
    return cs.DM(weights) * cs.repmat(argument, 1, SUMS)
