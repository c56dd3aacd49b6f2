"""A problem's cost at many points at once.

The residual is a function of the free numbers, the fixed ones and the points, as in `chain`; the
points of bodies come from matrix products over all the values at once, those of other sources are
part of the graph. Nothing is derived.
"""

from collections.abc import Mapping, Sequence

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Layout
from workbench.blocks.many import Evaluator
from workbench.bodies.batched import ManyPoints
from workbench.problem.chain import Graph

Array = NDArray[np.float64]


class BatchedCost:
    """1/2 |r|^2 for rows of free numbers; robust terms are in r already."""

    def __init__(
        self,
        graph: Graph,
        sources: Sequence[ManyPoints],
        free: Layout,
        fixed: Layout,
        by: Evaluator,
    ) -> None:
        self._sources, self._free, self._fixed = tuple(sources), free, fixed
        r = cs.densify(graph.residual)
        cost = cs.Function("cost", [graph.x, graph.fixed, *graph.points], [0.5 * cs.sumsqr(r)])
        self._cost = by(cost, (False, True, *(False for _ in graph.points)))

    def __call__(self, X: Array, fixed: Array) -> Array:
        """(M,) for X (M, n) and the fixed numbers, which are the same for all."""
        if not len(X):
            return np.empty(0)
        values = self._values(X, fixed) if self._sources else {}
        points = (source(values).reshape(len(X), -1) for source in self._sources)
        return self._cost(X, fixed, *points)[0][:, 0]

    def _values(self, X: Array, fixed: Array) -> Mapping[str, Array]:
        values = {
            b.name: X[:, self._free.slices[b.name]].reshape(len(X), *b.shape)
            for b in self._free.blocks
        }
        same = self._fixed.unpack(fixed)
        return values | {
            name: np.broadcast_to(value, (len(X), *value.shape)) for name, value in same.items()
        }
