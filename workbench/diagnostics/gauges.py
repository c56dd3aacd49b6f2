"""Gauges: what a problem is invariant to, by name, before any other name is looked for.

Rows of points may move by a similarity (translations, rotations and a scale), numbers by a common
offset or a common factor, and a factor of a matrix product by a matrix that the next factor undoes;
points that cameras see as matrices may be mapped projectively. Each such motion is a field over the
unknowns: an element of the Lie algebra of a group that acts on them. It is a gauge where the other
unknowns can undo it: where some of their changes, together with it, lie in the null space. This is
a linear question, whatever the form in which cameras are written. It has to have the same answer
at other points nearby, for at one point alone much cancels by chance. Of all changes that undo a
motion the smallest is taken, or that of the fewest blocks.

Triggs et al., Bundle adjustment - a modern synthesis (2000), section 9, treats gauges in general;
Olver, Applications of Lie groups to differential equations (1993), section 2.1, symmetries.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array, csc_array

from workbench.arrays import Array, Index
from workbench.blocks import Layout, Values
from workbench.diagnostics.factor_gauges import factor_gauges, offsets_of_factors
from workbench.diagnostics.frame_gauges import (
    ANGLES,
    free_turns,
    place_gauges,
    posed,
    turn_gauges,
    vector_gauges,
)
from workbench.diagnostics.gauge_names import named_gauge
from workbench.diagnostics.matrix_gauges import Maps
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.diagnostics.number_gauges import common_scales, entry_gauges, number_gauges
from workbench.diagnostics.point_gauges import are_points, bending_gauges, clouds, point_gauges
from workbench.diagnostics.projective_gauges import homogeneous_factors
from workbench.diagnostics.sliding_gauges import added_gauges, own_axis_gauges
from workbench.diagnostics.things import in_space
from workbench.diagnostics.trade_offs import few_numbers, trade_offs
from workbench.diagnostics.tried_gauges import homogeneous_gauges, size_gauges
from workbench.diagnostics.undoing import Found, Unseen, places, undone
from workbench.problem import Problem
from workbench.problem.sparsity import tied_columns


@dataclass(frozen=True, eq=False)
class Gauge:
    """A motion that a user declares to be a gauge, as the diagnosis does not find it by itself.

    Attributes:
        name: what it is called, such as `a translation along x`.
        change: a function of the values of all blocks that returns how some of them change: a
            dict with an array of the block's shape for each. Changes of all other unknowns may undo
            it.
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
    if these are given. What a motion adds nothing to those before it is left out.
    """
    found, told = Found(unseen), set[frozenset[str]]()
    units = np.ones(problem.free.size) if units is None else units
    for gauge in declared:
        for motion in _declared(gauge, problem.free, values, unseen, units):
            found.adds(motion.vector(problem.free.size))
            told.add(_moved(motion, problem.free))
            yield motion
    islands = _islands(problem.free, pattern)
    for stage in _stages(problem, values, unseen, found, told, islands, units):
        if found.all():
            return
        for motion in stage:
            if found.all():
                return
            if found.adds(motion.vector(problem.free.size)):
                told.add(_moved(motion, problem.free))
                yield motion


def _stages(
    problem: Problem,
    values: Values,
    unseen: Unseen,
    found: Found,
    told: set[frozenset[str]],
    islands: Sequence[Index],
    units: Array,
) -> Iterator[Iterator[NamedSubspace]]:
    """Where gauges are looked for: what acts on most unknowns in a known form comes first.

    `told` are the names of the blocks that each motion found so far moves.
    """
    free = problem.free
    poses = posed(problem)
    mixed = [*factor_gauges(free, unseen)]
    factored = {name for factor in mixed for name in factor.blocks}
    yield (factor.motion for factor in mixed)
    matrices = [*homogeneous_factors(free, unseen)]
    factored |= {name for name, _ in matrices}
    yield (motion for _, motion in matrices)
    blocks = [b for b in free.blocks if b.name not in poses]
    points: set[str] = set()
    seen = []
    for island in islands:
        for cloud in clouds(free, island):
            names, own = {block.name for block in cloud.blocks}, cloud.places.ravel()
            others = np.setdiff1d(island, own)
            enough = unseen.fixed(own) >= cloud.enough
            if enough and not names & factored and are_points(cloud, unseen, others):
                points |= names
                seen.append((cloud, others))
    if unseen.nearby:
        yield common_scales(free, blocks, points, islands, unseen, found, units)
    yield from (offsets_of_factors(free, unseen, island, mixed) for island in islands)
    yield from (point_gauges(cloud, free, unseen, found, others, units) for cloud, others in seen)
    maps = [
        Maps(free, unseen, block, what, units, block.name in points, found)
        for block in ([b for b in blocks if b.whole is None] if unseen.nearby else [])
        for what in ("row", "column")
    ]
    yield from (one.single() for one in maps)
    yield from (bending_gauges(cloud, free, unseen, others) for cloud, others in seen)
    yield place_gauges(problem, unseen)
    angles = [b for b in blocks if b.unit in ANGLES]
    if unseen.nearby and len(angles) > 1:
        yield number_gauges(free, angles, islands, unseen, found, units)
        yield entry_gauges(free, angles, unseen, found, units)
    yield turn_gauges(problem, unseen)
    yield from (one.added() for one in maps)
    yield from (one.mixed() for one in maps)
    yield from (_otherwise(replace(one, again=True).single(), free, told) for one in maps)
    yield number_gauges(free, blocks, islands, unseen, found, units)
    yield homogeneous_gauges(problem, values, blocks, islands, unseen, found, units)
    yield entry_gauges(free, blocks, unseen, found, units)
    yield size_gauges(problem, values, unseen, units)
    yield vector_gauges(problem, unseen)
    yield own_axis_gauges(free, blocks, unseen, found)
    yield added_gauges(free, blocks, unseen, found)
    yield free_turns(problem, unseen, found)
    yield few_numbers(free, blocks, unseen, found)
    again = (point_gauges(c, free, unseen, found, o, units, again=True) for c, o in seen)
    yield from (_otherwise(one, free, told) for one in again)
    yield trade_offs(free, blocks, unseen)


def _moved(motion: NamedSubspace, free: Layout) -> frozenset[str]:
    """The names of the blocks that a motion moves."""
    return frozenset(free.block_of(int(i))[0].name for i in motion.entries)


def _otherwise(
    motions: Iterator[NamedSubspace], free: Layout, told: set[frozenset[str]]
) -> Iterator[NamedSubspace]:
    """The motions that move other blocks than those told so far.

    What moves the same blocks in another way hides what is left to be named: a point that one
    camera sees slides along its ray, which is no scale of all others.
    """
    yield from (motion for motion in motions if _moved(motion, free) not in told)


def is_gauge(gauge: Gauge, problem: Problem, values: Values, null: Array) -> bool:
    """Whether a declared motion is one that the other unknowns can undo."""
    units = np.ones(problem.free.size)
    unseen = Unseen(problem.split(values)[0], null)
    return any(True for _ in _declared(gauge, problem.free, values, unseen, units))


def _declared(
    gauge: Gauge, free: Layout, values: Values, unseen: Unseen, units: Array
) -> Iterator[NamedSubspace]:
    v, moved = np.zeros(free.size), gauge.change(dict(values))
    for name, change in moved.items():
        v[free.slices[name]] = free[name].taken(change).ravel()
    others = places(free, [b for b in free.blocks if b.name not in moved])
    here = Unseen(unseen.x, unseen.basis, unseen.same)
    for w, _ in undone(lambda x: (v / units)[:, None], others, here):
        main = [b for b in free.blocks if b.name in moved]
        yield named_gauge("gauge", gauge.name, w, free, main, least=unseen.same)


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
