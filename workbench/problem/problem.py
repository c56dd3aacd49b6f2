"""Residuals over named blocks, some of them free."""

from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from itertools import pairwise
from typing import TypeVar

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.blocks import Block, Layout, Points, PointSource, Tree, in_blocks
from workbench.blocks.checks import mapping, texts
from workbench.errors import BadResidual, DuplicateResidual, TwoSymbolsOneName, UnknownName
from workbench.problem.batch import (
    Batch,
    Costs,
    Places,
    Slopes,
    Way,
    interpreted,
    one_by_one,
    slopes,
)
from workbench.problem.bounds import Bounds, flat_bounds
from workbench.problem.chain import FORWARD, Chain, Sparse
from workbench.problem.constraint import Constraint
from workbench.problem.constraint_set import ConstraintSet
from workbench.problem.graph import Graph, lean
from workbench.problem.linearization import Linearization
from workbench.problem.naming import check_names, parts_of
from workbench.problem.optimality import optimality
from workbench.problem.rounding import Rounding, Support
from workbench.residuals import Residual
from workbench.threads import limited_threads

Array = NDArray[np.float64]
T = TypeVar("T")


class Problem:
    """Minimise 1/2 sum over residuals of |r(x, fixed) / sigma|^2 over the blocks named `free`.

    Every other block that the residuals read is fixed at the value that it is given: a
    measurement, or an unknown whose turn has not come. `free` holds names, or is one; `bounds`
    map names of free blocks to (lower, upper), numbers or arrays. Units and labels of blocks
    come with the bodies' points; `blocks` adds those of others. A problem is never changed;
    `freeing` makes another.

    Raises DuplicateResidual, TwoSymbolsOneName, UnknownName, UnreadBlock, BadBounds, NotNumbers,
    BadResidual, or BadArgument for names that are none.
    """

    def __init__(
        self,
        residuals: Iterable[Residual],
        free: str | Iterable[str],
        bounds: Bounds | None = None,
        blocks: Iterable[Block] = (),
        constraints: Iterable[Constraint] = (),
    ) -> None:
        self.residuals, self.constraints, self._named = parts_of(residuals, constraints, blocks)
        free = texts("the names of free blocks", free)
        self.bounds = dict(mapping("the bounds of a problem", {} if bounds is None else bounds))
        if not self.residuals:
            raise BadResidual("a problem needs at least one residual")
        names = [*(r.name for r in self.residuals), *(c.name for c in self.constraints)]
        for name in names:
            if names.count(name) > 1:
                raise DuplicateResidual(name)
        check_names((*free, *self.bounds), known := self._blocks, self._named)
        self.free = Layout(tuple(known[name] for name in dict.fromkeys(free)))
        self.fixed = Layout(tuple(b for name, b in known.items() if name not in free))
        self.lower, self.upper = flat_bounds(self.bounds, self.free, self.fixed)
        self.stacked_constraints = (
            ConstraintSet(self.constraints, self._constraint_graph) if self.constraints else None
        )

    def freeing(self, *names: str) -> "Problem":
        """The same residuals with these blocks free instead.

        Bounds of other blocks are dropped, and constraints that read none of these.
        """
        names = texts("the names of free blocks", names)
        bounds = {name: self.bounds[name] for name in names if name in self.bounds}
        left = [c for c in self.constraints if not set(names).isdisjoint(c.reads)]
        return Problem(self.residuals, names, bounds, self._named, left)

    def without(self, *residuals: str) -> "Problem":
        """The same but for the named residuals; what then nobody reads is no longer free."""
        for name in texts("the names of residuals", residuals):
            if name not in self.rows:
                raise UnknownName("residual", name, self.rows)
        left = [residual for residual in self.residuals if residual.name not in residuals]
        read = {name for residual in left for name in residual.reads}
        read |= {name for constraint in self.constraints for name in constraint.reads}
        free = [name for name in self.free.names if name in read]
        bounds = {name: self.bounds[name] for name in free if name in self.bounds}
        kept = [c for c in self.constraints if not set(free).isdisjoint(c.reads)]
        return Problem(left, free, bounds, self._named, kept)

    # Values in and out.

    def split(self, values: Mapping[str, ArrayLike]) -> tuple[Array, Array]:
        """The free and the fixed numbers among `values`, each as a flat vector."""
        return self.free.pack(values), self.fixed.pack(values)

    @cached_property
    def rows(self) -> dict[str, slice]:
        """Where each residual sits in the stacked vector."""
        edges = np.cumsum([0, *(r.size for r in self.residuals)]).tolist()
        return {
            r.name: slice(*edge) for r, edge in zip(self.residuals, pairwise(edges), strict=True)
        }

    @property
    def size(self) -> int:
        """m, the length of the stacked residual."""
        return sum(residual.size for residual in self.residuals)

    def row_label(self, row: int) -> str:
        """The name of one entry of the stacked residual."""
        for residual in self.residuals:
            if row < residual.size:
                return residual.label(row)
            row -= residual.size
        raise IndexError(f"row {row} of a residual of {self.size}")

    @cached_property
    def trees(self) -> tuple[Tree, ...]:
        """The kinematic trees of the bodies whose points are read, one per pose block."""
        found = {tree.pose: tree for p in self._points if (tree := p.source.tree) is not None}
        return tuple(found.values())

    @cached_property
    def bounded(self) -> bool:
        """Whether any entry has a bound."""
        return bool(np.isfinite(self.lower).any() or np.isfinite(self.upper).any())

    # The graphs.

    @cached_property
    def function(self) -> cs.Function:
        """(x, fixed) -> r: the stacked, whitened residual, (m, 1)."""
        x, fixed, r = self._graph
        return cs.Function("residual", [x, fixed], [r], ["x", "fixed"], ["r"])

    @cached_property
    def derivative(self) -> cs.Function:
        """(x, fixed) -> r, J: J (m, n) as sparse as its structure."""
        x, fixed, r = self._graph
        J = cs.jacobian(r, x, FORWARD)
        return cs.Function("derivative", [x, fixed], [r, J], ["x", "fixed"], ["r", "J"])

    @cached_property
    def adjoint(self) -> cs.Function:
        """(x, fixed) -> cost, gradient: one reverse sweep, no Jacobian."""
        x, fixed, r = self._graph
        cost = 0.5 * cs.sumsqr(r)
        both = [cost, cs.gradient(cost, x)]
        return cs.Function("adjoint", [x, fixed], both, ["x", "fixed"], ["cost", "gradient"])

    @cached_property
    def hessian(self) -> cs.Function:
        """(x, fixed) -> H: the exact Hessian of the cost, J' J + sum r_i H_i, (n, n)."""
        x, fixed, r = self._graph
        H = cs.hessian(0.5 * cs.sumsqr(r), x)[0]
        return cs.Function("hessian", [x, fixed], [H], ["x", "fixed"], ["H"])

    def prepare(self) -> None:
        """Build what the numbers below need, so that a clock that starts now does not count it."""
        _ = self._chain

    # The numbers, for flat vectors: by the chain rule, or from the graphs above.

    def residual(self, x: Array, fixed: Array) -> Array:
        """r (m,), whitened."""
        return self._chain.residual(x, fixed)

    def costs(
        self, x: Array, fixed: Array, entries: Places | None = None, by: Way = interpreted
    ) -> Costs:
        """A function of numbers z (M, k) to the costs (M,) of points that are x but for them.

        z stand in the places `entries` of x, or are all of it. `by` is `interpreted`, or
        `compiled`, which takes seconds once and is many times as fast.
        """
        places = np.arange(self.free.size) if entries is None else entries.astype(np.int64)
        return by(self._batch, x, fixed, places)

    def slopes(self, x: Array, fixed: Array, entries: Places | None = None) -> Slopes:
        """The same for costs (M,) and their gradients (M, k) by z: what NUTS wants of a problem."""
        places = np.arange(self.free.size) if entries is None else entries.astype(np.int64)
        slope = lambda one: self.cost_and_gradient(one, fixed)  # noqa: E731
        return slopes(self._batch, x, fixed, places) or one_by_one(slope, x, places)

    def cost_and_gradient(self, x: Array, fixed: Array) -> tuple[float, Array]:
        """The cost and its gradient (n,), without a Jacobian of the points."""
        return self._chain.gradient(x, fixed)

    def hessian_at(self, x: Array, fixed: Array) -> Array:
        """The exact Hessian (n, n)."""
        return np.asarray(self.hessian(x, fixed))

    def linearize_at(self, x: Array, fixed: Array) -> Linearization:
        """Residual and Jacobian at a point."""
        there = self.stacked_constraints
        constraints = None if there is None else there.linearize(x, fixed)
        return Linearization(*self._chain.linearize(x, fixed), constraints)

    def sparsely(self, x: Array, fixed: Array) -> Sparse:
        """The residual (m,) and a sparse Jacobian (m, n), where a dense one would be too large."""
        return self._chain.linearize_sparsely(x, fixed)

    def linearize(self, values: Mapping[str, ArrayLike]) -> Linearization:
        """Residual and Jacobian at named values; every block that is read needs one."""
        with limited_threads():
            return self.linearize_at(*self.split(values))

    # What convergence means, for every solver.

    def rounding(self, x: Array, fixed: Array, residual: Array) -> Rounding:
        """How much of each row of the residual (m,) at x may be rounding error.

        A row is made of the free numbers, the fixed ones and the points, each through its
        derivative; that is measured at x, for far from a minimum rows are made of larger numbers.
        """
        return Rounding.of(residual, self._chain.made_of(x, fixed))

    @property
    def support(self) -> Support:
        """Which rows each free number can change, by structure."""
        return self._chain.support

    def optimality(self, x: Array, here: Linearization, rounding: Rounding | None = None) -> float:
        """How far from a stationary point, free of units: see `optimality.optimality`."""
        box = (self.lower, self.upper) if self.bounded else None
        return optimality(x, here, self.support, box, rounding)

    # How all of it is put together.

    @cached_property
    def _points(self) -> tuple[Points, ...]:
        found = {p.symbol.__hash__(): p for r in self.residuals for p in r.points}
        return tuple(found.values())

    @cached_property
    def _points_of_all(self) -> tuple[Points, ...]:
        of_constraints = (p for c in self.constraints for p in c.points)
        found = {p.symbol.__hash__(): p for p in (*self._points, *of_constraints)}
        return tuple(found.values())

    @cached_property
    def _whitened(self) -> cs.MX:
        """The stacked residual, its points being placeholders."""
        return cs.vertcat(*[residual.whitened for residual in self.residuals])

    def _constraint_graph(self, stacked: cs.MX) -> Graph:
        read = {p.symbol.__hash__(): p for c in self.constraints for p in c.points}
        return Graph.of(in_blocks(stacked, tuple(read.values())), self.free, self.fixed)

    @cached_property
    def _blocks(self) -> dict[str, Block]:
        """Every block that is read, by name, the best known description of each."""
        of_residuals = (b for r in self.residuals for b in r.blocks)
        of_points = (b for p in self._points_of_all for b in p.source.blocks)
        described = {b.symbol.__hash__(): b for b in (*of_residuals, *self._named, *of_points)}
        placeholders = {p.symbol.__hash__() for p in self._points_of_all}
        stacked = cs.vertcat(self._whitened, *(c.expression for c in self.constraints))
        found = [s for s in cs.symvar(stacked) if s.__hash__() not in placeholders]
        found += [b.symbol for p in self._points_of_all for b in p.source.blocks]
        blocks: dict[str, Block] = {}
        for symbol in {s.__hash__(): s for s in found}.values():
            if symbol.name() in blocks:
                raise TwoSymbolsOneName(symbol.name())
            blocks[symbol.name()] = described.get(symbol.__hash__()) or Block.of(symbol)
        return blocks

    @cached_property
    def _graph(self) -> tuple[cs.MX, cs.MX, cs.MX]:
        whole = Graph.of(in_blocks(self._whitened, self._points), self.free, self.fixed)
        return whole.x, whole.fixed, whole.residual

    @cached_property
    def _chain(self) -> Chain:
        return Chain(*self._split(lambda source: source.numeric), self.free, self.fixed)

    @cached_property
    def _batch(self) -> Batch:
        whole = Graph.of(in_blocks(self._whitened, self._points, lean), self.free, self.fixed)
        return Batch(whole, *self._split(lambda source: source.many), self.free, self.fixed)

    def _split(self, arithmetic: Callable[[PointSource], T | None]) -> tuple[Graph, tuple[T, ...]]:
        """The residual as a graph of those points for which there is arithmetic, and that."""
        quick = [(p, arithmetic(p.source)) for p in self._points]
        by_graph = [p for p, found in quick if found is None]
        placeholders = [p.symbol for p, found in quick if found is not None]
        expression = in_blocks(self._whitened, by_graph)
        graph = Graph.of(expression, self.free, self.fixed, placeholders)
        return graph, tuple(found for _, found in quick if found is not None)
