"""A problem's cost at many points at once; nothing is derived.

Two ways to the same numbers. Where the whole graph is short, it is evaluated in scalar
instructions, by CasADi's machine with all that does not vary folded into constants, or compiled,
several points to an instruction. Where it is long, as for the vertices of a mesh, the points of
bodies come from matrix products over all the values at once and only the residual is a graph.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Layout, NumericPoints
from workbench.blocks.buffered import Buffered
from workbench.blocks.lanes import lanes
from workbench.blocks.many import LONGEST, Many, Mapped, OneByOne, scalar
from workbench.compiling import NoLibrary
from workbench.errors import NotSupported
from workbench.problem.graph import Graph

Array = NDArray[np.float64]
Places = NDArray[np.int64]
Costs = Callable[[Array], Array]  # z (M, k) -> (M,)
EXPANDED_UP_TO = 100_000  # instructions
COMPILED_UP_TO = 60_000  # of those that vary: half a minute of the compiler's
INTERPRETED_UP_TO = 10_000  # of them: above, matrix products are faster


@dataclass(frozen=True, eq=False)
class Batch:
    """A residual as one graph, and as a graph of points that come from arithmetic."""

    whole: Graph
    split: Graph
    sources: Sequence[NumericPoints]  # of the split graph's points
    free: Layout
    fixed: Layout


Way = Callable[[Batch, Array, Array, Places], Costs]


def interpreted(batch: Batch, x: Array, fixed: Array, places: Places) -> Costs:
    """Without a compiler."""
    varying = _varying(batch, x, fixed, places)
    if varying is None or varying[0].n_instructions() > INTERPRETED_UP_TO:
        return _arithmetic(batch, x, fixed, places)
    return _called(Mapped(varying[0], (False, True)), varying[1])


def compiled(batch: Batch, x: Array, fixed: Array, places: Places) -> Costs:
    """With one, where there is one and the graph is short enough; else without."""
    varying = _varying(batch, x, fixed, places)
    if varying is None or varying[0].n_instructions() > COMPILED_UP_TO:
        return interpreted(batch, x, fixed, places)
    try:
        return _called(lanes(varying[0], (False, True)), varying[1])
    except (NoLibrary, NotSupported):
        return interpreted(batch, x, fixed, places)


def _called(run: Many, still: Array) -> Costs:
    return lambda z: run(z, still)[0][:, 0]


def _varying(
    batch: Batch, x: Array, fixed: Array, places: Places
) -> tuple[cs.Function, Array] | None:
    """(z, still) -> cost in scalar instructions, and what in it does not change with z.

    None if there are too many instructions.
    """
    graph = batch.whole
    r = cs.densify(graph.residual)
    scalars = scalar(
        cs.Function("cost", [graph.x, graph.fixed], [0.5 * cs.sumsqr(r)]), EXPANDED_UP_TO
    )
    if scalars is None:
        return None
    z, there = cs.SX.sym("z", len(places)), cs.SX.sym("x", batch.free.size)
    given = cs.SX.sym("fixed", batch.fixed.size)
    put = cs.SX(there)
    put[places.tolist()] = z
    known = cs.vertcat(there, given)
    cost, symbols, parts = cs.extract_parametric(
        scalars(put, given), known, {"extract_trivial": True}
    )
    still = cs.Function("still", [known], [cs.densify(cs.vertcat(*parts))])
    function = cs.Function("cost", [z, cs.vertcat(*symbols)], [cs.densify(cost)])
    return function, np.asarray(still(np.concatenate([x, fixed]))).ravel()


def _arithmetic(batch: Batch, x: Array, fixed: Array, places: Places) -> Costs:
    """Points by matrix products, the residual row by row of z."""
    graph = batch.split
    r = cs.densify(graph.residual)
    cost = cs.Function("cost", [graph.x, graph.fixed, *graph.points], [0.5 * cs.sumsqr(r)])
    shared = (False, True, *(False for _ in graph.points))
    scalars = scalar(cost, LONGEST)
    run = OneByOne(Buffered(cost), shared) if scalars is None else Mapped(scalars, shared)

    def costs(z: Array) -> Array:
        X = np.repeat(x[None], len(z), axis=0)
        X[:, places] = z
        values = _values(batch, X, fixed)
        points = (source.many(values).reshape(len(z), -1) for source in batch.sources)
        return run(X, fixed, *points)[0][:, 0]

    return costs


def _values(batch: Batch, X: Array, fixed: Array) -> Mapping[str, Array]:
    values = {
        b.name: X[:, batch.free.slices[b.name]].reshape(len(X), *b.shape) for b in batch.free.blocks
    }
    same = batch.fixed.unpack(fixed)
    return values | {
        name: np.broadcast_to(value, (len(X), *value.shape)) for name, value in same.items()
    }
