"""The Hessian of multipliers' constraints by the chain rule, where points come from arithmetic.

With c(x, p(x)), multipliers y, L = y' c and T = [I; dp/dx],

    d2(y' c)/dx2 = T' (d2L / d(x, p)2) T + sum over i of (dL/dp_i) d2p_i/dx2.

The first part is a small graph of the constraints alone. The second is the Hessian of one number,
a weighted sum of the points, so that constraints of many points, such as the gaps of all capsules
of a body, are not differentiated twice through the whole body.
"""

from collections.abc import Sequence

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks import Layout, Points, in_blocks
from workbench.blocks.functions import Buffered, without_calls
from workbench.blocks.layout import all_values
from workbench.blocks.points import nonzeros_of, pattern_of
from workbench.problem.graph import Graph, split
from workbench.problem.pattern import Pattern


class ConstraintHessian:
    """(x, fixed, multipliers) -> the Hessian (n, n) of multipliers' c, an array."""

    def __init__(
        self, constraints: cs.MX, points: Sequence[Points], free: Layout, fixed: Layout
    ) -> None:
        graph, self._sources = split(constraints, points, free, fixed)
        self._free, self._fixed = free, fixed
        y = cs.MX.sym("multipliers", constraints.shape[0])
        read = [graph.x, *graph.points]
        whole = cs.MX.sym("read", sum(one.numel() for one in read))
        edges = np.cumsum([0, *(one.numel() for one in read)]).tolist()
        pieces = [
            cs.reshape(whole[first:last], *one.shape)
            for one, first, last in zip(read, edges[:-1], edges[1:], strict=True)
        ]
        of_read = cs.Function("of_read", [*read, graph.fixed], [graph.residual])
        (c,) = of_read.call([*pieces, graph.fixed], True, False)
        H, g = cs.hessian(cs.dot(y, c), whole)
        self._places = Pattern(H.sparsity())
        self._second = Buffered(cs.Function("second", [whole, graph.fixed, y], [H, cs.densify(g)]))
        pulls = [cs.MX.sym(f"pull{i}", *p.shape) for i, p in enumerate(graph.points)]
        numeric = [p for p in points if p.source.numeric is not None]
        sums = [
            cs.dot(cs.vec(pull), cs.vec(in_blocks(p.symbol, [p])))
            for pull, p in zip(pulls, numeric, strict=True)
        ]
        of_points = Graph.of(sum(sums[1:], sums[0]), free, fixed, pulls)
        bend = cs.densify(cs.hessian(of_points.residual, of_points.x)[0])
        self._bend = Buffered(
            without_calls(cs.Function("bend", [of_points.x, of_points.fixed, *pulls], [bend]), 0)
        )

    def at(self, x: Array, fixed: Array, multipliers: Array) -> Array:
        """The Hessian (n, n) at x."""
        values, n = all_values(self._free, x, self._fixed, fixed), len(x)
        here = [source.evaluate(values) for source in self._sources]
        slopes = [np.eye(n)]
        for source, one in zip(self._sources, here, strict=True):
            slope = np.zeros((n, one.points.size))
            into = {
                name: slope[at] for name, at in self._free.slices.items() if name in source.reads
            }
            one.tangent(into, None)
            slopes.append(slope.T)
        T = np.vstack(slopes)
        places = np.concatenate([x, *(one.points.ravel() for one in here)])
        entries, gradient = self._second(places, fixed, multipliers)
        found = T.T @ (self._places.matrix(entries) @ T)
        pulls, first = [], n
        for one in here:
            pulls.append(gradient[first : first + one.points.size])
            first += one.points.size
        bend = self._bend(x, fixed, *pulls)[0].reshape(n, n)
        return np.asarray(found + bend)


def has_arithmetic(points: Sequence[Points]) -> bool:
    """Whether some points come from arithmetic, and each derivative of these is an array."""
    sources = [p.source.numeric for p in points if p.source.numeric is not None]
    return bool(sources) and not any(
        nonzeros_of(source, name) is not None or pattern_of(source, name) is not None
        for source in sources
        for name in source.reads
    )
