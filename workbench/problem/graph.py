"""An expression in named blocks and points, as a graph of flat vectors of numbers."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as cs

from workbench.blocks import Layout, PointSource


@dataclass(frozen=True, eq=False)
class Graph:
    """The residual in symbols: flat free and fixed numbers, and the points left as they are."""

    x: cs.MX  # (n, 1)
    fixed: cs.MX
    points: tuple[cs.MX, ...]  # (3, N) each
    residual: cs.MX  # (m, 1), whitened

    @staticmethod
    def of(expression: cs.MX, free: Layout, fixed: Layout, points: Sequence[cs.MX] = ()) -> "Graph":
        """Of an expression in the blocks of both layouts and in placeholders of points."""
        symbols = [*(block.symbol for block in (*free.blocks, *fixed.blocks)), *points]
        named = cs.Function("named", symbols, [expression])
        x, given = cs.MX.sym("x", free.size), cs.MX.sym("fixed", fixed.size)
        pieces = free.pieces(x) + fixed.pieces(given)
        (r,) = named.call([*pieces, *points], True, False)  # inlined: seeds stay sparse
        return Graph(x, given, tuple(points), r)


def lean(source: PointSource) -> cs.MX:
    """What a source says of its points, to be evaluated only."""
    return source.lean
