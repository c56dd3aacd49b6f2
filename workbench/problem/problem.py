"""Residuals over named blocks, some of them free."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from itertools import pairwise

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.blocks import Block, Layout, Points, PointSource, Tree
from workbench.bodies.batched import batched, in_full, lean
from workbench.errors import (
    BadBounds,
    BadResidual,
    DuplicateResidual,
    TwoSymbolsOneName,
    UnknownName,
)
from workbench.problem.batch import Batch, Costs, Places, Way, interpreted
from workbench.problem.bounds import Bounds, flat_bounds
from workbench.problem.chain import FORWARD, Chain, Graph
from workbench.problem.linearization import EPS, Linearization
from workbench.residuals import Residual
from workbench.threads import limited_threads

Array = NDArray[np.float64]


class Problem:
    """Minimise 1/2 sum over residuals of |r(x, fixed) / sigma|^2 over the blocks named `free`.

    Every other block that the residuals read is fixed at the value that it is given: a
    measurement, or an unknown whose turn has not come. `free` holds names, or is one; `bounds`
    map names of free blocks to (lower, upper), numbers or arrays. Units and labels of blocks
    come with the bodies' points; `blocks` adds those of others. A problem is never changed;
    `freeing` makes another.

    Raises DuplicateResidual, TwoSymbolsOneName, UnknownName, BadBounds, NotNumbers or BadResidual.
    """

    def __init__(
        self,
        residuals: Iterable[Residual],
        free: str | Iterable[str],
        bounds: Bounds | None = None,
        blocks: Iterable[Block] = (),
    ) -> None:
        self.residuals = tuple(residuals)
        free = (free,) if isinstance(free, str) else tuple(free)
        self.bounds = dict(bounds or {})
        self._named = tuple(blocks)
        if not self.residuals:
            raise BadResidual("a problem needs at least one residual")
        names = [residual.name for residual in self.residuals]
        for name in names:
            if names.count(name) > 1:
                raise DuplicateResidual(name)
        known = self._blocks
        for name in (*free, *self.bounds):
            if name not in known:
                raise UnknownName("block", name, known)
        self.free = Layout(tuple(known[name] for name in dict.fromkeys(free)))
        self.fixed = Layout(tuple(b for name, b in known.items() if name not in free))
        for name in self.bounds:
            if name in self.fixed.names:
                raise BadBounds(f"block {name!r} has bounds but is fixed; free it or drop them")
        self.lower, self.upper = (flat_bounds(self.bounds, self.free, side) for side in (0, 1))
        wrong = ~(self.lower <= self.upper)  # also where one is NaN
        if wrong.any():
            i = int(np.argmax(wrong))
            raise BadBounds(
                f"{self.free.label(i)} has the lower bound {self.lower[i]:g} and the upper bound "
                f"{self.upper[i]:g}; no number lies between"
            )

    def freeing(self, *names: str) -> "Problem":
        """The same residuals with these blocks free instead; bounds of others are dropped."""
        bounds = {name: self.bounds[name] for name in names if name in self.bounds}
        return Problem(self.residuals, names, bounds, self._named)

    def without(self, *residuals: str) -> "Problem":
        """The same but for the named residuals; what then nobody reads is no longer free."""
        for name in residuals:
            if name not in self.rows:
                raise UnknownName("residual", name, self.rows)
        left = [residual for residual in self.residuals if residual.name not in residuals]
        read = {name for residual in left for name in residual.reads}
        free = [name for name in self.free.names if name in read]
        bounds = {name: self.bounds[name] for name in free if name in self.bounds}
        return Problem(left, free, bounds, self._named)

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

    @property
    def trees(self) -> tuple[Tree, ...]:
        """The kinematic trees of the bodies whose points are read, one per pose block."""
        found = {tree.pose: tree for p in self._points if (tree := p.source.tree) is not None}
        return tuple(found.values())

    @property
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
        outputs = [cost, cs.gradient(cost, x)]
        return cs.Function("adjoint", [x, fixed], outputs, ["x", "fixed"], ["cost", "gradient"])

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

    def cost_and_gradient(self, x: Array, fixed: Array) -> tuple[float, Array]:
        """The cost and its gradient (n,), without a Jacobian of the points."""
        return self._chain.gradient(x, fixed)

    def hessian_at(self, x: Array, fixed: Array) -> Array:
        """The exact Hessian (n, n)."""
        return np.asarray(self.hessian(x, fixed))

    def linearize_at(self, x: Array, fixed: Array) -> Linearization:
        """Residual and Jacobian at a point."""
        return Linearization(*self._chain.linearize(x, fixed))

    def linearize(self, values: Mapping[str, ArrayLike]) -> Linearization:
        """Residual and Jacobian at named values; every block that is read needs one."""
        with limited_threads():
            return self.linearize_at(*self.split(values))

    # What convergence means, for every solver.

    def rounding(self, x: Array, fixed: Array) -> float:
        """How much of |r| may be rounding error: 10 eps times the size of what r is made from.

        That is the free numbers, the fixed ones and the points, each through its derivative, and
        r itself.
        """
        r = float(np.linalg.norm(self._chain.residual(x, fixed)))
        return 10 * EPS * (float(np.sqrt(self.size)) + r + self._chain.size(x, fixed))

    def optimality(self, x: Array, here: Linearization, rounding: float = 0.0) -> float:
        """How far from a stationary point: 0 at one, at most 1, free of units.

        The largest |g_i| / (|J_i| |r|), the cosine between the residual and a column of the
        Jacobian, less what rounding explains. With bounds g_i / |J_i| is cut to |J_i| times the
        way that is left: the projected gradient, in the units of the residual. So an entry at a
        bound that it is pulled against is stationary, and one next to it nearly so.
        """
        norms, seen = here.column_norms, here.column_norms > 0
        pull = -here.gradient[seen] / norms[seen]
        left, right = (self.lower - x)[seen] * norms[seen], (self.upper - x)[seen] * norms[seen]
        pull = np.maximum(np.abs(np.clip(pull, left, right)) - rounding, 0)
        size = np.linalg.norm(here.residual)
        return float(np.max(pull, initial=0.0) / size) if size > 0 else 0.0

    # How all of it is put together.

    @cached_property
    def _points(self) -> tuple[Points, ...]:
        found = {p.symbol.__hash__(): p for r in self.residuals for p in r.points}
        return tuple(found.values())

    @cached_property
    def _whitened(self) -> cs.MX:
        """The stacked residual, its points being placeholders."""
        return cs.vertcat(*[residual.whitened for residual in self.residuals])

    def _substituted(
        self, points: Iterable[Points], said: Callable[[PointSource], cs.MX] = in_full
    ) -> cs.MX:
        """The stacked residual with these placeholders replaced by their sources' expressions."""
        chosen = tuple(points)
        if not chosen:
            return self._whitened
        expressions = [said(p.source) for p in chosen]
        return cs.graph_substitute(self._whitened, [p.symbol for p in chosen], expressions)

    @cached_property
    def _blocks(self) -> dict[str, Block]:
        """Every block that is read, by name, the best known description of each."""
        described = {
            b.symbol.__hash__(): b
            for b in (*self._named, *(b for p in self._points for b in p.source.blocks))
        }
        placeholders = {p.symbol.__hash__() for p in self._points}
        found = [s for s in cs.symvar(self._whitened) if s.__hash__() not in placeholders]
        found += [b.symbol for p in self._points for b in p.source.blocks]
        blocks: dict[str, Block] = {}
        for symbol in {s.__hash__(): s for s in found}.values():
            if symbol.name() in blocks:
                raise TwoSymbolsOneName(symbol.name())
            blocks[symbol.name()] = described.get(symbol.__hash__()) or Block.of(symbol)
        return blocks

    def _on_vectors(self, residual: cs.MX, points: Sequence[cs.MX]) -> Graph:
        """A residual in blocks, as one in flat vectors of free and fixed numbers."""
        blocks = (*self.free.blocks, *self.fixed.blocks)
        symbols = [*(block.symbol for block in blocks), *points]
        named = cs.Function("named", symbols, [residual])
        x, fixed = cs.MX.sym("x", self.free.size), cs.MX.sym("fixed", self.fixed.size)
        pieces = self.free.pieces(x) + self.fixed.pieces(fixed)
        (r,) = named.call([*pieces, *points], True, False)  # inlined: seeds stay sparse
        return Graph(x, fixed, tuple(points), r)

    @cached_property
    def _graph(self) -> tuple[cs.MX, cs.MX, cs.MX]:
        whole = self._on_vectors(self._substituted(self._points), ())
        return whole.x, whole.fixed, whole.residual

    @cached_property
    def _chain(self) -> Chain:
        quick = [(p, p.source.numeric) for p in self._points]
        by_graph = [p for p, numeric in quick if numeric is None]
        placeholders = [p.symbol for p, numeric in quick if numeric is not None]
        sources = [numeric for _, numeric in quick if numeric is not None]
        graph = self._on_vectors(self._substituted(by_graph), placeholders)
        return Chain(graph, sources, self.free, self.fixed)

    @cached_property
    def _batch(self) -> Batch:
        whole = self._on_vectors(self._substituted(self._points, lean), ())
        sources = {p.symbol.__hash__(): batched(p.source) for p in self._points}
        by_graph = [p for p in self._points if sources[p.symbol.__hash__()] is None]
        placeholders = [p.symbol for p in self._points if p not in by_graph]
        split = self._on_vectors(self._substituted(by_graph), placeholders)
        found = tuple(source for source in sources.values() if source is not None)
        return Batch(whole, split, found, self.free, self.fixed)
