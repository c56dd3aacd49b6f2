"""A problem's cost at many points at once, and its gradient where the graph is short.

Where the whole graph is short, it is evaluated in scalar instructions with all that does not vary
folded into constants, by CasADi or compiled. Where it is long, as for the vertices of a mesh, the
points of bodies come from matrix products over all the values at once, and the residual is a graph.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import casadi as cs
import numpy as np
from scipy.linalg import block_diag

from workbench.arrays import Array, Index
from workbench.blocks import Layout, Points, in_blocks
from workbench.blocks.functions import Batched, Mapped, scalar
from workbench.blocks.layout import all_values
from workbench.blocks.points import distinct
from workbench.blocks.simd import ConstantProduct, simd_function
from workbench.compiling import NoLibrary
from workbench.errors import NotSupported
from workbench.problem.graph import Graph, split
from workbench.residuals import Residual

T = TypeVar("T")
Places = Index
Costs = Callable[[Array], Array]  # z (M, k) -> (M,)
CostGradient = Callable[[Array], tuple[float, Array]]  # x (n,) -> cost, (n,)
CostGradients = Callable[[Array], tuple[Array, Array]]  # z (M, k) -> (M,), (M, k)
COMPILED_UP_TO = 80_000  # of those that vary: half a minute of the compiler's
INTERPRETED_UP_TO = 2_000  # of them: of more, points from matrix products are faster
EXPANDED_UP_TO = 100_000  # of the whole graph
DIGITS = 15  # after the point, by which rows of a constant matrix are alike
LEAST_NONZEROS = 200  # from which on a constant matrix is taken out
SHARED = False, True  # of (z, what z does not change): the second is the same for all rows


@dataclass(frozen=True, eq=False)
class Domain:
    """The domains of the points of those residuals that have one; see `Residual.domain`."""

    residuals: tuple[Residual, ...]
    free: Layout
    fixed: Layout

    def beside(self, whitened: cs.MX) -> cs.MX:
        """A column of whitened residuals with one row more: 0 in the domain, infinite elsewhere.

        The cost of the column is therefore infinite outside of the domain; inside it has the same
        bits as without that row, and the same derivatives.
        """
        outside = cs.mmin(self._counted) < 0
        return cs.vertcat(whitened, cs.if_else(outside, np.inf, 0.0))

    def outside_in_words(self, x: Array, fixed: Array) -> str:
        """The first point that is outside of its domain at x (n,), in words; "" if none is."""
        domains = np.asarray(self._evaluated(x, fixed)).ravel()
        first = 0
        for residual in self.residuals:
            d = residual.rows_per_point
            count = residual.size // d
            outside = np.flatnonzero(domains[first : first + count] < 0)
            if outside.size:
                point = int(outside[0])
                return (
                    f"{residual.label(d * point)} means nothing there, because its domain is "
                    f"{domains[first + point]:.3g}, below zero (as of a keypoint behind its camera)"
                )
            first += count
        return ""

    @cached_property
    def _counted(self) -> cs.MX:
        """The domain of each point times its weight, the sum of those of its rows, (p, 1)."""
        each = []
        for residual in self.residuals:
            weights = residual.weights
            if weights is None:
                each.append(residual.domain)
                continue
            if not isinstance(weights, cs.MX):
                weights = cs.DM(np.asarray(weights, dtype=float))
            d = residual.rows_per_point
            if d > 1 and weights.numel() == residual.size:
                weights = cs.sum1(cs.reshape(weights, d, residual.size // d)).T
            each.append(weights * residual.domain)
        return cs.vertcat(*each)

    def _evaluated(self, x: Array, fixed: Array) -> cs.DM:
        placeholders = distinct(p for residual in self.residuals for p in residual.points)
        graph, sources = split(self._counted, placeholders, self.free, self.fixed)
        values = all_values(self.free, x, self.fixed, fixed)
        points = [source.evaluate(values).points.T for source in sources]
        f = cs.Function("domain", [graph.x, graph.fixed, *graph.points], [graph.residual])
        return f(x, fixed, *points)


class CostGraph:
    """Whitened residuals as one graph, and as a graph of points that come from arithmetic.

    `whole` is the graph in flat numbers, None where there is none. With a domain, one more row says
    by 0 or infinity whether all is in it (`limited`).
    """

    def __init__(
        self,
        whitened: cs.MX,
        points: Sequence[Points],
        free: Layout,
        fixed: Layout,
        whole: Graph | None,
        domain: Domain | None,
    ) -> None:
        self.limited = domain is not None
        if domain is not None:
            whitened = domain.beside(whitened)
            whole = whole and Graph.of(in_blocks(whitened, points), free, fixed)
        self.whole, self.free, self.fixed = whole, free, fixed
        self.split, self.sources = split(whitened, points, free, fixed)
        self.made: dict[tuple[str, bytes], Any] = {}  # derived or compiled, by the places that vary

    def once(self, what: str, places: Places, make: Callable[[], T]) -> T:
        """The result of `make`, which is called once for these places and is kept in `made`."""
        key = what, places.tobytes()
        if key not in self.made:
            self.made[key] = make()
        kept: T = self.made[key]
        return kept


CostMethod = Callable[[CostGraph, Array, Array, Places], Costs]


@dataclass(frozen=True, eq=False)
class FoldedCost:
    """The cost 0.5 |r|^2 as a function of the numbers z (k,) that vary."""

    still: cs.Function  # (x, fixed) to what the cost takes beside z, which z does not change
    cost: cs.Function  # (z, still) to the cost, or (z, still, w, y) where `before` has made w and y
    before: ConstantProduct | None  # the product with a constant matrix, where there is one

    def numbers(self, x: Array, fixed: Array) -> Array:
        """What z does not change, flat."""
        return np.asarray(self.still(np.concatenate([x, fixed]))).ravel()

    @property
    def instructions(self) -> int:
        """The scalar instructions of all parts that vary."""
        more = 0 if self.before is None else self.before.function.n_instructions()
        return int(self.cost.n_instructions() + more)


def interpreted(batch: CostGraph, x: Array, fixed: Array, places: Places) -> Costs:
    """A function of z to costs that CasADi and NumPy evaluate, without a compiler.

    Points come from arithmetic for all rows at once, where there is some and the whole graph is
    not short.
    """
    folded = batch.once("folded", places, lambda: folded_cost(batch.whole, places))
    if folded is not None and (not batch.sources or folded.instructions <= INTERPRETED_UP_TO):
        return _called(Mapped(folded.cost, SHARED), folded, x, fixed)
    graph = batch.split
    cost = 0.5 * cs.sumsqr(cs.densify(graph.residual))
    run = Mapped(
        cs.Function("cost", [graph.x, graph.fixed, *graph.points], [cost]),
        (False, True, *(False for _ in graph.points)),
    )

    def costs(z: Array) -> Array:
        X = _points_at(x, places, z)
        values = _values(batch, X, fixed)
        points = (source.evaluate_batch(values).reshape(len(z), -1) for source in batch.sources)
        return run(X, fixed, *points)[0][:, 0]

    return costs


def compiled(batch: CostGraph, x: Array, fixed: Array, places: Places) -> Costs:
    """A function of z to costs that is compiled, where that is possible and worth it."""
    graph = batch.once("products", places, lambda: folded_cost(batch.whole, places, True))
    if graph is None or graph.instructions > COMPILED_UP_TO:
        return interpreted(batch, x, fixed, places)

    def make() -> Batched:
        return simd_function(graph.cost, SHARED, graph.before)

    try:
        run = batch.once("compiled", places, make)
    except (NoLibrary, NotSupported):
        return interpreted(batch, x, fixed, places)
    return _called(run, graph, x, fixed)


def cost_gradients(
    batch: CostGraph, x: Array, fixed: Array, places: Places, one_by_one: CostGradient
) -> CostGradients:
    """Costs and their gradients by z, compiled where that works.

    Where the graph is too long, `one_by_one` is asked for the cost and its gradient (n,) at each x.
    """
    graph = batch.once("folded", places, lambda: folded_cost(batch.whole, places))
    if graph is None or graph.instructions > COMPILED_UP_TO:
        costs = interpreted(batch, x, fixed, places) if batch.limited else None

        def each(z: Array) -> tuple[Array, Array]:
            X = _points_at(x, places, z)
            pairs = [one_by_one(row) for row in X]
            cost = np.array([cost for cost, _ in pairs])
            if costs is not None:
                cost[np.isinf(costs(z))] = np.inf
            return cost, np.array([g[places] for _, g in pairs])

        return each
    run = batch.once("cost_gradients", places, lambda: _derived(graph.cost))
    numbers = graph.numbers(x, fixed)

    def together(z: Array) -> tuple[Array, Array]:
        cost, gradient = run(z, numbers)
        return cost[:, 0], gradient

    return together


def _derived(cost: cs.Function) -> Batched:
    z, still = (cs.SX.sym(name, cost.nnz_in(i)) for i, name in enumerate(("z", "still")))
    c = cost(z, still)
    both = cs.Function("slope", [z, still], [c, cs.densify(cs.gradient(c, z))])
    try:
        return simd_function(both, SHARED)
    except (NoLibrary, NotSupported):
        return Mapped(both, SHARED)


def _called(run: Batched, graph: FoldedCost, x: Array, fixed: Array) -> Costs:
    numbers = graph.numbers(x, fixed)
    return lambda z: run(z, numbers)[0][:, 0]


def _points_at(x: Array, places: Places, z: Array) -> Array:
    """Copies (M, n) of x with z (M, k) in these places."""
    X = np.repeat(x[None], len(z), axis=0)
    X[:, places] = z
    return X


def _values(batch: CostGraph, X: Array, fixed: Array) -> Mapping[str, Array]:
    M = len(X)
    values = {
        name: np.broadcast_to(value, (M, *value.shape))
        for name, value in batch.fixed.unpack(fixed).items()
    }
    for block in batch.free.blocks:
        numbers = X[:, batch.free.slices[block.name]]
        if block.whole is None:
            values[block.name] = numbers.reshape(M, *block.shape)
        else:
            whole = np.array(values[block.name])
            whole.reshape(M, -1)[:, list(block.places)] = numbers
            values[block.name] = whole
    return values


def folded_cost(graph: Graph | None, places: Places, products: bool = False) -> FoldedCost | None:
    """The cost of a graph by z, which stands at these places of x; None for too long a graph.

    With `products`, large constant matrices are taken out, as far as z changes what they multiply.
    """
    if graph is None:
        return None
    cost = 0.5 * cs.sumsqr(cs.densify(graph.residual))
    inner, rest = _taken_out(cost, [graph.x, graph.fixed]) if products else ([], cost)
    arguments = [graph.x, graph.fixed, *(product.result for product in inner)]
    operands = cs.vertcat(cs.MX(0, 1), *(product.operand for product in inner))
    f = scalar(cs.Function("cost", arguments, [rest, operands]), EXPANDED_UP_TO)
    if f is None:
        return None
    z, x = cs.SX.sym("z", len(places)), cs.SX.sym("x", graph.x.numel())
    fixed, x_with_z = cs.SX.sym("fixed", graph.fixed.numel()), cs.SX(x)
    x_with_z[places.tolist()] = z
    # the entries of operands that z changes, and the rows of results that these change
    zeros = [cs.SX(product.result.numel(), 1) for product in inner]
    u = f(x_with_z, fixed, *zeros)[1]
    matrix = block_diag(*(product.matrix for product in inner)) if inner else np.zeros((0, 0))
    varies = np.array(cs.which_depends(u, z, 1, True), dtype=bool) if inner else np.zeros(0, bool)
    if np.count_nonzero(matrix[:, varies]) < LEAST_NONZEROS:
        varies[:] = False
    changing = matrix[:, varies].any(axis=1)
    # the results: what z changes is made of y, which is computed apart, and all else is folded
    rows, sign, stands_for = _distinct_rows(matrix[np.ix_(changing, varies)])
    y = cs.SX.sym("y", len(rows))
    shift = np.concatenate([np.zeros(0), *(product.shift for product in inner)])
    same = np.flatnonzero(~varies).tolist()
    results = cs.DM(shift) + cs.sparsify(cs.DM(matrix[:, ~varies])) @ u[same]
    results[np.flatnonzero(changing).tolist()] += cs.DM(sign) * y[stands_for.tolist()]
    edges = np.cumsum([0, *(product.result.numel() for product in inner)]).tolist()
    c = f(x_with_z, fixed, *(results[a:b] for a, b in pairwise(edges)))[0]
    # what depends on x and the fixed numbers alone is a symbol in the rest
    parts = cs.cse(cs.vertcat(c, u[np.flatnonzero(varies).tolist()]))
    symbols, constants, parts = _extracted(parts, cs.vertcat(x, fixed), trivial=True)
    still = cs.Function("still", [cs.vertcat(x, fixed)], [constants])
    if not varies.any():
        return FoldedCost(still, cs.Function("cost", [z, symbols], [cs.densify(parts)]), None)
    w, needs_no_y, last = _extracted(parts[0], cs.vertcat(z, symbols))
    return FoldedCost(
        still,
        cs.Function("cost", [z, symbols, w, y], [cs.densify(last)]),
        ConstantProduct(
            cs.Function("before", [z, symbols], [cs.densify(parts[1:]), needs_no_y]),
            rows,
        ),
    )


def _distinct_rows(matrix: Array) -> tuple[Array, Array, Index]:
    """The rows without repetition, the sign of each row, and which of the distinct ones it is.

    The halves of a symmetric body have the same rows, up to a sign and rounding.
    """
    sign = np.where(matrix.sum(axis=1) < 0, -1.0, 1.0)
    alike = np.round(sign[:, None] * matrix, DIGITS)
    _, first, stands_for = np.unique(alike, axis=0, return_index=True, return_inverse=True)
    return sign[first, None] * matrix[first], sign, stands_for.ravel()


def _extracted(parts: cs.SX, of: cs.SX, trivial: bool = False) -> tuple[cs.SX, cs.SX, cs.SX]:
    """Symbols for what depends on `of` alone, what they stand for, and the parts in these symbols.

    With `trivial`, entries of `of` that stand alone get symbols too.
    """
    rest, symbols, meanings = cs.extract_parametric(parts, of, {"extract_trivial": trivial})
    column = cs.SX(0, 1)
    return cs.vertcat(column, *symbols), cs.densify(cs.vertcat(column, *meanings)), rest


class _InnerProduct(NamedTuple):
    """A product y = A u + b that stands in a graph."""

    matrix: Array  # A (m, n)
    shift: Array  # b (m,)
    operand: cs.MX  # u (n, 1)
    result: cs.MX  # (m, 1), the symbol that stands for y in what is left of the graph


def _taken_out(expression: cs.MX, inputs: Sequence[cs.MX]) -> tuple[list[_InnerProduct], cs.MX]:
    """The products with constant matrices in an expression, and what is left in their results.

    A product with fewer than LEAST_NONZEROS elements stays where it is, and so does one whose
    operand needs another product.
    """
    f = cs.Function("f", list(inputs), [expression])
    nodes: list[cs.MX] = []
    products: list[_InnerProduct] = []
    for k in range(f.n_instructions()):
        if f.instruction_id(k) == cs.OP_MTIMES:
            node = f.instruction_MX(k)
            shift, matrix, operand = (node.dep(i) for i in range(3))
            if matrix.is_constant() and shift.is_constant() and operand.shape[1] == 1:
                A = np.array(cs.evalf(matrix))
                if np.count_nonzero(A) >= LEAST_NONZEROS:
                    b = np.array(cs.evalf(shift)).ravel()
                    y = cs.MX.sym(f"y{len(nodes)}", len(A))
                    nodes.append(node)
                    products.append(_InnerProduct(A, b, cs.densify(operand), y))
    if not nodes:
        return [], expression
    results = [product.result for product in products]
    operands = cs.graph_substitute([product.operand for product in products], nodes, results)
    free = [k for k, u in enumerate(operands) if not cs.depends_on(u, cs.vertcat(*results))]
    (rest,) = cs.graph_substitute(
        [expression], [nodes[k] for k in free], [products[k].result for k in free]
    )
    return [products[k] for k in free], rest
