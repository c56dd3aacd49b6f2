"""An expression in named blocks and points, as a graph of flat vectors of numbers.

This is the second way to a problem's numbers, beside `chain`: for users, exact Hessians and tests,
which hold that both agree to 1e-11.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array, Index
from workbench.blocks import Layout, NumericPoints, Points, PointsAt, in_blocks
from workbench.problem.storage import Stored, is_sparse

# CasADi 3.8 loses the derivative of `row + scalar` by the scalar when it takes a Jacobian of more
# columns than rows backwards: all but the first entry come out zero
FORWARD = {"helper_options": {"ad_weight": 0.0}}
RANDOM_SUMS = 3  # of a row's terms with random weights: in a single one they may cancel


@dataclass(frozen=True, eq=False)
class Graph:
    """The residual in the symbols of flat free and fixed numbers, and of points."""

    x: cs.MX  # (n, 1) the free numbers
    fixed: cs.MX  # (h, 1) the fixed numbers
    points: tuple[cs.MX, ...]  # placeholders of points, (3, N) each
    residual: cs.MX  # (m, 1) whitened

    @staticmethod
    def of(expression: cs.MX, free: Layout, fixed: Layout, points: Sequence[cs.MX] = ()) -> "Graph":
        """The graph of an expression in the blocks of both layouts and in placeholders of points.

        A block that is free in part stands in both: whole among the fixed ones, where the free
        numbers take the places of some.
        """
        x, fixed_numbers = cs.MX.sym("x", free.size), cs.MX.sym("fixed", fixed.size)
        values = dict(zip(fixed.blocks, fixed.pieces(fixed_numbers), strict=True))
        for block, piece in zip(free.blocks, free.pieces(x), strict=True):
            if block.whole is None:
                values[block] = piece
            else:
                values[block.whole][list(block.places)] = cs.vec(piece)
        symbols = [*(block.symbol for block in values), *points]
        pieces = list(values.values())
        named = cs.Function("named", symbols, [expression])
        (r,) = named.call([*pieces, *points], True, False)  # inlined: seeds stay sparse
        return Graph(x, fixed_numbers, tuple(points), r)

    @cached_property
    def function(self) -> cs.Function:
        """(x, fixed) -> r, the residual (m, 1)."""
        return self._function("residual", {"r": self.residual})

    @cached_property
    def derivative(self) -> cs.Function:
        """(x, fixed) -> r, J: J (m, n) as sparse as its structure."""
        J = cs.jacobian(self.residual, self.x, FORWARD)
        return self._function("derivative", {"r": self.residual, "J": J})

    @cached_property
    def adjoint(self) -> cs.Function:
        """(x, fixed) -> cost, gradient: one reverse sweep, no Jacobian."""
        cost = 0.5 * cs.sumsqr(self.residual)
        return self._function("adjoint", {"cost": cost, "gradient": cs.gradient(cost, self.x)})

    @cached_property
    def hessian(self) -> cs.Function:
        """(x, fixed) -> H: the exact Hessian of the cost, (n, n)."""
        return self._function(
            "hessian", {"H": cs.hessian(0.5 * cs.sumsqr(self.residual), self.x)[0]}
        )

    def _function(self, name: str, outputs: Mapping[str, cs.MX]) -> cs.Function:
        arguments = [self.x, self.fixed, *self.points]
        names = ["x", "fixed", *(f"points{i}" for i, _ in enumerate(self.points))]
        return cs.Function(name, arguments, [*outputs.values()], names, [*outputs])


def stored(matrix: cs.DM) -> Stored:
    """The matrix as an array or by its nonzeros, by the rule of `storage.is_sparse`."""
    m, n = matrix.shape
    if not is_sparse(m, n, matrix.nnz()):
        return np.asarray(matrix)
    rows, starts = matrix.sparsity().row(), matrix.sparsity().colind()
    return csc_array((np.array(matrix.nonzeros()), rows, starts), shape=matrix.shape)


def split(
    expression: cs.MX, points: Sequence[Points], free: Layout, fixed: Layout
) -> tuple[Graph, tuple[NumericPoints, ...]]:
    """An expression as a graph of those points for which there is arithmetic, and the arithmetic.

    The other points become part of the graph.
    """
    arithmetic = [(p, p.source.numeric) for p in points]
    without_arithmetic = [p for p, numeric in arithmetic if numeric is None]
    placeholders = [p.symbol for p, numeric in arithmetic if numeric is not None]
    graph = Graph.of(in_blocks(expression, without_arithmetic), free, fixed, placeholders)
    sources = (by_free_entries(numeric, free) for _, numeric in arithmetic if numeric is not None)
    return graph, tuple(sources)


def term_sizes(r: cs.MX, arguments: Sequence[cs.MX]) -> cs.MX:
    """The size of the terms of each row of r (m, 1): sqrt(sum of (dr/da_i a_i)^2), estimated.

    Among the a_i are the constants that are added in r. The mean size of a few sums with normally
    distributed weights estimates it without the single derivatives (Hutchinson, A stochastic
    estimator of the trace of the influence matrix, 1990).
    """
    named, symbol, constants = _constants_named(r, arguments)
    rng = np.random.default_rng(0)  # always the same weights
    sums = cs.MX(r.shape[0], RANDOM_SUMS)
    all_arguments = [*arguments, symbol]
    for a in all_arguments:
        if a.numel():
            weights = rng.standard_normal((a.shape[0], RANDOM_SUMS * a.shape[1]))
            sums += cs.jtimes(named, a, cs.DM(weights) * cs.repmat(a, 1, RANDOM_SUMS))
    mean = cs.densify(cs.sum2(cs.fabs(sums)) / np.sqrt(RANDOM_SUMS))
    size = cs.Function("size", all_arguments, [mean])
    (estimate,) = size.call([*arguments, cs.MX(constants)], True, False)
    return estimate


def _constants_named(r: cs.MX, symbols: Sequence[cs.MX]) -> tuple[cs.MX, cs.MX, cs.DM]:
    """r with a symbol in the place of the constants that are added in it, and their values."""
    whole, nodes = cs.Function("whole", [*symbols], [r]), []
    constants: dict[int, cs.MX] = {}  # by the place in memory where they are
    for k in range(whole.n_instructions()):
        kind = whole.instruction_id(k)
        if kind in (cs.OP_ADD, cs.OP_SUB):
            nodes += [constants[i] for i in whole.instruction_input(k) if i in constants]
        for i in whole.instruction_output(k):
            constants.pop(i, None)
        if kind == cs.OP_CONST and (node := whole.instruction_MX(k)).is_dense():
            constants[whole.instruction_output(k)[0]] = node
    if not nodes:
        return r, cs.MX.sym("constants", 0), cs.DM(0, 1)
    values = cs.densify(cs.evalf(cs.veccat(*nodes)))
    symbol = cs.MX.sym("constants", values.numel())
    ends = np.cumsum([0, *(node.numel() for node in nodes)]).tolist()
    pieces = zip(cs.vertsplit(symbol, ends), nodes, strict=True)
    (named,) = cs.graph_substitute([r], nodes, [cs.reshape(p, *node.shape) for p, node in pieces])
    return named, symbol, values


def by_free_entries(source: NumericPoints, free: Layout) -> NumericPoints:
    """The source, with derivatives only by the free entries of its blocks."""
    blocks = (block for block in free.parts if block.name in source.reads)
    places = {block.name: np.array(block.places) for block in blocks}
    if not places:
        return source
    return source.only(places) or _RestrictedPoints(source, places)


@dataclass(frozen=True, eq=False)
class _RestrictedPoints(NumericPoints):
    """Points whose derivatives by some blocks are taken by the entries at `places` alone."""

    source: NumericPoints
    places: Mapping[str, Index]

    @property
    def reads(self) -> tuple[str, ...]:
        return self.source.reads

    def evaluate_batch(self, values: Mapping[str, Array]) -> Array:
        return self.source.evaluate_batch(values)

    def pattern(self, name: str) -> csc_array | None:
        pattern = self.source.pattern(name)
        return None if pattern is None else self.columns(pattern, name)

    def columns(self, matrix: csc_array, name: str) -> csc_array:
        """The columns (3 N, k) of the free entries in a derivative by a whole block."""
        return csc_array(matrix[:, self.places[name]]) if name in self.places else matrix

    def nonzeros(self, name: str) -> int | None:
        return self.source.nonzeros(name)

    def evaluate(self, values: Mapping[str, Array]) -> "_RestrictedPointsAt":
        return _RestrictedPointsAt(self, self.source.evaluate(values), values)


@dataclass(frozen=True, eq=False)
class _RestrictedPointsAt(PointsAt):
    of: _RestrictedPoints
    here: PointsAt
    values: Mapping[str, Array]

    @property
    def points(self) -> Array:
        return self.here.points

    def write_jacobian(self, into: Mapping[str, Array], scale: Array | None) -> None:
        of_blocks = {
            name: np.zeros((np.size(self.values[name]), array.shape[1]))
            if name in self.of.places
            else array
            for name, array in into.items()
        }
        self.here.write_jacobian(of_blocks, scale)
        for name in into.keys() & self.of.places.keys():
            into[name][...] = of_blocks[name][self.of.places[name]]

    def jacobian(self, name: str) -> csc_array:
        return self.of.columns(self.here.jacobian(name), name)

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        places = self.of.places
        products = self.here.vjp(cotangent)
        return {name: g[places[name]] if name in places else g for name, g in products.items()}
