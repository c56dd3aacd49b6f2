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
from scipy.sparse import csc_array, csr_array, hstack

from workbench.blocks import Layout, NumericPoints, PointsAt
from workbench.blocks.buffered import Buffered
from workbench.problem.graph import Graph
from workbench.problem.memory import check_fits
from workbench.problem.rounding import Support

Array = NDArray[np.float64]
Sparse = tuple[Array, csc_array]  # a residual and its Jacobian
# CasADi 3.8 loses the derivative of `row + scalar` by the scalar when it takes a Jacobian of more
# columns than rows backwards: all but the first entry come out zero
FORWARD = {"helper_options": {"ad_weight": 0.0}}
INSTEAD = (
    "take nlopt-lbfgs, which needs no dense Jacobian of a large problem, free fewer blocks at a "
    "time, or divide the problem, as a long sequence into short ones"
)
SUMS = 3  # of what a row is made of, with random weights: one alone may cancel


def half_squared(r: Array) -> float:
    """1/2 |r|^2 of a residual (m,); infinite, without a warning, where it is too large."""
    return 0.5 * float(np.vdot(r, r))


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
        self._by_x, *self._by_points = (_Pattern(J.sparsity()) for J in jacobians)
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

    def linearize(self, x: Array, fixed: Array) -> tuple[Array, Array]:
        """r (m,) and J (m, n), stored column by column. Raises TooLarge."""
        check_fits(*self._by_x.shape, "a dense Jacobian", INSTEAD)
        places = self._at(x, fixed)
        if self._slopes is None:
            r, direct, *by_points = self._derivative(x, fixed, *(here.points for here in places))
            columns = self._columns(places, by_points)
        else:  # the points come last: they are met on the way to their derivative
            direct, *by_points = self._slopes(x, fixed)
            columns = self._columns(places, by_points)
            r = self._residual(x, fixed, *(here.points for here in places))[0]
        columns[self._by_x.columns, self._by_x.rows] += direct
        return r, columns.T

    def linearize_sparsely(self, x: Array, fixed: Array) -> Sparse:
        """The same with a sparse J: what reaches the residual from one block at a time is dense."""
        places = self._at(x, fixed)
        r, direct, *by_points = self._derivative(x, fixed, *(here.points for here in places))
        J = self._by_x.matrix(direct)
        reached = []
        for name, at in self._free.slices.items():
            size = at.stop - at.start
            part = csc_array((len(r), size))
            for source, here, pattern, entries in zip(
                self._sources, places, self._by_points, by_points, strict=True
            ):
                if name in source.reads:
                    tangent = np.empty((size, pattern.shape[1]))
                    here.tangent({name: tangent}, None)
                    part = part + pattern.matrix(entries) @ csc_array(tangent.T)
            reached.append(part)
        return r, csc_array(J + hstack(reached, format="csc")) if self._sources else J

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
            values = self._free.unpack(x) | self._fixed.unpack(fixed)
            self._last = last = key, [source.at(values) for source in self._sources]
        return last[1]


class _Pattern:
    """Where the entries of a sparse Jacobian stand, in CasADi's order: column by column."""

    def __init__(self, sparsity: cs.Sparsity) -> None:
        self.shape: tuple[int, int] = sparsity.shape
        self._starts = np.array(sparsity.colind(), dtype=np.int64)
        self.rows = np.array(sparsity.row(), dtype=np.int64)
        self.columns = np.repeat(np.arange(self.shape[1]), np.diff(self._starts))

    def diagonal(self) -> slice | None:
        """The rows of a diagonal over all columns, if that is all: points seen one by one."""
        first, n = int(self.rows[0]) if len(self.rows) else 0, self.shape[1]
        once = np.array_equal(self.columns, np.arange(n))
        in_order = once and np.array_equal(self.rows, first + np.arange(n))
        return slice(first, first + n) if in_order else None

    def pulled(self, entries: Array, r: Array) -> Array:
        """The matrix with these entries, transposed, times r."""
        found = np.bincount(self.columns, entries * r[self.rows], minlength=self.shape[1])
        return np.asarray(found, dtype=float)  # counts, where there are no entries

    def matrix(self, entries: Array) -> csc_array:
        """The matrix with these entries."""
        return csc_array((entries, self.rows, self._starts), shape=self.shape)


def _weighed(argument: cs.MX) -> cs.MX:
    """Copies side by side, each entry times a normal weight, the same at every call."""
    rows, columns = argument.shape
    weights = np.random.default_rng(0).standard_normal((rows, SUMS * columns))
    return cs.DM(weights) * cs.repmat(argument, 1, SUMS)
