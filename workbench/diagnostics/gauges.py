"""Gauges: what a problem is invariant to, by name, before any other name is looked for.

Rows of points may move by a similarity (translations, rotations and a scale), rows of numbers by a
common offset or a common factor, and a factor of a matrix product by a matrix that the next factor
undoes; points that cameras see as matrices may be mapped projectively. Such a motion is a gauge
where the other unknowns can undo it: where some of their changes, together with it, lie in the null
space. This is a linear question, whatever the form in which cameras are written. Of all changes
that undo it the smallest is taken.

Triggs et al., Bundle adjustment - a modern synthesis (2000), section 9, treats gauges in general.
"""

from collections.abc import Callable, Iterator, Sequence, Set
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csc_array

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout, Values
from workbench.diagnostics.factor_gauges import factor_gauges, offsets_of_factors
from workbench.diagnostics.gauge_names import named_gauge
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.diagnostics.projective_gauges import homogeneous_factors, moves_of_infinity
from workbench.diagnostics.similarities import (
    along_axes,
    axis_of,
    named_steps,
    similarity,
    steps_of,
    stretches,
)
from workbench.diagnostics.things import LENGTHS, in_space
from workbench.diagnostics.undoing import (
    SAME,
    Unseen,
    places_of,
    undoing,
    undone,
    undone_alike,
    unit_vectors,
)
from workbench.geometry.rotation import slopes_by_turns
from workbench.problem import Problem
from workbench.problem.nonzeros import tied_columns


@dataclass(frozen=True, eq=False)
class Gauge:
    """A motion that a user declares to be a gauge, where it is not found without.

    Attributes:
        name: what it is called, such as `a translation along x`.
        change: from the values of all blocks to how some of them change, by name and of their
            shapes. All other unknowns may undo it.
    """

    name: str
    change: Callable[[Values], Values]


def gauges(
    problem: Problem,
    values: Values,
    unseen: Unseen,
    pattern: csc_array,
    declared: Sequence[Gauge] = (),
    units: Array | None = None,
) -> Iterator[NamedSubspace]:
    """The gauges of a problem at these values, among the motions that are `unseen`.

    `pattern` (m, n) says which unknowns a row reads: points that no row ties together move
    independently of each other. The motions are told in `units` (n,), the same for all of a block,
    if these are given.
    """
    free = problem.free
    units = np.ones(free.size) if units is None else units
    x = problem.split(values)[0] / units
    for gauge in declared:
        yield from _declared(gauge, free, values, unseen, units)
    mixed = [*factor_gauges(free, x, unseen)]
    yield from (factor.motion for factor in mixed)
    factored = {name for factor in mixed for name in factor.blocks}
    for name, motion in homogeneous_factors(free, x, unseen):
        factored.add(name)
        yield motion
    islands = _islands(free, pattern)
    for island in islands:
        yield from offsets_of_factors(free, unseen, island, mixed)
        yield from _points(free, x, unseen, island, factored, units)
    yield from _bodies(problem, x * units, unseen)
    for island in islands:
        yield from _numbers(free, x, unseen, island, units)
    yield from _sizes(problem, values, x, unseen, units)
    yield from _vectors(problem, x, unseen)


def is_gauge(gauge: Gauge, problem: Problem, values: Values, null: Array) -> bool:
    """Whether a declared motion is one that the other unknowns can undo."""
    units = np.ones(problem.free.size)
    return any(True for _ in _declared(gauge, problem.free, values, Unseen(null), units))


def _declared(
    gauge: Gauge, free: Layout, values: Values, unseen: Unseen, units: Array
) -> Iterator[NamedSubspace]:
    v, moved = np.zeros(free.size), gauge.change(dict(values))
    for name, change in moved.items():
        v[free.slices[name]] = free[name].taken(change).ravel()
    others = [places_of(free, b) for b in free.blocks if b.name not in moved]
    places = np.concatenate([np.zeros(0, dtype=np.int64), *others])
    for w, _ in undone((v / units)[:, None], places, unseen):
        main = [b for b in free.blocks if b.name in moved]
        yield named_gauge("gauge", gauge.name, w, free, main, least=unseen.same)


