"""A problem's cost at many points at once, and its gradient where the graph is short.

Two ways to the same numbers. Where the whole graph is short, it is evaluated in scalar
instructions, by CasADi's machine with all that does not vary folded into constants, or compiled,
several points to an instruction. Where it is long, as for the vertices of a mesh, the points of
bodies come from matrix products over all the values at once and only the residual is a graph.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, TypeVar

import casadi as cs
import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Layout, NumericPoints, Points, in_blocks
from workbench.blocks.batched import LONGEST, Batched, Buffered, Mapped, OneByOne, scalar
from workbench.blocks.columns import MANY, Columns, FewOrMany
from workbench.blocks.products import taken_out
from workbench.blocks.simd import simd_function
from workbench.blocks.threaded import Threaded
from workbench.compiling import NoLibrary
from workbench.errors import NotSupported
from workbench.problem.domain import Domain
from workbench.problem.graph import Graph, split
from workbench.problem.parted import Parted, parted

T = TypeVar("T")
Places = Index
Costs = Callable[[Array], Array]  # z (M, k) -> (M,)
Slope = Callable[[Array], tuple[float, Array]]  # x (n,) -> cost, (n,)
Slopes = Callable[[Array], tuple[Array, Array]]  # z (M, k) -> (M,), (M, k)
COMPILED_UP_TO = 80_000  # of those that vary: half a minute of the compiler's
INTERPRETED_UP_TO = 2_000  # of them: of more, matrix products are faster if points are few
TOGETHER_UP_TO = 20_000  # of them, without constant matrices: of more, also if points are many
SHARED = False, True  # of (z, what z does not change): the second is the same for all rows


@dataclass(frozen=True, eq=False)
class Batch:
    """A residual as one graph, and as a graph of points that come from arithmetic.

    Attributes:
        whole: the residual as one graph; None where only arithmetic has the points of a source.
        split: the residual as a graph of points that come from arithmetic.
        sources: the arithmetic for the points of the split graph.
        free: the layout of the free numbers.
        fixed: the layout of the fixed numbers.
        limited: whether the last row says by 0 or infinity if all is in its domain.
        made: what was derived or compiled already, by the places that vary.
    """

    whole: Graph | None
    split: Graph
    sources: Sequence[NumericPoints]
    free: Layout
    fixed: Layout
    limited: bool = False
    made: dict[tuple[str, bytes], Any] = field(default_factory=dict, repr=False)

    @staticmethod
    def of(
        whitened: cs.MX,
        points: Sequence[Points],
        free: Layout,
        fixed: Layout,
        graph: Graph | None,
        domain: Domain | None,
    ) -> "Batch":
        """The batch of whitened residuals, of which `graph` is the graph if there is one."""
        if domain is None:
            return Batch(graph, *split(whitened, points, free, fixed), free, fixed)
        limited = domain.beside(whitened)
        whole = None if graph is None else Graph.of(in_blocks(limited, points), free, fixed)
        return Batch(whole, *split(limited, points, free, fixed), free, fixed, limited=True)

    def once(self, what: str, places: Places, make: Callable[[], T]) -> T:
        """The result of `make`, which is called once for these places and is kept in `made`."""
        key = what, places.tobytes()
        if key not in self.made:
            self.made[key] = make()
        found: T = self.made[key]
        return found


Evaluation = Callable[[Batch, Array, Array, Places], Costs]


def interpreted(batch: Batch, x: Array, fixed: Array, places: Places) -> Costs:
    """A function of z to costs that CasADi or NumPy evaluates, without a compiler.

    The number of rows decides how, so that the costs of some are the same on any number of cores.
    """
    plain = batch.once("parted", places, lambda: _parted(batch, places))
    if plain is not None and (not batch.sources or plain.instructions <= INTERPRETED_UP_TO):
        return _called(FewOrMany(plain.cost, SHARED), plain, x, fixed)
    few = _arithmetic(batch, x, fixed, places)

    @cache
    def many() -> Costs:
        """Made when many rows are first asked for: it takes about a second."""
        graph = batch.once("products", places, lambda: _parted(batch, places, products=True))
        if graph is None or graph.instructions > TOGETHER_UP_TO:
            return few
        try:
            run = batch.once("columns", places, lambda: Columns(graph.cost, SHARED, graph.before))
        except NotSupported:
            return few
        return _called(run, graph, x, fixed)

    return lambda z: (many() if len(z) >= MANY else few)(z)


def compiled(batch: Batch, x: Array, fixed: Array, places: Places) -> Costs:
    """A function of z to costs that is compiled, where that is possible and worth it."""
    graph = batch.once("products", places, lambda: _parted(batch, places, products=True))
    if graph is None or graph.instructions > COMPILED_UP_TO:
        return interpreted(batch, x, fixed, places)

    def make() -> Batched:
        return simd_function(graph.cost, SHARED, graph.before)

    try:
        run = batch.once("compiled", places, make)
    except (NoLibrary, NotSupported):
        return interpreted(batch, x, fixed, places)
    return _called(run, graph, x, fixed)


def slopes(batch: Batch, x: Array, fixed: Array, places: Places, one_by_one: Slope) -> Slopes:
    """Costs and their gradients by z, compiled where that works.

    Where the graph is too long, `one_by_one` is asked for the cost and its gradient (n,) at each x.
    """
    graph = batch.once("parted", places, lambda: _parted(batch, places))
    if graph is None or graph.instructions > COMPILED_UP_TO:
        costs = interpreted(batch, x, fixed, places) if batch.limited else None

        def each(z: Array) -> tuple[Array, Array]:
            X = _filled(x, places, z)
            found = [one_by_one(row) for row in X]
            cost = np.array([cost for cost, _ in found])
            if costs is not None:
                cost[np.isinf(costs(z))] = np.inf
            return cost, np.array([g[places] for _, g in found])

        return each
    run = batch.once("slopes", places, lambda: _derived(graph.cost))
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


def _called(run: Batched, graph: Parted, x: Array, fixed: Array) -> Costs:
    numbers = graph.numbers(x, fixed)
    return lambda z: run(z, numbers)[0][:, 0]


def _parted(batch: Batch, places: Places, products: bool = False) -> Parted | None:
    """The cost by what varies; None if there are too many instructions, or no such graph."""
    if batch.whole is None:
        return None
    return parted(batch.whole, places, products)


def _arithmetic(batch: Batch, x: Array, fixed: Array, places: Places) -> Costs:
    """Costs whose points come from matrix products, and whose residual is a graph.

    Products of constant matrices with what the points have no part in, such as Gaussian priors of a
    pose, are made for all rows at once too.
    """
    graph = batch.split
    cost = 0.5 * cs.sumsqr(cs.densify(graph.residual))
    given = [graph.x, graph.fixed]
    products, left = taken_out(cost, [*given, *graph.points], operands_of=given)
    operands = [cs.Function("operand", given, [one.operand]) for one in products]
    results = [one.result for one in products]
    rest = cs.Function("cost", [*given, *graph.points, *results], [left])
    run = _many(rest, (False, True, *(False for _ in (*graph.points, *results))))
    made = [_many(one, SHARED) for one in operands]

    def costs(z: Array) -> Array:
        X = _filled(x, places, z)
        values = _values(batch, X, fixed)
        points = (source.evaluate_batch(values).reshape(len(z), -1) for source in batch.sources)
        y = (p.of(u(X, fixed)[0]) for p, u in zip(products, made, strict=True))
        return run(X, fixed, *points, *y)[0][:, 0]

    return costs


def _many(function: cs.Function, shared: tuple[bool, ...]) -> Batched:
    scalars = scalar(function, LONGEST)
    if scalars is None:
        return Threaded(lambda: OneByOne(Buffered(function), shared), shared)
    return FewOrMany(scalars, shared)


def _filled(x: Array, places: Places, z: Array) -> Array:
    """Copies (M, n) of x with z (M, k) in these places."""
    X = np.repeat(x[None], len(z), axis=0)
    X[:, places] = z
    return X


def _values(batch: Batch, X: Array, fixed: Array) -> Mapping[str, Array]:
    same, M = batch.fixed.unpack(fixed), len(X)
    values = {name: np.broadcast_to(value, (M, *value.shape)) for name, value in same.items()}
    for block in batch.free.blocks:
        numbers = X[:, batch.free.slices[block.name]]
        if block.whole is None:
            values[block.name] = numbers.reshape(M, *block.shape)
        else:
            whole = np.array(values[block.name])
            whole.reshape(M, -1)[:, list(block.places)] = numbers
            values[block.name] = whole
    return values
