"""Gauges of matrices of coefficients: columns, or rows, are scaled, mixed and shifted.

A E, with A (N, h), is undone by other unknowns for matrices E (h, h) of some space, the same at
every point. Which space this is says what A is: all E belong to a factor of a product, diagonal
ones to a factor before something nonlinear or to a channel with a gain, skew ones to axes that
nothing fixes. What changes one row or one column comes first, for whole matrices may hide it: where
every row has a factor of its own, this may be any function of the row.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout
from workbench.diagnostics.gauge_names import named_gauge
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.diagnostics.undoing import (
    CLOSE,
    Found,
    Unseen,
    common,
    only,
    places_of,
    undoing,
    undone_maps,
    with_fewer,
)

MOST = 600  # numbers in the matrix E
LARGEST = 400  # rows, or columns, of which factors are looked for


@dataclass(frozen=True, eq=False)
class Maps:
    """The motions A E and A + 1 c' of a matrix A (N, h) that others undo, or those of its rows.

    Attributes:
        free: the free numbers.
        unseen: the motions that no residual notices.
        block: the block.
        what: `row`, or `column`.
        units: (n,) in which motions are told.
        points: whether the block's rows are points: these turn together, so that no columns are
            looked at, and rows are only scaled.
        found: what was found before, which is not told again with other unknowns to undo it.
        again: whether it is, with the last of these, when other names were tried.
    """

    free: Layout = field(repr=False)
    unseen: Unseen = field(repr=False)
    block: Block
    what: str
    units: Array = field(repr=False)
    points: bool
    found: Found = field(repr=False)
    again: bool = False

    @property
    def size(self) -> int:
        """h, how many rows or columns there are."""
        return self.block.shape[0 if self.what == "row" else 1]

    @cached_property
    def places(self) -> Index:
        """The places of A, row by row."""
        at = places_of(self.free, self.block).reshape(self.block.shape)
        return (at.T if self.what == "row" else at).ravel()

    @cached_property
    def pairs(self) -> list[tuple[int, int]]:
        """The entries of E: its diagonal first."""
        h = self.size
        mixed = not self.points and h * h <= MOST
        off = [(i, j) for i, j in np.ndindex(h, h) if i != j] if mixed else []
        return [(i, i) for i in range(h)] + off

    def _moves(self, x: Array) -> Array:
        h, count = self.size, len(self.pairs)
        A = x.reshape(-1, h)
        found = np.zeros((len(A), h, count + (0 if self.points else h)))
        for k, (i, j) in enumerate(self.pairs):
            found[:, j, k] = A[:, i]
        for k in range(found.shape[2] - count):
            found[:, k, count + k] = 1 / self.units[self.places[0]]
        return found.reshape(-1, found.shape[2])

    @cached_property
    def undone(self) -> tuple[Array, Callable[[Array], Array]] | None:
        """The coefficients (g, q) of the maps that others undo, and the whole motions of them.

        These are undone by as few blocks as may be.
        """
        shape, at = self.block.shape, self.places if len(self.block.shape) == 2 else None
        if at is None or min(shape) < 2 or not self.unseen.fixed(at) or self.size > LARGEST:
            return None
        if self.points and self.what == "column":
            return None
        others = np.setdiff1d(np.arange(self.free.size), at)
        field = only(at, self.free.size, self._moves)
        Q, whole = undoing(field, others, self.unseen)
        if not Q.shape[1] or not self.unseen.nearby or self.unseen.undone_in_one_way(at):
            return (Q, whole) if Q.shape[1] else None
        choices = [places_of(self.free, b) for b in self.free.blocks if b is not self.block]
        choices = choices[::-1] if self.again else choices
        return Q, lambda a: with_fewer(field, choices, a, self.unseen)

    def single(self) -> Iterator[NamedSubspace]:
        """Factors and common offsets of one row, or of one column."""
        if self.undone is not None:
            yield from self._named(_of_one(self.undone[0], self.size, len(self.pairs), self.what))

    def added(self) -> Iterator[NamedSubspace]:
        """One row, or one column, is added to another."""
        if self.undone is not None:
            yield from self._named(_added(self.undone[0], self.size, self.pairs, self.what))

    def mixed(self) -> Iterator[NamedSubspace]:
        """All others: rotations, factors of all, any linear maps."""
        if self.undone is not None:
            yield from self._named(_of_several(self.undone[0], self.size, self.pairs, self.what))

    def _named(self, found: Iterator[tuple[str, str, Array]]) -> Iterator[NamedSubspace]:
        assert self.undone is not None
        at = self.places
        moves = self._moves(self.unseen.x[at])
        for kind, said, a in found:
            if not self.again and self.found.does(moves @ a, at):
                continue
            if (v := self.undone[1](a)).any():
                yield named_gauge(kind, said, v, self.free, [self.block], least=self.unseen.same)


def _of_one(Q: Array, h: int, count: int, what: str) -> Iterator[tuple[str, str, Array]]:
    """Coefficients (g,) in the space Q (g, q) of maps of one column: kind, words, coefficients."""
    unit = np.eye(len(Q))
    for k in np.flatnonzero(undone_maps(Q, unit[:, :h])):
        yield "scale", f"a factor of {what} {k}", unit[k]
    for k in np.flatnonzero(undone_maps(Q, unit[:, count:])):
        yield "offset", f"a common offset of {what} {k}", unit[count + k]


def _added(
    Q: Array, h: int, pairs: list[tuple[int, int]], what: str
) -> Iterator[tuple[str, str, Array]]:
    """Coefficients (g,) in the space Q (g, q) of maps that add one column to another."""
    unit = np.eye(len(Q))
    for k in np.flatnonzero(undone_maps(Q, unit[:, h : len(pairs)])):
        i, j = pairs[h + k]
        yield "mixing", f"{what} {i} added to {what} {j}", unit[h + k]


def _of_several(
    Q: Array, h: int, pairs: list[tuple[int, int]], what: str
) -> Iterator[tuple[str, str, Array]]:
    """Coefficients (g,) that span the rest of Q (g, q), each with its kind and its words."""
    unit, count = np.eye(len(Q)), len(pairs)
    place = {pair: k for k, pair in enumerate(pairs)}
    same = unit[:, :h].sum(axis=1)
    if undone_maps(Q, same[:, None])[0]:
        yield "scale", "a common factor", same
    for a in common(Q, unit[:, :h]).T:
        yield "scale", f"factors of the {what}s", a
    if count > h:
        planes = [*combinations(range(h), 2)]
        turns = np.column_stack([unit[place[i, j]] - unit[place[j, i]] for i, j in planes])
        turns /= 2**0.5
        for k in np.flatnonzero(undone_maps(Q, turns)):
            i, j = planes[k]
            yield "rotation", f"a rotation of {what}s {i} and {j}", turns[:, k]
        for a in common(Q, turns).T:
            yield "rotation", f"a rotation of the {what}s", a
    for a in common(Q, unit[:, count:]).T:
        yield "offset", f"offsets of the {what}s", a
    for a in Q.T:
        if count > h and _turns(a, h, pairs):
            yield "rotation", f"a rotation of the {what}s along ellipses", a
        yield "mixing", f"a linear map of the {what}s", a


def _turns(a: Array, h: int, pairs: list[tuple[int, int]]) -> bool:
    """Whether a map leads along closed curves: E has imaginary eigenvalues, and nothing shifts.

    It is then a rotation of other axes, such as those of a covariance that is told.
    """
    E = np.zeros((h, h))
    E[tuple(np.array(pairs).T)] = a[: len(pairs)]
    values = np.linalg.eigvals(E)
    size = float(abs(values.imag).max(initial=0.0))
    return bool(size > 0.01 * np.linalg.norm(a) and (abs(values.real) < CLOSE * size).all()) and (
        float(np.linalg.norm(a[len(pairs) :])) < CLOSE
    )