def _points(
    free: Layout, x: Array, unseen: Unseen, island: Index, factored: Set[str], units: Array
) -> Iterator[NamedSubspace]:
    """Similarities of the rows of a block of points; stretches and shears; projective maps.

    All else in the island may undo them. Rows that a matrix mixes are coefficients and no points,
    and neither are the rows of a matrix that may have any factor.
    """
    blocks = [b for b in free.blocks if in_space(b) and b.size > b.shape[-1]]
    blocks = [b for b in blocks if b.name not in factored]
    for block in sorted(blocks, key=lambda b: -b.size):
        own = np.intersect1d(island, places_of(free, block))
        d = block.shape[-1]
        others = np.setdiff1d(island, own)
        if len(own) <= d:
            continue
        moves = np.zeros((free.size, steps_of(d)))
        size = float(np.sqrt(np.mean(x[own] ** 2))) or 1.0  # so that no unit matters
        X = x[own].reshape(-1, d) / size
        moves[own] = similarity(X)
        coefficients, whole = undoing(moves, others, unseen)
        for step in named_steps(coefficients, d, size * units[own[0]]):
            v = whole(step.coefficients)
            if np.linalg.norm(moves @ step.coefficients) <= SAME or not v.any():
                continue  # such as a turn of points about the line on which they all lie
            same = (x / size, step.coefficients)
            yield named_gauge(step.kind, step.name, v, free, [block], own, same, least=unseen.same)
        if unseen.count > coefficients.shape[1]:
            more = [("mixing", *one) for one in stretches(X)]
            more += [("projective", *one) for one in moves_of_infinity(X)]
            for kind, said, along in more:
                moves = np.zeros((free.size, 1))
                moves[own, 0] = along
                for v, _ in undone(moves, others, unseen):
                    yield named_gauge(kind, said, v, free, [block], own, least=unseen.same)


def _bodies(problem: Problem, x: Array, unseen: Unseen) -> Iterator[NamedSubspace]:
    """A place, a body's root or a frame moves, and other places and turns undo that."""
    free, n = problem.free, problem.free.size
    poses = {name for tree in problem.trees for name in tree.blocks}
    spatial = [b for b in free.blocks if b.size == 3 and b.name not in poses]
    places = [b for b in spatial if b.unit in LENGTHS[1:]]
    turns = [b for b in spatial if b.unit == "rad"]

    def along(
        kind: str, said: str, moves: Array, others: list[Block], main: Block
    ) -> Iterator[NamedSubspace]:
        coefficients, whole = undoing(moves, _places(free, others), unseen)
        for a in along_axes(coefficients, slice(0, 3)):
            v = whole(a)
            if np.linalg.norm(v[_places(free, others)]) > SAME * np.linalg.norm(v):
                name = f"{said} {axis_of(a)}"
                yield named_gauge(kind, name, v, free, [main], least=unseen.same)

    for block in places:
        if others := [b for b in places if b is not block]:
            moves = unit_vectors(places_of(free, block), n)
            yield from along("translation", "a translation along", moves, others, block)
    for tree in problem.trees if turns else ():
        root = tree.entries(0, free)
        if len(root) == 3:
            moves = np.zeros((n, 3))
            moves[root] = slopes_by_turns(x[root])
            main = free.block_of(root[0])[0]
            yield from along("rotation", "a rotation about", moves, spatial, main)
    for block in turns if len(turns) > 1 else ():
        moves, at = np.zeros((n, 3)), places_of(free, block)
        moves[at] = slopes_by_turns(x[at])
        others = [b for b in spatial if b is not block]
        yield from along("rotation", "a rotation about", moves, others, block)


