"""A problem's cost in parts: what does not vary, constant matrices, and scalar instructions."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import casadi as cs
import numpy as np
from scipy.linalg import block_diag

from workbench.arrays import Array, Index
from workbench.blocks.batched import scalar
from workbench.blocks.products import LEAST, Before, taken_out, without_repeats
from workbench.problem.graph import Graph

EXPANDED_UP_TO = 100_000  # instructions


@dataclass(frozen=True, eq=False)
class Parted:
    """The cost 0.5 |r|^2 as a function of the numbers z (k,) that vary.

    Attributes:
        still: (x, fixed) to the numbers that the cost takes beside z, which z does not change.
        cost: (z, still) to the cost, or (z, still, w, y) where `before` has made w and y.
        before: the product, where there is one.
    """

    still: cs.Function
    cost: cs.Function
    before: Before | None

    def numbers(self, x: Array, fixed: Array) -> Array:
        """What z does not change, flat."""
        return np.asarray(self.still(np.concatenate([x, fixed]))).ravel()

    @property
    def instructions(self) -> int:
        """The scalar instructions of all parts that vary."""
        more = 0 if self.before is None else self.before.function.n_instructions()
        return int(self.cost.n_instructions() + more)


def parted(graph: Graph, places: Index, products: bool) -> Parted | None:
    """The cost of a graph by z, which stands at these places of x; None for too long a graph.

    With `products`, large constant matrices are taken out, as far as z changes what they multiply.
    """
    cost = 0.5 * cs.sumsqr(cs.densify(graph.residual))
    out, left = taken_out(cost, [graph.x, graph.fixed]) if products else ([], cost)
    given = [graph.x, graph.fixed, *(one.result for one in out)]
    operands = cs.vertcat(cs.MX(0, 1), *(one.operand for one in out))
    f = scalar(cs.Function("cost", given, [left, operands]), EXPANDED_UP_TO)
    if f is None:
        return None
    z, x = cs.SX.sym("z", len(places)), cs.SX.sym("x", graph.x.numel())
    fixed, put = cs.SX.sym("fixed", graph.fixed.numel()), cs.SX(x)
    put[places.tolist()] = z
    matrix = block_diag(*(one.matrix for one in out)) if out else np.zeros((0, 0))
    zeros = [cs.SX(one.result.numel(), 1) for one in out]
    u = f(put, fixed, *zeros)[1]
    varies = np.array(cs.which_depends(u, z, 1, True), dtype=bool) if out else np.zeros(0, bool)
    if np.count_nonzero(matrix[:, varies]) < LEAST:
        varies[:] = False
    moved = matrix[:, varies].any(axis=1)  # rows; all others stay what they are
    once, stands_for, sign = without_repeats(matrix[np.ix_(moved, varies)])
    y = cs.SX.sym("y", len(once))
    shift = np.concatenate([np.zeros(0), *(one.shift for one in out)])
    same = np.flatnonzero(~varies).tolist()
    results = cs.DM(shift) + cs.sparsify(cs.DM(matrix[:, ~varies])) @ u[same]
    results[np.flatnonzero(moved).tolist()] += cs.DM(sign) * y[stands_for.tolist()]
    c = f(put, fixed, *_split(results, [one.result.numel() for one in out]))[0]
    parts = cs.cse(cs.vertcat(c, u[np.flatnonzero(varies).tolist()]))
    symbols, made, left = _made_first(parts, cs.vertcat(x, fixed), trivial=True)
    still = cs.Function("still", [cs.vertcat(x, fixed)], [made])
    if not varies.any():
        return Parted(still, cs.Function("cost", [z, symbols], [cs.densify(left)]), None)
    w, made, last = _made_first(left[0], cs.vertcat(z, symbols))
    return Parted(
        still,
        cs.Function("cost", [z, symbols, w, y], [cs.densify(last)]),
        Before(
            cs.Function("before", [z, symbols], [cs.densify(left[1:]), made]),
            matrix[np.ix_(moved, varies)][once],
        ),
    )


def _made_first(parts: cs.SX, of: cs.SX, trivial: bool = False) -> tuple[cs.SX, cs.SX, cs.SX]:
    """Symbols for what depends on `of` alone, what they stand for, and the parts in these symbols.

    With `trivial`, entries of `of` that stand alone get symbols too.
    """
    left, symbols, made = cs.extract_parametric(parts, of, {"extract_trivial": trivial})
    column = cs.SX(0, 1)
    return cs.vertcat(column, *symbols), cs.densify(cs.vertcat(column, *made)), left


def _split(column: cs.SX, sizes: Sequence[int]) -> list[cs.SX]:
    edges = np.cumsum([0, *sizes]).tolist()
    return [column[a:b] for a, b in pairwise(edges)]
