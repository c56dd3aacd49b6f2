"""Gauges of matrix products: one factor is changed, and the next factor undoes it.

In B A, with A (h, n) and B (k, h), an invertible matrix may be put between the two. Where columns
of B also have an offset of their own, B A + c, an amount may be added to a column of B and taken
from c. Both are what coefficients and their components leave open, as in the factors of a
principal component analysis.
"""

from collections.abc import Iterator, Set
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Layout
from workbench.diagnostics.gauge_names import named_gauge, single_gauge
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.diagnostics.undoing import Unseen, places_of, undone

MOST = 600  # numbers in the matrix between two factors


@dataclass(frozen=True, eq=False)
class FactorGauge:
    """A change of one factor that the next one undoes, and the names of the two."""

    motion: NamedSubspace
    blocks: tuple[str, str]


def factor_gauges(free: Layout, x: Array, unseen: Unseen) -> Iterator[FactorGauge]:
    """Rows of one matrix are mixed, and columns of the next mixed back."""
    plain = [b for b in free.blocks if len(b.shape) == 2 and b.whole is None]
    for first in plain:
        for second in plain:
            h = first.shape[0]
            if first is second or second.shape[1] != h or h * h > MOST:
                continue
            at_a, at_b = places_of(free, first), places_of(free, second)
            A, B = x[at_a].reshape(first.shape), x[at_b].reshape(second.shape)
            for i, j in sorted(np.ndindex(h, h), key=lambda ij: ij[0] != ij[1]):
                E = np.zeros((h, h))
                E[i, j] = 1.0
                v = np.zeros(free.size)
                v[at_a], v[at_b] = (E @ A).ravel(), -(B @ E).ravel()
                row = f"row {i} of {first.name}"
                said = f"a factor of {row}" if i == j else f"row {j} of {first.name} added to {row}"
                within = unseen.within(v) if v.any() else None
                if within is not None:
                    kind = "scale" if i == j else "mixing"
                    name = f"{said}, undone by {second.name}"
                    yield FactorGauge(single_gauge(kind, name, within), (first.name, second.name))


def column_offsets(
    free: Layout, unseen: Unseen, island: Index, factored: Set[str]
) -> Iterator[NamedSubspace]:
    """An amount is added to a column of a factor, and unknowns of the island undo it."""
    for block in [b for b in free.blocks if b.name in factored]:
        at = places_of(free, block)
        others = np.setdiff1d(island, at)
        if not np.isin(at, island).all():
            continue
        for k in range(block.shape[1]):
            column = np.zeros((free.size, 1))
            column[at[k :: block.shape[1]]] = 1.0
            for v, _ in undone(column, others, unseen):
                said = f"a common offset of column {k}"
                yield named_gauge("offset", said, v, free, [block], least=unseen.same)