def _numbers(
    free: Layout, x: Array, unseen: Unseen, island: Index, units: Array
) -> Iterator[NamedSubspace]:
    """A common offset or a common factor of a block; other blocks undo it in the same way."""
    parts = [(b, np.intersect1d(island, places_of(free, b))) for b in free.blocks]
    parts = [(b, own) for b, own in parts if own.size]
    for kind, said, number in (
        ("offset", "a common offset", 1 / units),
        ("scale", "a common factor", x),
    ):
        columns = np.zeros((free.size, len(parts)))
        for j, (_, own) in enumerate(parts):
            columns[own, j] = number[own]
        for k, (block, own) in enumerate(parts):
            if not columns[own, k].any() or (
                kind == "offset" and (own.size < 2 or in_space(block))
            ):
                continue
            alike = [j for j, (b, _) in enumerate(parts) if kind == "scale" or b.unit == block.unit]
            able = [j for j in alike if j != k and columns[:, j].any()]
            # all others together, or one of several that can each undo it
            for some in [able, *([j] for j in able if len(able) > 1)]:
                others = columns[:, some] / np.linalg.norm(columns[:, some], axis=0)
                v = undone_alike(columns[:, k], others, unseen)
                if v is None:
                    continue
                amounts = columns.T @ v / np.maximum(np.sum(columns**2, axis=0), 1e-300)
                amounts /= amounts[k]
                moving = np.flatnonzero(abs(amounts) > unseen.same)
                rough = max(1e-5, unseen.same)
                if max(parts[j][1].size for j in moving) < 2 or (
                    kind == "offset" and not np.allclose(abs(amounts[moving]), 1, rtol=rough)
                ):
                    continue
                main = [block, *(parts[j][0] for j in moving if amounts[j] > 0 and j != k)]
                yield named_gauge(kind, said, v, free, main, own, least=unseen.same)
                if len(some) == len(able):
                    break


def _sizes(
    problem: Problem, values: Values, x: Array, unseen: Unseen, units: Array
) -> Iterator[NamedSubspace]:
    """A factor of points whose origin is not the camera: s (p + trans) + t, seen in proportion.

    At twice the factor the residuals are the same with trans + t / (2 s), where t / s is how fast
    trans undoes a relative change of s. This is tried out, for a number without a unit need not be
    a factor.
    """
    free = problem.free
    fixed = problem.split(values)[1]
    others = _places(free, [b for b in free.blocks if b.size == 3 and b.unit in LENGTHS[1:]])
    for block in [b for b in free.blocks if b.size == 1 and b.unit == "1"]:
        at = places_of(free, block)
        if not others.size or not x[at[0]]:
            continue
        for v, _ in undone(x[at[0]] * unit_vectors(at, free.size), others, unseen):
            if not v[at[0]]:
                continue
            v = v * (x[at[0]] / v[at[0]])
            twice = x + v * np.where(np.arange(free.size) == at[0], 1.0, 0.5)
            before, after = (problem.residual(y * units, fixed) for y in (x, twice))
            if np.linalg.norm(after - before) <= SAME * (1.0 + float(np.linalg.norm(before))):
                yield named_gauge("scale", "a scale", v, free, [block], least=unseen.same)


def _vectors(problem: Problem, x: Array, unseen: Unseen) -> Iterator[NamedSubspace]:
    """One vector turns, such as the tool of an arm, and angles undo that."""
    free = problem.free
    poses = {name for tree in problem.trees for name in tree.blocks}
    angles = [b for b in free.blocks if b.unit in ("rad", "deg") and b.name not in poses]
    others = _places(free, angles)
    vectors = [b for b in free.blocks if b.shape in ((2,), (3,)) and b.unit in LENGTHS[1:]]
    for block in vectors if others.size else ():
        at, d = places_of(free, block), block.size
        moves = np.zeros((free.size, steps_of(d) - d - 1))
        moves[at] = similarity(x[at][None])[:, d:-1]
        for v, a in undone(moves, others, unseen):
            if min(np.linalg.norm(v[at]), np.linalg.norm(v[others])) > SAME * np.linalg.norm(v):
                about = "" if d == 2 else f" about {axis_of(a)}"
                yield named_gauge(
                    "rotation", f"a rotation{about}", v, free, [block], least=unseen.same
                )


def _places(free: Layout, blocks: Sequence[Block]) -> Index:
    """The places of the entries of some blocks."""
    return np.concatenate([np.zeros(0, dtype=np.int64), *(places_of(free, b) for b in blocks)])


def _islands(free: Layout, pattern: csc_array) -> list[Index]:
    """The unknowns that rows tie together, directly or through others; points stay whole."""
    group = np.zeros(free.size, dtype=np.int64)
    count = 0
    for block in free.blocks:
        wide = block.shape[-1] if in_space(block) else 1
        own = np.arange(block.size) // wide
        group[free.slices[block.name]] = count + own
        count += int(own.max(initial=-1)) + 1
    read = pattern.tocoo()
    tied = coo_array((read.data, (read.row, group[read.col])), (pattern.shape[0], count))
    return [np.flatnonzero(np.isin(group, groups)) for groups in tied_columns(tied)]
