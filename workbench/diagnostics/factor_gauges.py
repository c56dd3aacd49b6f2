"""Gauges of matrix products: one factor is changed, and the next factor undoes it.

In B A, with A (h, n) and B (k, h), an invertible matrix may be put between the two. Where there is
an offset as well, B A + c, an amount may be added to a column of B and taken from c; and in
B (A + a) + c to a. Both are what coefficients and their components leave open, as in the factors of
a principal component analysis.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations, permutations

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout
from workbench.diagnostics.gauge_names import named_gauge, single_gauge
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.diagnostics.things import in_space
from workbench.diagnostics.undoing import (
    CLOSE,
    Field,
    Unseen,
    nothing,
    only,
    places,
    places_of,
    undone,
    undone_by_few,
)

MOST = 600  # numbers in the matrix between two factors


@dataclass(frozen=True, eq=False)
class FactorGauge:
    """A change of one factor that the next one undoes, the names of the two, and what is between.

    `size` is h, how many columns the one and rows the other has; 0 for two vectors.
    """

    motion: NamedSubspace
    blocks: tuple[str, str]
    size: int = 0


def factor_gauges(free: Layout, unseen: Unseen) -> Iterator[FactorGauge]:
    """Rows of one matrix are mixed, and columns of the next mixed back; all else may take part.

    Where the product is A B', with a row of each for a row and a column of it, columns of both are
    mixed; numbers with a unit of length are then points, and no factors. Two vectors are the
    factors of a matrix of rank one.
    """
    yield from _through_all(free, unseen)
    blocks = [b for b in free.blocks if b.whole is None]
    wide = [b for b in blocks if len(b.shape) == 2]
    for first, second in permutations(wide, 2):
        if second.shape[1] == first.shape[0]:
            yield from _mixed(free, unseen, first, second, by_columns=False)
    for first, second in combinations([b for b in wide if b.unit == "1"], 2):
        if first.shape[1] == second.shape[1]:
            yield from _mixed(free, unseen, first, second, by_columns=True)
    for first, second in combinations([b for b in blocks if len(b.shape) == 1], 2):
        at = np.concatenate([places_of(free, first), places_of(free, second)])
        signs = np.repeat([1.0, -1.0], [first.size, second.size])
        field = only(at, free.size, partial(_in_proportion, signs=signs))
        if not all(unseen.x[places_of(free, b)].any() for b in (first, second)):
            continue
        for v, _ in undone(field, at[:0], unseen):
            name = f"a common factor of {first.name}, undone by {second.name}"
            yield FactorGauge(single_gauge("scale", name, v), (first.name, second.name))


def _in_proportion(x: Array, signs: Array) -> Array:
    return (signs * x)[:, None]


@dataclass(frozen=True, eq=False)
class Side:
    """The rows, or the columns, of a block (N, h) of coefficients, which a matrix may mix."""

    block: Block
    what: str
    places: Index

    def moves(self, n: int, x: Array) -> Array:
        """How the unknowns (n,) move if E (h, h) mixes them, for each entry of E: (n, h h)."""
        h = self.places.shape[1]
        found = np.zeros((n, h, h))
        for i, j in np.ndindex(h, h):
            found[self.places[:, j], i, j] = x[self.places[:, i]]
        return found.reshape(n, h * h)


def _sides(free: Layout, h: int) -> list[Side]:
    """The rows and columns of h, of blocks that are no points."""
    found = []
    for b in [b for b in free.blocks if b.whole is None and len(b.shape) == 2]:
        at = places_of(free, b).reshape(b.shape)
        if b.shape[0] == h:
            found.append(Side(b, "row", at.T))
        if b.shape[1] == h and not (in_space(b) and b.unit != "1"):
            found.append(Side(b, "column", at))
    return found


def _through_all(free: Layout, unseen: Unseen) -> Iterator[FactorGauge]:
    """One matrix mixes the rows and columns of several blocks at once, and nothing else moves.

    So the state of a linear system may be measured along any axes: A, B and C become T A T^-1, T B
    and C T^-1.
    """
    sizes = {h for b in free.blocks if len(b.shape) == 2 for h in b.shape}
    for h in sorted(sizes - {1}) if unseen.nearby else ():
        sides = _sides(free, h)
        if len(sides) < 2 or len(sides) * h * h > MOST:
            continue
        # entries of E for each side; the rows and columns of one size are found together

        def moves(x: Array, sides: Sequence[Side] = sides) -> Array:
            return np.hstack([side.moves(free.size, x) for side in sides])

        lengths = np.linalg.norm(moves(unseen.x), axis=0)
        lengths[lengths == 0] = 1.0
        C = nothing(unseen.missed(moves, lengths), unseen.same) / lengths[:, None]
        for k, side in enumerate(sides):
            own = slice(k * h * h, (k + 1) * h * h)
            for i, j in sorted(np.ndindex(h, h), key=lambda ij: ij[0] != ij[1]):
                wanted = np.zeros(h * h)
                wanted[i * h + j] = 1.0
                c = C @ np.linalg.lstsq(C[own], wanted)[0] if C.shape[1] else np.zeros(len(C))
                if np.linalg.norm(c[own] - wanted) > CLOSE:
                    continue
                v = moves(unseen.x) @ np.where(abs(c) > CLOSE, c, 0.0)
                inside = np.where(v == 0, 0.0, unseen.basis @ (unseen.basis.T @ v))
                others = [b for b in free.blocks if inside[free.slices[b.name]].any()]
                if not v.any() or len(others) < 2:
                    continue
                said = f"{side.what} {i} added to {side.what} {j}" if i != j else ""
                said = said or f"a factor of {side.what} {i}"
                kind = "scale" if i == j else "mixing"
                motion = named_gauge(kind, said, inside, free, [side.block], least=unseen.same)
                second = next(b for b in others if b is not side.block)
                yield FactorGauge(motion, (side.block.name, second.name), h)


def _mixed(
    free: Layout, unseen: Unseen, first: Block, second: Block, *, by_columns: bool
) -> Iterator[FactorGauge]:
    """The changes of E A that B undoes, in B A; or in A B', where columns are mixed, of A E."""
    at = np.concatenate([places_of(free, first), places_of(free, second)])
    h = first.shape[1] if by_columns else first.shape[0]
    what = "column" if by_columns else "row"
    if h * h > MOST:
        return

    def moves(x: Array, i: int, j: int) -> Array:
        A, B = x[: first.size].reshape(first.shape), x[first.size :].reshape(second.shape)
        E = np.zeros((h, h))
        E[i, j] = 1.0
        one = (E @ A.T).T if by_columns else E @ A
        return np.concatenate([one.ravel(), -(B @ E).ravel()])[:, None]

    rest = np.setdiff1d(np.arange(free.size), at)
    for i, j in sorted(np.ndindex(h, h), key=lambda ij: ij[0] != ij[1]):
        own = f"{what} {i} of {first.name}"
        said = f"a factor of {own}" if i == j else f"{what} {j} of {first.name} added to {own}"
        field = only(at, free.size, partial(moves, i=i, j=j))
        for v, _ in undone(field, rest, unseen):
            if v[rest].any() and _without_second(field, at[: first.size], rest, unseen):
                continue  # it is the rest that undoes this, and not the second
            kind = "scale" if i == j else "mixing"
            motion = single_gauge(kind, f"{said}, undone by {second.name}", v)
            yield FactorGauge(motion, (first.name, second.name), h)


