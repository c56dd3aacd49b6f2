"""Residuals over named blocks, some of them free."""

from collections.abc import Iterable, Mapping
from functools import cached_property, partial

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_array

from workbench.arrays import Array, Mask
from workbench.blocks import Block, Layout, Points, Tree, Values, in_blocks
from workbench.blocks.block import Symbolic
from workbench.blocks.checks import mapping, texts
from workbench.blocks.layout import all_values
from workbench.blocks.points import distinct
from workbench.errors import check_known
from workbench.problem import naming
from workbench.problem.chain import Chain
from workbench.problem.constraints import Constraint, ConstraintSet, part_at
from workbench.problem.costs import (
    CostGradients,
    CostGraph,
    CostMethod,
    Costs,
    Domain,
    Places,
    cost_gradients,
    interpreted,
)
from workbench.problem.frames import FrameChain
from workbench.problem.graph import Graph, stored
from workbench.problem.linearization import Linearization
from workbench.problem.naming import Bounds, check_units, flat_bounds, of_free
from workbench.problem.optimality import ROUNDING_FACTOR, Rounding, RowSupport, optimality
from workbench.problem.steps import EPS
from workbench.problem.storage import Stored
from workbench.residuals import Residual
from workbench.threads import limited_threads


class Problem(Symbolic):
    """Minimise 1/2 sum over residuals of |r(x, fixed) / sigma|^2 over the blocks named `free`.

    Every other block that the residuals read is fixed at its given value. `free` is one name or
    several, of blocks or of entries: `betas`, `pose[pelvis]`, `betas[0:3]`, `pose[pelvis, x]`. A
    block that is free in part is also among the `fixed` ones, and its value is always the whole
    array. `bounds` map names of free blocks or entries to (lower, upper). `blocks` gives units and
    labels of blocks that are not those of bodies. A problem never changes; `freeing` makes another.

    Raises DuplicateResidual, TwoSymbolsOneName, UnknownName, UnreadBlock, BadBounds, NotNumbers,
    BadResidual (also for sums of different units), or BadArgument for a name of another form.
    """

    def __init__(
        self,
        residuals: Iterable[Residual],
        free: str | Iterable[str],
        bounds: Bounds | None = None,
        blocks: Iterable[Block] = (),
        constraints: Iterable[Constraint] = (),
    ) -> None:
        parts = naming.parts_of(residuals, constraints, blocks)
        self.residuals, self.constraints, self._named = parts
        free = texts("the names of free blocks", free)
        self.bounds = dict(mapping("the bounds of a problem", {} if bounds is None else bounds))
        naming.check_names((*free, *self.bounds), self.known, self._named)
        check_units((*self.residuals, *self.constraints), self.known, self.points)
        self._known = Layout(tuple(self.known.values()))
        self.free, self.fixed = self._layouts = naming.free_and_fixed(self._known, free)
        self.lower, self.upper = flat_bounds(self.bounds, self.free, self._known)
        self.stages: dict[object, Problem] = {}  # made once by `in_stage`
        limits = self.constraints
        self.stacked_constraints = ConstraintSet(limits, *self._layouts) if limits else None
        limited = tuple(r for r in self.residuals if r.domain is not None)
        self.domain = Domain(limited, *self._layouts) if limited else None

    def freeing(self, *names: str) -> "Problem":
        """The same residuals with these blocks, or entries of blocks, free instead.

        Bounds of other blocks are dropped, and so are constraints that read none of these.
        """
        names = texts("the names of free blocks", names)
        naming.check_names(names, self.known, self._named)
        return self.variant(self.residuals, names)

    def without(self, *residuals: str) -> "Problem":
        """The problem without the named residuals; blocks that no other reads are not free."""
        self.rows_named(texts("the names of residuals", residuals))
        others = [residual for residual in self.residuals if residual.name not in residuals]
        reads = [r.reads for r in others] + [c.reads for c in self.constraints]
        return self.variant(others, self.free.spelled(set(self.free.names).difference(*reads)))

    def frozen(self, values: Mapping[str, ArrayLike]) -> "Problem":
        """The same problem with contacts held as they are at these values; it has a graph.

        A problem in which nothing is chosen anew at every point is returned as it is.
        """
        arrays = self.values(*self.split(values))
        held = [residual.frozen(arrays) for residual in self.residuals]
        return self if held == [*self.residuals] else self.variant(held, self.free.spelled())

    def variant(self, residuals: Iterable[Residual], names: Iterable[str]) -> "Problem":
        """The same with other residuals and other names free."""
        free, _ = naming.free_and_fixed(self._known, names)
        bounds = of_free(self.bounds, free, self._known)
        kept = [c for c in self.constraints if not set(free.names).isdisjoint(c.reads)]
        return Problem(residuals, names, bounds, self._named, kept)

    def for_judging(self) -> "Problem":
        """This problem; a metered one returns a copy that does not count as part of the run."""
        return self

    def read(self, values: Mapping[str, ArrayLike]) -> Values:
        """The values of the blocks that the problem reads, as arrays; others are left out."""
        names = (*self.free.names, *self.fixed.names)
        return {n: np.asarray(values[n], dtype=float) for n in names if n in values}

    def split(self, values: Mapping[str, ArrayLike]) -> tuple[Array, Array]:
        """The free and the fixed numbers among `values`, each as a flat vector.

        Of a block that is free in part, the fixed numbers are zero where it is free.
        """
        x, fixed = self.free.pack(values), self.fixed.pack(values)
        for block in self.free.parts:
            fixed[self.fixed.slices[block.name].start + np.array(block.places)] = 0.0
        return x, fixed

    def values(self, x: Array, fixed: Array) -> Values:
        """The arrays of all blocks from their free and fixed numbers; the inverse of `split`."""
        return all_values(self.free, x, self.fixed, fixed)

    @cached_property
    def rows(self) -> dict[str, slice]:
        """The rows of each residual in the stacked residual."""
        return naming.rows_of(self.residuals)

    def rows_named(self, residuals: Iterable[str]) -> Mask:
        """The rows (m,) of the named residuals. Raises UnknownName for a name that none has."""
        mask = np.zeros(self.size, dtype=bool)
        for name in residuals:
            check_known("residual", name, self.rows)
            mask[self.rows[name]] = True
        return mask

    @property
    def size(self) -> int:
        """m, the length of the stacked residual."""
        return sum(residual.size for residual in self.residuals)

    def row_label(self, row: int) -> str:
        """The name of one entry of the stacked residual."""
        part, place = part_at(self.residuals, row)
        return part.label(place)

    @cached_property
    def points(self) -> tuple[Points, ...]:
        """The points that the residuals read, each once."""
        return distinct(p for r in self.residuals for p in r.points)

    @cached_property
    def has_graph(self) -> bool:
        """Whether every point has an expression, and not arithmetic alone."""
        return all(p.source.expression is not None for p in self.points)

    @cached_property
    def trees(self) -> tuple[Tree, ...]:
        """The kinematic trees of the bodies whose points are read, one for each pose."""
        trees = (p.source.tree for p in self.points)
        return tuple({tree.places: tree for tree in trees if tree is not None}.values())

    @cached_property
    def rotations(self) -> tuple[slice, ...]:
        """Where free rotation vectors of joints stand among the free numbers."""
        joints = (joint for tree in self.trees for joint in tree.turned(self.free).values())
        return tuple({joint.start: joint for joint in joints}.values())

    @cached_property
    def bounded(self) -> bool:
        """Whether any free number has a bound."""
        return bool(np.isfinite(self.lower).any() or np.isfinite(self.upper).any())

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
        return in_blocks(self._whitened, self.points)

    def prepare(self) -> None:
        """Build the functions that evaluations need, so that the first one takes no longer."""
        _ = self._chain

    # The numbers, for flat vectors: by the chain rule, or from the graphs above.

    def residual(self, x: Array, fixed: Array) -> Array:
        """r (m,), whitened."""
        return self._chain.residual(x, fixed)

    def costs(
        self, x: Array, fixed: Array, entries: Places | None = None, by: CostMethod = interpreted
    ) -> Costs:
        """A function of z (M, k) to the costs (M,) at M points that differ from x in z only.

        z are the numbers at the places `entries` of x (all, if None). Outside of the `domain` costs
        are infinite. `by` is `interpreted`, or `compiled`: many times as fast, after some seconds.
        """
        return by(self._cost_graph, x, fixed, self._places(entries))

    def cost_gradients(
        self, x: Array, fixed: Array, entries: Places | None = None
    ) -> CostGradients:
        """A function of z (M, k) to the costs (M,) and their gradients (M, k); see `costs`."""
        one_by_one = partial(self.cost_and_gradient, fixed=fixed)
        return cost_gradients(self._cost_graph, x, fixed, self._places(entries), one_by_one)

    def _places(self, entries: Places | None) -> Places:
        return np.arange(self.free.size) if entries is None else entries.astype(np.int64)

    def cost_and_gradient(self, x: Array, fixed: Array) -> tuple[float, Array]:
        """The cost and its gradient (n,), without a Jacobian of the points."""
        return self._chain.gradient(x, fixed)

    def hessian_at(self, x: Array, fixed: Array) -> Stored:
        """The exact Hessian (n, n); sparse where it is large and most of it is zero."""
        return stored(self.hessian(x, fixed))

    def linearize_at(self, x: Array, fixed: Array) -> Linearization:
        """Residual and Jacobian at a point; sparse where it is large and most of it is zero."""
        limits = self.stacked_constraints
        linearized = None if limits is None else limits.linearize(x, fixed)
        return Linearization(*self._chain.linearize(x, fixed), linearized)

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

    def rounding(self, x: Array, fixed: Array, residual: Array, floor: float = 1.0) -> Rounding:
        """How large the rounding error of each row of the residual (m,) at x may be.

        It is 10 eps times the size of the terms that make up the row at x: derivatives times free
        numbers, fixed numbers, constants and points. These are at least `floor` sigmas.
        """
        sizes = floor + np.abs(residual) + self._chain.term_sizes(x, fixed)
        return Rounding(ROUNDING_FACTOR * EPS * sizes)

    @property
    def support(self) -> RowSupport:
        """Which rows each free number can change, by structure."""
        return self._chain.support

    def optimality(self, x: Array, here: Linearization, rounding: Rounding | None = None) -> float:
        """How far x is from stationary, without units; see `optimality.optimality`."""
        box = (self.lower, self.upper) if self.bounded else None
        return optimality(x, here, self.support, box, rounding)

    @cached_property
    def _whitened(self) -> cs.MX:
        """The stacked residual, its points being placeholders."""
        return cs.vertcat(*[residual.whitened for residual in self.residuals])

    @cached_property
    def known(self) -> dict[str, Block]:
        """Every block that is read, by name, with the unit and labels that are known of it."""
        of_residuals = (b for r in self.residuals for b in r.blocks)
        points = distinct((*self.points, *(p for c in self.constraints for p in c.points)))
        of_points = (b for p in points for b in p.source.blocks)
        described = (*of_points, *of_residuals, *self._named)  # the last one counts
        limited = [constraint.expression for constraint in self.constraints]
        weightless = [r.written for r in self.residuals]  # read also where a weight is 0
        stacked = cs.veccat(self._whitened, *limited, *weightless)
        return naming.blocks_behind(stacked, points, described)

    @cached_property
    def _graph(self) -> Graph:
        return Graph.of(in_blocks(self._whitened, self.points), *self._layouts)

    @cached_property
    def _chain(self) -> Chain | FrameChain:
        by_frames = any(residual.by_frame for residual in self.residuals)
        return (FrameChain if by_frames else Chain.of)(self.residuals, *self._layouts)

    @cached_property
    def _cost_graph(self) -> CostGraph:
        graph = self._graph if self.has_graph else None
        return CostGraph(self._whitened, self.points, *self._layouts, graph, self.domain)


def in_stage(
    problem: "Problem", names: tuple[str, ...] | None, weights: Mapping[str, float]
) -> "Problem":
    """The problem of a stage, which is made once and kept for the next fit.

    `names` are free, or what is free now; `weights` says how many times as often the rows of named
    residuals count.

    Raises what `Problem.freeing` raises, and UnknownName for a residual.
    """
    problem.rows_named(weights)
    changed = {name: float(weight) for name, weight in weights.items() if weight != 1}
    key = names, tuple(sorted(changed.items()))
    if names is None and not changed:
        return problem
    if key not in problem.stages:
        residuals = [
            r.weighed(changed[r.name]) if r.name in changed else r for r in problem.residuals
        ]
        free = problem.free.spelled() if names is None else names
        problem.stages[key] = problem.variant(residuals, free)
    return problem.stages[key]
