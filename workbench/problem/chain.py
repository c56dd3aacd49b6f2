"""A problem's numbers by the chain rule: graphs for the residuals, arithmetic for the points.

The residual is a small graph of the free numbers, the fixed ones and the points, r(x, h, p(x, h)).
Where the source of the points knows their derivative by its structure, only the residuals are
derived by CasADi, and

    dr/dx = r_x + sum over sources of r_p dp/dx.

Points of sources without such knowledge are part of the graph, so one way serves all.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as cs
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from workbench.blocks import Layout, NumericPoints, Values
from workbench.blocks.buffered import Buffered

Array = NDArray[np.float64]
# CasADi 3.8 loses the derivative of `row + scalar` by the scalar when it takes a Jacobian of more
# columns than rows backwards: all but the first entry come out zero
FORWARD = {"helper_options": {"ad_weight": 0.0}}


@dataclass(frozen=True, eq=False)
class Graph:
    """The residual in symbols: flat free and fixed numbers, and the points left as they are."""

    x: cs.MX  # (n, 1)
    fixed: cs.MX
    points: tuple[cs.MX, ...]  # (3, N) each
    residual: cs.MX  # (m, 1), whitened


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
        self._shapes = [point.shape[::-1] for point in graph.points]
        self._slopes: Buffered | None = None  # the Jacobians alone, if they read no points
        if self._sources and not cs.depends_on(cs.veccat(*jacobians), cs.veccat(*graph.points)):
            self._slopes = Buffered(cs.Function("slopes", arguments[:2], jacobians))
        self._by_x, *self._by_points = (_Pattern(J.sparsity()) for J in jacobians)
        taken = [set(pattern.rows.tolist()) for pattern in self._by_points]
        self._own_rows = [  # where a source has rows for itself, coordinate by coordinate
            pattern.diagonal()
            if not any(taken[i] & other for j, other in enumerate(taken) if j != i)
            else None
            for i, pattern in enumerate(self._by_points)
        ]
        made_from = [cs.jtimes(r, a, a) for a in arguments if a.numel()]
        size = cs.sqrt(sum(cs.sumsqr(part) for part in made_from)) if made_from else cs.MX(0)
        self._size = Buffered(cs.Function("size", arguments, [cs.densify(size)]))
        self._last: tuple[bytes, Values, list[Array]] = (b"", {}, [])

    def residual(self, x: Array, fixed: Array) -> Array:
        """r (m,)."""
        _, points = self._points(x, fixed)
        return self._residual(x, fixed, *points)[0]

    def linearize(self, x: Array, fixed: Array) -> tuple[Array, Array]:
        """r (m,) and J (m, n), stored column by column.

        Where the residual's derivative does not read the points, these are found on the way.
        """
        if not self._slopes or self._known(x, fixed):
            values, points = self._points(x, fixed)
            r, direct, *by_points = self._derivative(x, fixed, *points)
            columns = self._columns(values, by_points, [None] * len(points))
        else:
            values, points = self._values(x, fixed), [np.empty(shape) for shape in self._shapes]
            direct, *by_points = self._slopes(x, fixed)
            columns = self._columns(values, by_points, points)
            self._last = _key(x, fixed), values, points
            r = self._residual(x, fixed, *points)[0]
        columns[self._by_x.columns, self._by_x.rows] += direct
        return r, columns.T

    def _columns(
        self, values: Values, by_points: list[Array], points: Sequence[Array | None]
    ) -> Array:
        """What reaches the residual through the points: J transposed, (n, m)."""
        m = self._by_x.shape[0]
        columns = np.empty((self._free.size, m))
        for at in self._not_all_written(m):
            columns[at] = 0.0
        for source, pattern, rows, entries, found in zip(
            self._sources, self._by_points, self._own_rows, by_points, points, strict=True
        ):
            wanted = [(name, at) for name, at in self._free.slices.items() if name in source.reads]
            if rows is not None:
                targets = {name: columns[at, rows] for name, at in wanted}
                source.tangent(values, targets, entries, found)
                continue
            parts = {name: np.empty((at.stop - at.start, pattern.shape[1])) for name, at in wanted}
            source.tangent(values, parts, None, found)
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
        values, points = self._points(x, fixed)
        r, direct, *by_points = self._derivative(x, fixed, *points)
        g = self._by_x.matrix(direct).T @ r
        for source, pattern, entries in zip(self._sources, self._by_points, by_points, strict=True):
            for name, part in source.adjoint(values, pattern.matrix(entries).T @ r).items():
                if name in self._free.slices:
                    g[self._free.slices[name]] += part
        return 0.5 * float(r @ r), g

    def size(self, x: Array, fixed: Array) -> float:
        """The size of what the residual is made of: each argument through its derivative."""
        _, points = self._points(x, fixed)
        return float(self._size(x, fixed, *points)[0][0])

    def _points(self, x: Array, fixed: Array) -> tuple[Values, list[Array]]:
        """The values by name, and each source's points (N, 3); kept for the next call at x."""
        last = self._last  # once: another thread may replace it
        key = _key(x, fixed) if self._sources else b""
        if self._sources and key == last[0]:
            return last[1:]
        values = self._values(x, fixed) if self._sources else {}
        found = [source.points(values) for source in self._sources]
        self._last = key, values, found
        return values, found

    def _known(self, x: Array, fixed: Array) -> bool:
        """Whether the points at x are kept."""
        return _key(x, fixed) == self._last[0]

    def _values(self, x: Array, fixed: Array) -> Values:
        return self._free.unpack(x) | self._fixed.unpack(fixed)


def _key(x: Array, fixed: Array) -> bytes:
    return x.tobytes() + fixed.tobytes()


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

    def matrix(self, entries: Array) -> csc_array:
        """The matrix with these entries."""
        return csc_array((entries, self.rows, self._starts), shape=self.shape)
