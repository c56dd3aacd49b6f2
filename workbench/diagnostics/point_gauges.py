"""Gauges of points: similarities, stretches and shears, and projective maps.

What is a point, and what a row of coefficients, no shape of an array tells. The motions tell it
that are undone: points with a unit of length may be shifted, or turn without being scaled along
an axis; a projective map acts on points alone. Numbers without a unit of which each column has a
factor of its own are coefficients, which `matrix_gauges` names.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import combinations

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout
from workbench.diagnostics.gauge_names import named_gauge
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.diagnostics.projective_gauges import moves_of_infinity
from workbench.diagnostics.similarities import named_steps, similarity, stretches
from workbench.diagnostics.things import LENGTHS, in_space
from workbench.diagnostics.undoing import (
    CLOSE,
    SAME,
    Found,
    Unseen,
    common,
    only,
    places_of,
    undoing,
    undone,
    undone_maps,
    with_fewer,
)


@dataclass(frozen=True, eq=False)
class Cloud:
    """What may be points: rows of a block, blocks of a point each, or a block for each coordinate.

    Attributes:
        blocks: the blocks.
        places: (N, d) the places of the coordinates among the free numbers.
        own: those of a part of one block; None for whole blocks.
    """

    blocks: tuple[Block, ...]
    places: Index = field(repr=False)
    own: Index | None = field(default=None, repr=False)

    @property
    def enough(self) -> int:
        """How many ways to move others must not undo, if a motion that they undo is to say much."""
        return 1 if len(self.blocks) == 1 else self.places.shape[1]


def clouds(free: Layout, island: Index) -> Iterator[Cloud]:
    """What may be points among the unknowns that rows tie together, the largest block first."""
    whole = [b for b in free.blocks if np.isin(places_of(free, b), island).all()]
    for block in sorted([b for b in free.blocks if in_space(b)], key=lambda b: -b.size):
        own = np.intersect1d(island, places_of(free, block))
        if len(own) > block.shape[-1]:
            yield Cloud((block,), own.reshape(-1, block.shape[-1]), own)
    lengths = [b for b in whole if b.unit in LENGTHS[1:] and len(b.shape) == 1]
    for d in (2, 3):
        single = [b for b in lengths if b.shape == (d,)]
        if len(single) > 1:
            yield Cloud(tuple(single), np.array([places_of(free, b) for b in single]))
    for size in sorted({b.size for b in lengths}):
        alike = [b for b in lengths if b.size == size]
        if len(alike) in (2, 3) and size > 3:
            columns = np.column_stack([places_of(free, b) for b in alike])
            yield Cloud(tuple(alike), columns)


def are_points(cloud: Cloud, unseen: Unseen, others: Index) -> bool:
    """Whether the motions that the others undo are such as points have, and not coefficients.

    Of the linear maps, translations and moves of the plane at infinity those are found that others
    undo at every point. Rows are points if a projective map is among them. With a unit of length
    they are unless all linear maps are, and no translation; without one, if a rotation is, and no
    factor of a single column.
    """
    d = cloud.places.shape[1]

    def moves(x: Array) -> Array:
        X = x.reshape(-1, d)
        linear = [(X[:, i : i + 1] * np.eye(d)[j]).ravel() for i, j in np.ndindex(d, d)]
        shifts = [np.broadcast_to(axis, X.shape).ravel() for axis in np.eye(d)]
        return np.column_stack([*linear, *shifts, *(v for _, v in moves_of_infinity(X))])

    Q, _ = undoing(only(cloud.places.ravel(), len(unseen.x), moves), others, unseen)
    unit = np.eye(len(Q))
    linear, shifts, infinity = unit[:, : d * d], unit[:, d * d : -d], unit[:, -d:]
    if undone_maps(Q, infinity).any():
        return True
    if cloud.blocks[0].unit != "1":
        return not undone_maps(Q, linear).all() or bool(undone_maps(Q, shifts).any())
    pairs = combinations(range(d), 2)
    turns = np.column_stack([unit[i * d + j] - unit[j * d + i] for i, j in pairs]) / 2**0.5
    about_any_point = common(Q, np.column_stack([turns, shifts]))
    own_factors = undone_maps(Q, linear[:, :: d + 1])
    return not own_factors.any() and bool(np.linalg.norm(turns.T @ about_any_point) > CLOSE)


def point_gauges(
    cloud: Cloud,
    free: Layout,
    unseen: Unseen,
    found: Found,
    others: Index,
    units: Array,
    *,
    again: bool = False,
) -> Iterator[NamedSubspace]:
    """Similarities of the rows, which all others may undo.

    What moves the rows as a motion before did is told only `again`, when other names were tried: a
    frame of its own turns by itself as well as with the world.
    """
    own, d = cloud.places.ravel(), cloud.places.shape[1]
    n, x = free.size, unseen.x
    size = float(np.sqrt(np.mean(x[own] ** 2))) or 1.0  # so that no unit matters
    steps = only(own, n, lambda at: similarity(at.reshape(-1, d) / size))
    coefficients, whole = undoing(steps, others, unseen)
    moves = steps(x)
    main = list(cloud.blocks)
    choices = [np.intersect1d(others, places_of(free, b)) for b in free.blocks]
    choices = [some for some in choices if some.size]
    choices = choices[::-1] if again else choices  # so that others are left out
    only_way = not unseen.nearby or not choices or unseen.undone_in_one_way(own)
    for step in named_steps(coefficients, d, size * units[own[0]]):
        a = step.coefficients
        if not again and found.does((moves @ a)[own], own):
            continue
        v = whole(a) if only_way else with_fewer(steps, choices, a, unseen)
        if np.linalg.norm(moves @ a) <= SAME or not v.any():
            continue  # such as a turn of points about the line on which they all lie
        same = (x / size, a) if main[0].shape[-1] == d else None
        yield named_gauge(step.kind, step.name, v, free, main, cloud.own, same, least=unseen.same)


def bending_gauges(
    cloud: Cloud, free: Layout, unseen: Unseen, others: Index
) -> Iterator[NamedSubspace]:
    """Stretches and shears of the rows, and then projective maps."""
    own, d = cloud.places.ravel(), cloud.places.shape[1]
    X = unseen.x[own].reshape(-1, d)
    for kind, maps in (("mixing", stretches), ("projective", moves_of_infinity)):
        for k, (said, _) in enumerate(maps(X)):
            along = only(own, free.size, partial(_map, maps=maps, k=k, d=d))
            for v, _ in undone(along, others, unseen):
                main = list(cloud.blocks)
                yield named_gauge(kind, said, v, free, main, cloud.own, least=unseen.same)


def _map(at: Array, maps: Callable[[Array], Iterable[tuple[str, Array]]], k: int, d: int) -> Array:
    """The motion (N d, 1) of points by map number k of several."""
    return [*maps(at.reshape(-1, d))][k][1][:, None]
