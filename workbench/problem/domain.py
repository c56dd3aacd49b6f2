"""Where the residuals of a problem mean something, as those of a camera only in front of it."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks import Layout
from workbench.blocks.layout import all_values
from workbench.problem.graph import split
from workbench.problem.naming import distinct
from workbench.residuals import Residual


@dataclass(frozen=True, eq=False)
class Domain:
    """The domains of the points of some residuals; see `Residual.domain`.

    Attributes:
        residuals: those that have a domain.
        free: the layout of the free numbers.
        fixed: the layout of the fixed numbers.
    """

    residuals: tuple[Residual, ...]
    free: Layout
    fixed: Layout

    @staticmethod
    def of(residuals: Iterable[Residual], free: Layout, fixed: Layout) -> "Domain | None":
        """The domain of a problem with these residuals; None if they mean something everywhere."""
        limited = tuple(one for one in residuals if one.domain is not None)
        return Domain(limited, free, fixed) if limited else None

    def beside(self, whitened: cs.MX) -> cs.MX:
        """A column of whitened residuals with one row more: 0 in the domain, infinite elsewhere.

        The cost of the column is therefore infinite outside of the domain; inside it has the same
        bits as without that row, and the same derivatives.
        """
        outside = cs.mmin(self._counted) < 0
        return cs.vertcat(whitened, cs.if_else(outside, np.inf, 0.0))

    def outside_in_words(self, x: Array, fixed: Array) -> str:
        """The first point that is outside of its domain at x (n,), in words; "" if none is."""
        found = np.asarray(self._evaluated(x, fixed)).ravel()
        first = 0
        for one in self.residuals:
            d = one.rows_per_point
            out = np.flatnonzero(found[first : first + one.size // d] < 0)
            if out.size:
                return (
                    f"{one.label(d * int(out[0]))} means nothing there, because its domain is "
                    f"{found[first + out[0]]:.3g}, below zero (of a keypoint, the domain is how "
                    "many metres it is in front of its camera, times its confidence)"
                )
            first += one.size // d
        return ""

    @cached_property
    def _counted(self) -> cs.MX:
        """The domain of each point times its weight, (p, 1)."""
        return cs.vertcat(*[_weighed(one, one.domain) for one in self.residuals])

    def _evaluated(self, x: Array, fixed: Array) -> cs.DM:
        points = distinct(p for one in self.residuals for p in one.points)
        graph, sources = split(self._counted, points, self.free, self.fixed)
        named = all_values(self.free, x, self.fixed, fixed)
        values = {name: value[None] for name, value in named.items()}
        there = [source.evaluate_batch(values)[0].T for source in sources]
        f = cs.Function("domain", [graph.x, graph.fixed, *graph.points], [graph.residual])
        return f(x, fixed, *there)


def _weighed(residual: Residual, numbers: cs.MX) -> cs.MX:
    """Numbers for each point (m / d, 1) times the point's weight, the sum of those of its rows."""
    d, weights = residual.rows_per_point, residual.weights
    if weights is None:
        return numbers
    if not isinstance(weights, cs.MX):
        weights = cs.DM(np.asarray(weights, dtype=float))
    if d > 1 and weights.numel() == residual.size:
        weights = cs.sum1(cs.reshape(weights, d, residual.size // d)).T
    return weights * numbers