def _without_second(field: Field, first: Index, rest: Index, unseen: Unseen) -> bool:
    """Whether the rest undoes what a field does at the first places alone."""

    def alone(x: Array) -> Array:
        v = np.zeros((len(x), 1))
        v[first] = field(x)[first]
        return v

    return any(True for _ in undone(alone, rest, unseen))


def offsets_of_factors(
    free: Layout, unseen: Unseen, island: Index, factors: Sequence[FactorGauge]
) -> Iterator[NamedSubspace]:
    """An amount is added to a column of a factor, or to what is added to the columns' product.

    Unknowns of the island that are no factors themselves undo it: one block, where it suffices.
    """
    factored = {name for factor in factors for name in factor.blocks}
    hidden = {(factor.size,) for factor in factors if factor.size}
    inside = [b for b in free.blocks if np.isin(places_of(free, b), island).all()]
    rest = places(free, [b for b in inside if b.name not in factored])
    for block in [b for b in inside if b.name in factored or b.shape in hidden]:
        at = places_of(free, block)
        others = np.setdiff1d(rest, at)
        choices = [np.intersect1d(others, places_of(free, b)) for b in inside]
        choices = [some for some in choices if some.size]
        bias = block.name not in factored
        wide = block.size if bias else block.shape[-1] if len(block.shape) > 1 else 1
        what = "an offset of entry {}" if bias else "a common offset of column {}"
        what = what if wide > 1 else "a common offset"
        for k in range(wide) if others.size else ():
            one = at[k::wide]
            if unseen.nearby and one.size > 1 and not unseen.fixed(one):
                continue
            field = only(one, free.size, lambda x: np.ones((len(x), 1)))
            for v, _ in undone_by_few(field, choices, unseen):
                yield named_gauge("offset", what.format(k), v, free, [block], least=unseen.same)
