"""An expression in named blocks and points, as a graph of flat vectors of numbers.

This is the second way to a problem's numbers, beside `chain`: for users, exact Hessians and tests,
which hold that both agree to 1e-11. Graphs of whole meshes are MX with the kinematics inlined; they
are not expanded to scalars, and are differentiated in forward mode.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array
from workbench.blocks import Layout, NumericPoints, Points, in_blocks
from workbench.problem.partial import by_free_entries
from workbench.problem.storage import Stored, is_sparse

# CasADi 3.8 loses the derivative of `row + scalar` by the scalar when it takes a Jacobian of more
# columns than rows backwards: all but the first entry come out zero
FORWARD = {"helper_options": {"ad_weight": 0.0}}
SUMS = 3  # sums of a row's terms with random weights: in a single one they may cancel
FEW = 64  # rows, of which CasADi finds in one sweep which entries they read


@dataclass(frozen=True, eq=False)
class Graph:
    """The residual in the symbols of flat free and fixed numbers, and of points.

    Attributes:
        x: (n, 1) the free numbers.
        fixed: (h, 1) the fixed numbers.
        points: placeholders of points, (3, N) each.
        residual: (m, 1) whitened.
    """

    x: cs.MX
    fixed: cs.MX
    points: tuple[cs.MX, ...]
    residual: cs.MX

    @staticmethod
    def of(expression: cs.MX, free: Layout, fixed: Layout, points: Sequence[cs.MX] = ()) -> "Graph":
        """The graph of an expression in the blocks of both layouts and in placeholders of points.

        A block that is free in part stands in both: whole among the fixed ones, where the free
        numbers take the places of some.
        """
        x, given = cs.MX.sym("x", free.size), cs.MX.sym("fixed", fixed.size)
        values = dict(zip(fixed.blocks, fixed.pieces(given), strict=True))
        for block, piece in zip(free.blocks, free.pieces(x), strict=True):
            if block.whole is None:
                values[block] = piece
            else:
                values[block.whole][list(block.places)] = cs.vec(piece)
        symbols = [*(block.symbol for block in values), *points]
        pieces = list(values.values())
        named = cs.Function("named", symbols, [expression])
        (r,) = named.call([*pieces, *points], True, False)  # inlined: seeds stay sparse
        return Graph(x, given, tuple(points), r)

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
        given = [self.x, self.fixed, *self.points]
        names = ["x", "fixed", *(f"points{i}" for i, _ in enumerate(self.points))]
        return cs.Function(name, given, [*outputs.values()], names, [*outputs])


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
    quick = [(p, p.source.numeric) for p in points]
    by_graph = [p for p, found in quick if found is None]
    placeholders = [p.symbol for p, found in quick if found is not None]
    graph = Graph.of(in_blocks(expression, by_graph), free, fixed, placeholders)
    numeric = (by_free_entries(found, free) for _, found in quick if found is not None)
    return graph, tuple(numeric)


def size_of_terms(r: cs.MX, arguments: Sequence[cs.MX]) -> cs.MX:
    """The size of the terms of each row of r (m, 1): sqrt(sum of (dr/da_i a_i)^2), estimated.

    Among the a_i are the constants that are added in r. Terms that cancel each other in the
    residual must not cancel here. The mean of the squares of a
    few sums with normally distributed weights estimates this size, without the single derivatives
    (Hutchinson, A stochastic estimator of the trace of the influence matrix, 1990).
    """
    squares = [_squares(r, a, arguments) for a in arguments if a.numel()]
    squares += _squares_of_constants(r, arguments)
    return cs.densify(cs.sqrt(sum(squares)) if squares else cs.MX(*r.shape))


def _squares(r: cs.MX, argument: cs.MX, symbols: Sequence[cs.MX]) -> cs.MX:
    """The sum over `SUMS` sums of their terms with one argument, squared, for each row, (m, 1)."""
    rows, columns = argument.shape
    weights = np.random.default_rng(0).standard_normal((rows, SUMS * columns))  # always the same
    once = cs.jtimes(r, argument, cs.DM.ones(rows, columns))
    if r.numel() and not cs.depends_on(once, cs.veccat(*symbols)):
        few = np.linspace(0, r.numel() - 1, FEW, dtype=int).tolist()
        places = _single(r[few], argument) and _single(r, argument)  # dense rows take long
        if places is not None:
            factor = cs.Function("factor", [*symbols], [cs.densify(once)])  # at any place
            numbers = factor.call([cs.DM.zeros(a.shape) for a in symbols])[0]
            lengths = np.sqrt((weights.reshape(rows, SUMS, columns) ** 2).sum(axis=1))
            return _of_single_terms(numbers, argument, places, lengths.ravel(order="F"))
    weighed = cs.DM(weights) * cs.repmat(argument, 1, SUMS)
    return cs.sum2(cs.jtimes(r, argument, weighed) ** 2)


def _squares_of_constants(r: cs.MX, symbols: Sequence[cs.MX]) -> list[cs.MX]:
    """The squared terms of the constants that are added in r, (m, 1); none if there are none."""
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
        return []
    values = cs.densify(cs.evalf(cs.veccat(*nodes)))
    argument = cs.MX.sym("constants", values.numel())
    ends = np.cumsum([0, *(node.numel() for node in nodes)]).tolist()
    pieces = zip(cs.vertsplit(argument, ends), nodes, strict=True)
    (named,) = cs.graph_substitute([r], nodes, [cs.reshape(p, *node.shape) for p, node in pieces])
    every = [*symbols, argument]
    squares = cs.Function("squares", every, [_squares(named, argument, every)])
    by_values: list[cs.MX] = squares.call([*symbols, cs.MX(values)], True, False)
    return by_values


def _single(r: cs.MX, argument: cs.MX) -> cs.Sparsity | None:
    """Where the rows read the argument, if none of them reads more than one entry."""
    places = cs.jacobian_sparsity(r, argument)
    return places if len(set(places.row())) == places.nnz() else None


def _of_single_terms(factor: cs.DM, argument: cs.MX, places: cs.Sparsity, weights: Array) -> cs.MX:
    """The squared terms of rows that read one entry of the argument each, times a constant factor.

    So a vertex is read, and the observed one beside it. All sums of such a row have a single term,
    which is multiplied by the length of its `weights` (of each entry) and squared once.
    """
    row, entry = np.array(places.row(), dtype=int), np.array(places.get_col(), dtype=int)
    order = np.argsort(row)
    row, entry = row[order], entry[order]
    by = np.asarray(factor).ravel()[row] * weights[entry]
    numbers = cs.vec(argument)
    if not np.array_equal(entry, np.arange(argument.numel())):
        numbers = cs.vec(numbers[entry.tolist()])  # of a single number they stand in a row
    read = cs.Sparsity.triplet(factor.numel(), 1, row.tolist(), [0] * len(row))
    return cs.MX(read, (cs.DM(by) * numbers) ** 2)
