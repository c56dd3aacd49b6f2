"""What may be exchanged without changing a residual: the terms of a sum, the units of a layer.

Such a symmetry is discrete. It takes no rank away, but every minimum then has equals elsewhere.
"""

from itertools import pairwise

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Layout, Values
from workbench.problem import Problem

MOST = 8  # rows, and numbers in all below
SMALL = 400
NEW = 1e-6  # of the unknowns: what an exchange moves outside the null space
SAME = 1e-9  # of the residuals: changed by less they are the same


def exchanges(problem: Problem, values: Values, null: Array) -> tuple[tuple[str, ...], ...]:
    """Groups of free blocks whose rows may be exchanged, together, in any order.

    An exchange that only moves along the null space, spanned by the columns of `null` (n, d), is
    left out: it says nothing new.
    """
    free = problem.free
    if free.size > SMALL or problem.trees:
        return ()
    x, fixed = problem.split(values)
    before = problem.residual(x, fixed)
    by_count: dict[int, list[str]] = {}
    for block in free.blocks:
        if block.whole is None and block.shape and 1 < block.shape[0] <= MOST:
            by_count.setdefault(block.shape[0], []).append(block.name)
    groups = [tuple(names) for names in by_count.values()]
    groups += [(name,) for names in by_count.values() if len(names) > 1 for name in names]
    found: list[tuple[str, ...]] = []
    for group in groups:
        if any(set(group) <= set(one) for one in found):
            continue
        count = free[group[0]].shape[0]
        others = [_exchanged(free, x, group, i, j) for i, j in pairwise(range(count))]
        new = (
            np.linalg.norm(y - x - null @ (null.T @ (y - x))) > NEW * np.linalg.norm(x)
            for y in others
        )
        if any(new) and all(
            np.linalg.norm(problem.residual(y, fixed) - before)
            <= SAME * (1.0 + float(np.linalg.norm(before)))
            for y in others
        ):
            found.append(group)
    return tuple(found)


def _exchanged(free: Layout, x: Array, group: tuple[str, ...], i: int, j: int) -> Array:
    y = x.copy()
    for name in group:
        rows = y[free.slices[name]].reshape(free[name].shape[0], -1)
        rows[[i, j]] = rows[[j, i]]
    return y
