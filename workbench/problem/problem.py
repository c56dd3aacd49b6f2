"""Residuals over named blocks, some of them free."""

from collections.abc import Iterable, Mapping
from functools import cached_property

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csc_array

from workbench.blocks import Block, Layout, Points, Tree, Values, in_blocks
from workbench.blocks.checks import mapping, texts
from workbench.blocks.layout import all_values
from workbench.errors import UnknownName
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
from workbench.problem.bounds import Bounds, flat_bounds, of_free
from workbench.problem.chain import Chain
from workbench.problem.constraint import Constraint
from workbench.problem.constraint_set import ConstraintSet
from workbench.problem.frame_chain import FrameChain, Numbers
from workbench.problem.graph import Graph, split, stored
from workbench.problem.linearization import Linearization
from workbench.problem.naming import (
    blocks_behind,
    check_names,
    distinct,
    free_and_fixed,
    parts_of,
    rows_of,
)
from workbench.problem.optimality import optimality
from workbench.problem.rounding import Rounding, Support
from workbench.problem.storage import Stored
from workbench.residuals import Residual
from workbench.threads import limited_threads

Array = NDArray[np.float64]


class Problem:
    """Minimise 1/2 sum over residuals of |r(x, fixed) / sigma|^2 over the blocks named `free`.

    Every other block that the residuals read is fixed at the value that it is given: a
    measurement, or an unknown whose turn has not come. `free` holds names, or is one: of blocks, or
    of entries such as `pose[pelvis]`, `betas[0:3]` and `pose[pelvis, x]`. A block that is free in
    part is also among the `fixed` ones, and its value is always the whole array. `bounds` map names
    of free blocks or entries to (lower, upper), numbers or arrays. Units and labels of blocks come
    with the bodies' points; `blocks` adds those of others. A problem is never changed; `freeing`
    makes another.

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
        check_names((*free, *self.bounds), self.known, self._named)
        self._known = Layout(tuple(self.known.values()))
        self.free, self.fixed = free_and_fixed(self._known, free)
        self.lower, self.upper = flat_bounds(self.bounds, self.free, self._known)
        self.stacked_constraints = (
            ConstraintSet(self.constraints, *self._layouts) if self.constraints else None
        )

    def freeing(self, *names: str) -> "Problem":
        """The same residuals with these blocks, or entries of blocks, free instead.

        Bounds of others are dropped, and constraints that read none of these blocks.
        """
        names = texts("the names of free blocks", names)
        check_names(names, self.known, self._named)
        return self._with(self.residuals, names)

    def without(self, *residuals: str) -> "Problem":
        """The same but for the named residuals; what then nobody reads is no longer free."""
        for name in texts("the names of residuals", residuals):
            if name not in self.rows:
                raise UnknownName("residual", name, self.rows)
        left = [residual for residual in self.residuals if residual.name not in residuals]
        reads = [r.reads for r in left] + [c.reads for c in self.constraints]
        return self._with(left, self.free.spelled(set(self.free.names).difference(*reads)))

    def _with(self, residuals: Iterable[Residual], names: Iterable[str]) -> "Problem":
        free, _ = free_and_fixed(self._known, names)
        bounds = of_free(self.bounds, free, self._known)
        kept = [c for c in self.constraints if not set(free.names).isdisjoint(c.reads)]
        return Problem(residuals, names, bounds, self._named, kept)

    # Values in and out.

    def split(self, values: Mapping[str, ArrayLike]) -> tuple[Array, Array]:
        """The free and the fixed numbers among `values`, each as a flat vector.

        Of a block that is free in part, the fixed numbers are zero where it is free.
        """
        x, fixed = self.free.pack(values), self.fixed.pack(values)
        for block in self.free.parts:
            fixed[self.fixed.slices[block.name].start + np.array(block.places)] = 0.0
        return x, fixed

    def values(self, x: Array, fixed: Array) -> Values:
        """Undo `split`: the arrays of all blocks."""
        return all_values(self.free, x, self.fixed, fixed)

    @cached_property
    def rows(self) -> dict[str, slice]:
        """Where each residual sits in the stacked vector."""
        return rows_of(self.residuals)

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
        """The kinematic trees of the bodies whose points are read, one for each pose."""
        trees = (p.source.tree for p in self._points)
        return tuple({tree.places: tree for tree in trees if tree is not None}.values())

    @cached_property
    def turns(self) -> tuple[slice, ...]:
        """Where the rotation vectors of joints stand that are free, among the free numbers."""
        found = {at.start: at for tree in self.trees for at in tree.turned(self.free).values()}
        return tuple(found.values())

    @cached_property
    def bounded(self) -> bool:
        """Whether any entry has a bound."""
        return bool(np.isfinite(self.lower).any() or np.isfinite(self.upper).any())

    # The graphs.

    @cached_property
    def function(self) -> cs.Function:
        """(x, fixed) -> r: the stacked, whitened residual, (m, 1)."""
        return self._graph.function

    @cached_property
    def derivative(self) -> cs.Function:
        """(x, fixed) -> r, J: J (m, n) as sparse as its structure."""
        return self._graph.derivative

    @cached_property
    def adjoint(self) -> cs.Function:
        """(x, fixed) -> cost, gradient: one reverse sweep, no Jacobian."""
        return self._graph.adjoint

    @cached_property
    def hessian(self) -> cs.Function:
        """(x, fixed) -> H: the exact Hessian of the cost, J' J + sum r_i H_i, (n, n)."""
        return self._graph.hessian

    def graph(self) -> cs.MX:
        """The stacked, whitened residual (m, 1) in the symbols of blocks; see `Residual.graph`."""
        return in_blocks(self._whitened, self._points)

    def prepare(self) -> None:
        """Build what the numbers below need, before a clock starts."""
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
        return slopes(self._batch, x, fixed, places) or one_by_one(
            lambda one: self.cost_and_gradient(one, fixed), x, places
        )

    def cost_and_gradient(self, x: Array, fixed: Array) -> tuple[float, Array]:
        """The cost and its gradient (n,), without a Jacobian of the points."""
        return self._chain.gradient(x, fixed)

    def hessian_at(self, x: Array, fixed: Array) -> Stored:
        """The exact Hessian (n, n); sparse where it is large and most of it is zero."""
        return stored(self.hessian(x, fixed))

    def linearize_at(self, x: Array, fixed: Array) -> Linearization:
        """Residual and Jacobian at a point; sparse where it is large and most of it is zero."""
        constraints = there.linearize(x, fixed) if (there := self.stacked_constraints) else None
        return Linearization(*self._chain.linearize(x, fixed), constraints)

    def linearize(self, values: Mapping[str, ArrayLike]) -> Linearization:
        """Residual and Jacobian at named values; every block that is read needs one."""
        with limited_threads():
            return self.linearize_at(*self.split(values))

    @property
    def sparse(self) -> bool:
        """Whether the Jacobian is stored by its nonzeros."""
        return self._chain.sparse

    @property
    def pattern(self) -> csc_array:
        """Where the Jacobian may be nonzero, (m, n): each point reads all of its body's blocks."""
        return self._chain.pattern

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

    @cached_property
    def _points(self) -> tuple[Points, ...]:
        return distinct(p for r in self.residuals for p in r.points)

    @cached_property
    def _points_of_all(self) -> tuple[Points, ...]:
        return distinct((*self._points, *(p for c in self.constraints for p in c.points)))

    @cached_property
    def _whitened(self) -> cs.MX:
        """The stacked residual, its points being placeholders."""
        return cs.vertcat(*[residual.whitened for residual in self.residuals])

    @cached_property
    def known(self) -> dict[str, Block]:
        """Every block that is read, by name, the best known description of each."""
        of_residuals = (b for r in self.residuals for b in r.blocks)
        of_points = (b for p in self._points_of_all for b in p.source.blocks)
        described = (*of_points, *of_residuals, *self._named)  # by whoever made it, at last
        stacked = cs.vertcat(self._whitened, *(c.expression for c in self.constraints))
        return blocks_behind(stacked, self._points_of_all, described)

    @cached_property
    def _graph(self) -> Graph:
        return Graph.of(in_blocks(self._whitened, self._points), *self._layouts)

    @cached_property
    def _chain(self) -> Numbers:
        by_frames = any(residual.each for residual in self.residuals)
        return (FrameChain if by_frames else Chain.of)(self.residuals, *self._layouts)

    @cached_property
    def _batch(self) -> Batch:
        drawn = all(p.source.expression is not None for p in self._points)
        whole = self._graph if drawn else None
        parts = split(self._whitened, self._points, *self._layouts)
        return Batch(whole, *parts, *self._layouts)

    @property
    def _layouts(self) -> tuple[Layout, Layout]:
        return self.free, self.fixed
