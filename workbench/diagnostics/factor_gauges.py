"""Gauges of matrix products: one factor is changed, and the next factor undoes it.

In B A, with A (h, n) and B (k, h), an invertible matrix may be put between the two. Where there is
an offset as well, B A + c, an amount may be added to a column of B and taken from c; and in
B (A + a) + c to a. Both are what coefficients and their components leave open, as in the factors of
a principal component analysis.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout
from workbench.diagnostics.gauge_names import named_gauge, single_gauge
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.diagnostics.undoing import Unseen, places_of, undone

MOST = 600  # numbers in the matrix between two factors


@dataclass(frozen=True, eq=False)
class FactorGauge:
    """A change of one factor that the next one undoes, the names of the two, and what is between.

    `size` is h, how many columns the one and rows the other has; 0 for two vectors.
    """

    motion: NamedSubspace
    blocks: tuple[str, str]
    size: int = 0


def factor_gauges(free: Layout, x: Array, unseen: Unseen) -> Iterator[FactorGauge]:
    """Rows of one matrix are mixed, and columns of the next mixed back; all else may take part.

    Where the product is A B', with a row of each for a row and a column of it, columns of both are
    mixed; numbers with a unit of length are then points, and no factors. Two vectors are the
    factors of a matrix of rank one.
    """
    blocks = [b for b in free.blocks if b.whole is None]
    wide = [b for b in blocks if len(b.shape) == 2]
    for first, second in permutations(wide, 2):
        if second.shape[1] == first.shape[0]:
            yield from _mixed(free, x, unseen, first, second, by_columns=False)
    for first, second in combinations([b for b in wide if b.unit == "1"], 2):
        if first.shape[1] == second.shape[1]:
            yield from _mixed(free, x, unseen, first, second, by_columns=True)
    for first, second in combinations([b for b in blocks if len(b.shape) == 1], 2):
        change = np.zeros(free.size)
        at_a, at_b = places_of(free, first), places_of(free, second)
        change[at_a], change[at_b] = x[at_a], -x[at_b]
        both = x[at_a].any() and x[at_b].any()
        if both and (within := unseen.within(change)) is not None:
            name = f"a common factor of {first.name}, undone by {second.name}"
            yield FactorGauge(single_gauge("scale", name, within), (first.name, second.name))


def _mixed(
    free: Layout, x: Array, unseen: Unseen, first: Block, second: Block, *, by_columns: bool
) -> Iterator[FactorGauge]:
    """The changes of E A that B undoes, in B A; or in A B', where columns are mixed, of A E."""
    at_a, at_b = places_of(free, first), places_of(free, second)
    A, B = x[at_a].reshape(first.shape), x[at_b].reshape(second.shape)
    A = A.T if by_columns else A
    h, what = len(A), "column" if by_columns else "row"
    if h * h > MOST:
        return
    rest = np.setdiff1d(np.arange(free.size), np.concatenate([at_a, at_b]))
    for i, j in sorted(np.ndindex(h, h), key=lambda ij: ij[0] != ij[1]):
        E = np.zeros((h, h))
        E[i, j] = 1.0
        one = (E @ A).T if by_columns else E @ A
        v = np.zeros((free.size, 1))
        v[at_a, 0], v[at_b, 0] = one.ravel(), -(B @ E).ravel()
        own = f"{what} {i} of {first.name}"
        said = f"a factor of {own}" if i == j else f"{what} {j} of {first.name} added to {own}"
        for w, _ in undone(v, rest, unseen) if v.any() else ():
            kind = "scale" if i == j else "mixing"
            motion = single_gauge(kind, f"{said}, undone by {second.name}", w)
            yield FactorGauge(motion, (first.name, second.name), h)


def offsets_of_factors(
    free: Layout, unseen: Unseen, island: Index, factors: Sequence[FactorGauge]
) -> Iterator[NamedSubspace]:
    """An amount is added to a column of a factor, or to what is added to the columns' product.

    Unknowns of the island that are no factors themselves undo it.
    """
    factored = {name for factor in factors for name in factor.blocks}
    hidden = {(factor.size,) for factor in factors if factor.size}
    inside = [b for b in free.blocks if np.isin(places_of(free, b), island).all()]
    rest = [places_of(free, b) for b in inside if b.name not in factored]
    for block in [b for b in inside if b.name in factored or b.shape in hidden]:
        at = places_of(free, block)
        others = np.setdiff1d(np.concatenate([np.zeros(0, dtype=np.int64), *rest]), at)
        bias = block.name not in factored
        wide = block.size if bias else block.shape[-1] if len(block.shape) > 1 else 1
        what = "an offset of entry {}" if bias else "a common offset of column {}"
        what = what if wide > 1 else "a common offset"
        for k in range(wide) if others.size else ():
            column = np.zeros((free.size, 1))
            column[at[k::wide]] = 1.0
            for v, _ in undone(column, others, unseen):
                yield named_gauge("offset", what.format(k), v, free, [block], least=unseen.same)
