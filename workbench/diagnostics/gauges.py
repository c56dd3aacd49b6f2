"""Gauges: which motions of the catalogue other unknowns undo, so that no residual changes.

A generator moves some unknowns as its columns D(x) say, wherever they are. It is a gauge where some
changes of others, together with it, lie in the null space. This is a linear question, whatever the
form in which cameras are written: which combinations c of the columns lie in N + span(others)?
At one point almost anything may happen to be undone; a gauge is undone everywhere, in the same
combination c, so that the question is asked at the point itself and at a few points nearby. Of
those who may undo it the fewest are taken: nobody, one block, or all that are needed.

Triggs et al., Bundle adjustment - a modern synthesis (2000), section 9, treats gauges in general.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import NamedTuple

import numpy as np
import scipy.linalg
from scipy.sparse import coo_array, csc_array

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Block, Layout, Values
from workbench.diagnostics import generators
from workbench.diagnostics.bases import null_basis, sparsest
from workbench.diagnostics.generators import Cloud, Generator, Group, Segment, places_of, together
from workbench.diagnostics.words import LENGTHS, in_space, listed, things
from workbench.problem import Problem
from workbench.problem.sparsity import tied_columns

INSIDE = 1e-6  # of its length: a motion that misses the null space by less lies in it
NEW_PART = 1e-3  # of its length: what a motion has outside of those before, to be a new one
COMBINATION_TOLERANCE = 1e-4  # between combinations of columns, whose spaces are known to INSIDE
TAKES_PART = 1e-5  # of the largest coefficient: less takes no part
MOST_GROUPS = 400  # groups up to which combinations of few are looked for
MOST_TRIALS = 15_000  # unknowns times blocks, up to which each is asked whether it can be left out


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


class GaugeMotion(NamedTuple):
    """A motion with a name, by its coefficients (d,) in the basis of what is not seen."""

    kind: str
    name: str
    coefficients: Array
    joints: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class NullSpace:
    """What no residual notices at a point, or hardly notices, and at points nearby.

    Unknowns x are measured as y = lengths * x: by columns of length 1, so that no unit counts.

    Attributes:
        x: (n,) the point.
        lengths: (n,) above zero.
        basis: (n, d) an orthonormal basis, of y.
        tolerance: how much of its length a motion may have outside and still lie in the space.
        nearby: other points x (n,), each with its own basis (n, d').
    """

    x: Array = field(repr=False)
    lengths: Array = field(repr=False)
    basis: Array = field(repr=False)
    tolerance: float = INSIDE
    nearby: tuple[tuple[Array, Array], ...] = field(default=(), repr=False)
    _still_ranges: dict[bytes, list[Array]] = field(default_factory=dict, repr=False)

    @property
    def exact(self) -> bool:
        """Whether motions miss the space by rounding alone."""
        return self.tolerance <= INSIDE

    def determined(self, places: Index) -> int:
        """How many independent moves of these unknowns no others can undo.

        If it is 0, others undo whatever these do, so that a name for one motion would say nothing.
        """
        return len(places) - len(_truncated_svd(self.basis[places], self.tolerance)[1])

    def motion(self, generator: Generator, c: Array) -> Array:
        """How y (n,) moves with a combination c (g,) of the generator's columns."""
        v, places = np.zeros(len(self.x)), generator.places
        v[places] = generator.columns(self.x) @ c * self.lengths[places]
        return v

    def undone(self, generator: Generator, others: Index) -> Array:
        """Which combinations (g, k) of columns these other unknowns undo, the same at all points.

        They are orthonormal where columns have length 1; see `column_lengths`.
        """
        n, still = len(self.x), np.ones(len(self.x), dtype=bool)
        still[others] = False
        points = ((self.x, self.basis), *self.nearby)
        key = still.tobytes()
        if key not in self._still_ranges:
            parts = [basis[still] for _, basis in points]
            self._still_ranges[key] = [_truncated_svd(part, self.tolerance)[0] for part in parts]
        lengths = self.column_lengths(generator)
        outside = []  # what the null space at each point lacks of the columns
        for (x, _), U in zip(points, self._still_ranges[key], strict=True):
            D = np.zeros((n, len(lengths)))
            D[generator.places] = self._columns(generator, x) / lengths
            outside.append(D[still] - U @ (U.T @ D[still]))
        return null_basis(np.vstack(outside), self.tolerance)

    def column_lengths(self, generator: Generator) -> Array:
        """The lengths (g,) of a generator's columns here; 1 where a column is zero."""
        lengths = np.linalg.norm(self._columns(generator, self.x), axis=0)
        return np.asarray(np.where(lengths > 0, lengths, 1.0))

    def _columns(self, generator: Generator, x: Array) -> Array:
        return generator.columns(x) * self.lengths[generator.places, None]

    def completed(self, v: Array, others: Index) -> Array:
        """The coefficients (d,) of the smallest motion that is v (n,) but for these others."""
        still = np.ones(len(v), dtype=bool)
        still[others] = False
        U, s, Vt = _truncated_svd(self.basis[still], self.tolerance)
        return np.asarray(Vt.T @ ((U.T @ v[still]) / s))

    def blocks_moved(self, w: Array, free: Layout) -> list[str]:
        """The names of the blocks that a motion w (n,) moves."""
        least = max(INSIDE, self.tolerance) * abs(w).max()
        return [name for name, part in free.slices.items() if (abs(w[part]) > least).any()]


def _truncated_svd(A: Array, tolerance: float) -> tuple[Array, Array, Array]:
    """`U, s, Vt` of A, with singular values above the tolerance alone."""
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    large = s > tolerance
    return U[:, large], s[large], Vt[large]


class KnownMotions:
    """The motions of a null space that have a name so far.

    Attributes:
        space: the null space.
        coefficients: (d, k) an orthonormal basis of their coefficients.
        new_part: of its length: a motion with less outside of those before is not new.
    """

    def __init__(self, space: NullSpace) -> None:
        self.space = space
        self.coefficients = np.zeros((space.basis.shape[1], 0))
        self.new_part = max(NEW_PART, 2 * space.tolerance)

    def complete(self) -> bool:
        """Whether they span the null space, so that there is nothing left to name."""
        dimension, count = self.coefficients.shape
        return count >= dimension

    def add(self, a: Array) -> bool:
        """Add the motion with the coefficients a (d,) if it is new, and say whether it was."""
        length = np.linalg.norm(a)
        rest = a - self.coefficients @ (self.coefficients.T @ a)
        rest -= self.coefficients @ (self.coefficients.T @ rest)
        if not length or np.linalg.norm(rest) <= self.new_part * length:
            return False
        self.coefficients = np.column_stack([self.coefficients, rest / np.linalg.norm(rest)])
        return True

    def include(self, v: Array, places: Index) -> bool:
        """Whether some combination of them moves these unknowns as v (n,) does.

        Then another motion that does the same differs from it only in what others do.
        """
        U = _truncated_svd(self.space.basis[places] @ self.coefficients, self.space.tolerance)[0]
        outside = v[places] - U @ (U.T @ v[places])
        tolerance = max(COMBINATION_TOLERANCE, self.new_part)
        return bool(np.linalg.norm(outside) <= tolerance * np.linalg.norm(v[places]))


def gauges(
    problem: Problem,
    values: Values,
    known: KnownMotions,
    pattern: csc_array,
    declared: Sequence[Gauge] = (),
) -> Iterator[GaugeMotion]:
    """The gauges of a problem at these values, among the motions that are not seen.

    `pattern` (m, n) says which unknowns a row reads: points that no row ties together move
    independently of each other. A motion that adds nothing to those before it is left out.
    """
    free, space = problem.free, known.space
    for gauge in declared:
        yield from (m for m in _declared(gauge, free, values, space) if known.add(m.coefficients))
    yield from _of_generators(generators.rest(problem), free, known)
    if known.complete():
        return
    islands = _islands(free, pattern)
    posed = {name for tree in problem.trees for name in tree.blocks}
    blocks = [b for b in free.blocks if b.name not in posed]
    points = [
        cloud
        for island in islands
        for cloud in generators.clouds(free, island, blocks)
        if _are_points(cloud, space)
    ]
    point_blocks = {b.name for cloud in points for b in cloud.blocks}
    groups = list(generators.block_groups(free, blocks, islands))
    if points and space.nearby:  # what scales with the points
        yield from _of_groups([g for g in groups if g.factor], known, point_blocks)
    before_groups, after_groups = _catalogue(problem, space, blocks, points)
    yield from _of_generators(before_groups, free, known)
    yield from _of_groups(groups, known, point_blocks)
    yield from _of_generators(after_groups, free, known)


def _catalogue(
    problem: Problem, space: NullSpace, blocks: Sequence[Block], points: Sequence[Cloud]
) -> tuple[Iterator[Generator], Iterator[Generator]]:
    """The generators to ask before numbers in a fixed ratio, and those to ask after these."""
    free = problem.free
    point_blocks = {b.name for cloud in points for b in cloud.blocks}
    matrices = [
        matrix
        for block in (blocks if space.nearby else ())
        if block.whole is None and block.shape
        for matrix in generators.matrices(free, block, block.name in point_blocks)
    ]
    small = [m for m in matrices if generators.may_scale(m)]
    mixing = [m for m in matrices if generators.may_mix(m)]
    spatial = [b for b in free.blocks if b.unit in LENGTHS[1:] and b.shape in ((2,), (3,))]
    before_groups = chain(
        (generators.similarity(cloud) for cloud in points),
        (generators.factors_and_offsets(m) for m in small if m.column),
    )
    after_groups = chain(
        (generators.factors_and_offsets(m) for m in small if not m.column),
        (generators.bending(cloud) for cloud in points),
        generators.shifts(free, spatial),
        _turns(problem, space),
        (generators.column_sums(m) for m in mixing),
        (generators.column_rotations(m) for m in mixing),
    )
    return before_groups, after_groups


def _turns(problem: Problem, space: NullSpace) -> Iterator[Generator]:
    """Turns of roots and rotation vectors; a single one that others undo anyhow says little."""
    free = problem.free
    posed = {name for tree in problem.trees for name in tree.blocks}
    angles = [b for b in free.blocks if b.unit in generators.ANGLES and b.name not in posed]
    blocks = [b for b in angles if b.shape and b.shape[-1] == 3 and len(b.shape) < 3]
    spatial = [b for b in free.blocks if b.shape == (3,) and b.unit in LENGTHS[1:]]
    spatial += [b for b in blocks if b.size == 3]
    roots = [np.array(tree.entries(0, free), dtype=np.int64) for tree in problem.trees]
    turning = [(r, free.block_of(int(r[0]))[0]) for r in roots if len(r) == 3 and blocks]
    turning += [(places_of(free, b), b) for b in blocks]
    for places, block in turning:
        frames = [b for b in spatial if b is not block]
        if frames:
            yield generators.turns(block, places, together(free, frames))
        if len(places) > 3 or (space.nearby and space.determined(places) > 1):
            yield generators.turns(block, places, None)


def _are_points(cloud: Cloud, space: NullSpace) -> bool:
    """Whether the rows of a cloud are points, and not rows of coefficients.

    The shape of an array does not tell, but the maps of its rows that other unknowns undo do:

    - blocks of one coordinate each are points if a rotation is undone;
    - rows are points if a move of the plane at infinity is undone;
    - rows with a unit of length are, too, unless all linear maps are undone and no translation;
    - rows without a unit are, too, if a rotation is undone, and no factor of a single column.

    Where the others undo whatever the rows do, there is nothing to tell them by.
    """
    d = cloud.places.shape[1]
    least_determined = 1 if len(cloud.blocks) == 1 else d
    if space.determined(cloud.places.ravel()) < least_determined:
        return False
    maps = generators.any_map(cloud)
    translations, rotations, scale, stretches, shears, projective = maps.slices()
    Q = space.undone(maps, np.setdiff1d(np.arange(len(space.x)), cloud.places))
    each_map = np.eye(len(Q))

    rigid = Q @ null_basis(Q[scale.start :], COMBINATION_TOLERANCE)
    rotation_undone = bool(np.linalg.norm(rigid[rotations]) > COMBINATION_TOLERANCE)
    if cloud.blocks[0].shape[-1] != d:  # a block for each coordinate
        return rotation_undone
    if _inside(Q, each_map[:, projective]).any():
        return True
    if cloud.blocks[0].unit != "1":
        linear = each_map[:, rotations.start : shears.stop]
        translation_undone = _inside(Q, each_map[:, translations]).any()
        return bool(translation_undone or not _inside(Q, linear).all())
    column_factors = np.zeros((len(Q), d))  # stretches; the last one is the scale without them
    column_factors[stretches] = np.eye(d - 1, d)
    column_factors[stretches, -1], column_factors[scale, -1] = -1.0, 1.0
    column_factors *= space.column_lengths(maps)[:, None]
    return rotation_undone and not _inside(Q, column_factors).any()


def _inside(Q: Array, combinations: Array) -> Mask:
    """Which combinations (g, w) lie in a space with the orthonormal basis Q (g, k): (w,)."""
    W = combinations / np.linalg.norm(combinations, axis=0)
    outside = np.linalg.norm(W - Q @ (Q.T @ W), axis=0)
    return np.asarray(outside <= COMBINATION_TOLERANCE)


def _of_generators(
    catalogue: Iterable[Generator], free: Layout, known: KnownMotions
) -> Iterator[GaugeMotion]:
    """The motions of these generators that others undo, until all motions have a name."""
    for generator in catalogue:
        if known.complete():
            return
        yield from _of_generator(generator, free, known)


def _of_generator(generator: Generator, free: Layout, known: KnownMotions) -> Iterator[GaugeMotion]:
    """The motions of a generator that others undo, each by the fewest of them."""
    space, places = known.space, generator.places
    others = generator.others
    if others is None:
        others = np.setdiff1d(np.arange(free.size), places)
        if not space.determined(places):
            return
    lengths = space.column_lengths(generator)
    Q = space.undone(generator, others)
    if not Q.shape[1]:
        return
    for segment, unit_c in _combinations(Q, generator):
        c = unit_c / lengths
        v = space.motion(generator, c)
        if np.linalg.norm(v) <= INSIDE * np.linalg.norm(unit_c):
            continue  # such as a turn of points about the line on which they all lie
        if not generator.needs_others and known.include(v, places):
            continue
        for a in _completions(generator, v, c, others, space, free):
            w = space.basis @ a
            others_still = np.linalg.norm(w[others]) <= INSIDE * np.linalg.norm(w)
            if not (generator.needs_others and others_still) and known.add(a):
                title = _title(segment.words(c), generator, c, w, free, space)
                yield GaugeMotion(segment.kind, title, a)


def _combinations(Q: Array, generator: Generator) -> Iterator[tuple[Segment, Array]]:
    """Combinations (g,) that span those in Q (g, k), by segments: single columns, where it may be.

    A combination has parts in earlier segments: a rotation about a point is a turn and a shift.
    """
    g = len(Q)
    earlier = np.zeros((g, 0))
    for segment, part in zip(generator.segments, generator.slices(), strict=True):
        if generator.single:
            unit = np.eye(g)[:, part]
            yield from ((segment, c) for c in unit[:, _inside(Q, unit)].T)
            continue
        S = Q @ null_basis(Q[part.stop :], INSIDE) if part.stop < g else Q
        S = S - earlier @ (earlier.T @ S)
        U, s, _ = np.linalg.svd(S, full_matrices=False)
        S = U[:, s > INSIDE]
        earlier = np.column_stack([earlier, S])
        if S.shape[1]:
            rows = S[part]
            pivots = np.sort(scipy.linalg.qr(rows.T, mode="r", pivoting=True)[1][: S.shape[1]])
            for c in (S @ np.linalg.pinv(rows[pivots])).T:
                yield segment, np.where(abs(c) > INSIDE * abs(c).max(), c, 0.0)


def _completions(
    generator: Generator,
    v: Array,
    c: Array,
    others: Index,
    space: NullSpace,
    free: Layout,
) -> Iterator[Array]:
    """The motions (d,) that are v (n,) but for the unknowns that undo it.

    If v is a motion by itself, it is this one; or else one for each single block that can undo it;
    or else one with the fewest blocks, found by leaving out one after the other, the last first.
    """
    rank = _truncated_svd(space.basis[generator.places], space.tolerance)[1].size
    if rank == space.basis.shape[1]:  # one motion alone does what v does
        yield space.completed(v, others)
        return
    along = generator._replace(columns=lambda x: (generator.columns(x) @ c)[:, None])

    def undo_it(blocks: Sequence[Index]) -> bool:
        return bool(space.undone(along, _joined(blocks)).size)

    if undo_it([]):
        yield space.completed(v, _joined([]))
        return
    blocks = [np.intersect1d(others, places_of(free, b)) for b in free.blocks]
    blocks = [places for places in blocks if places.size]
    if len(v) * len(blocks) > MOST_TRIALS:
        yield space.completed(v, others)
        return
    if able := [places for places in blocks if undo_it([places])]:
        yield from (space.completed(v, places) for places in able)
        return
    needed = blocks
    for places in reversed(blocks):
        fewer = [kept for kept in needed if kept is not places]
        if undo_it(fewer):
            needed = fewer
    yield space.completed(v, _joined(needed))


def _joined(parts: Sequence[Index]) -> Index:
    return np.concatenate([np.zeros(0, dtype=np.int64), *parts])


def _title(
    motion: str, generator: Generator, c: Array, w: Array, free: Layout, space: NullSpace
) -> str:
    """`a rotation about x of points, undone by cam0, cam1 and cam2`; w (n,) is the whole motion."""
    moved = space.blocks_moved(w, free)
    undoing = [free[name] for name in moved if name not in generator.blocks]
    alike, d = [generator.name], generator.row_width
    for block in [b for b in undoing if d and in_space(b) and b.shape[-1] == d]:
        part = free.slices[block.name]
        rows = generators.point_columns(space.x[part].reshape(-1, d))[:, : len(c)] @ c
        difference = rows * space.lengths[part] - w[part]
        if np.linalg.norm(difference) <= 10 * max(INSIDE, space.tolerance) * np.linalg.norm(w):
            alike.append(block.name)
            undoing.remove(block)
    names = things(free.names, [b.name for b in undoing])
    return f"{motion} of {listed(alike)}" + (f", undone by {listed(names)}" if names else "")


# Numbers that change in a fixed ratio.


def _of_groups(
    groups: list[Group], known: KnownMotions, point_blocks: Collection[str]
) -> Iterator[GaugeMotion]:
    """Offsets and factors of groups that cancel: combinations of few, the same ratio everywhere.

    Offsets are asked first, then factors, then both. A factor of points is called a scale.
    """
    everywhere = bool(known.space.nearby)
    kinds = [[g for g in groups if not g.factor], [g for g in groups if g.factor]]
    kinds += [groups] if everywhere else []
    for candidates in kinds:
        if known.complete() or len(candidates) > MOST_GROUPS:
            continue
        for parts, a in _cancelling(candidates, known):
            # at one point alone, single numbers undo each other in ways that say nothing
            if not everywhere and max(group.places.size for group, _ in parts) == 1:
                continue
            named = _in_ratio(parts, exact=everywhere)
            if named and known.add(a):
                kind, title = named
                if any(group.factor and group.block in point_blocks for group, _ in parts):
                    title = title.replace("a common factor", "a scale", 1)
                yield GaugeMotion(kind, title, a)


def _cancelling(
    groups: Sequence[Group], known: KnownMotions
) -> Iterator[tuple[list[tuple[Group, float]], Array]]:
    """Combinations of few groups, with their amounts, that nothing else undoes: (d,) each."""
    space = known.space
    groups = [g for g in groups if g.column(space.x).any()]
    if not groups:
        return

    def columns(x: Array) -> Array:
        return np.column_stack([group.column(x) for group in groups])

    every_group = Generator("", (), np.arange(len(space.x)), columns, ())
    lengths = space.column_lengths(every_group)
    C = space.undone(every_group, _joined([]))
    D = columns(space.x) * space.lengths[:, None] / lengths
    A = space.basis.T @ D @ C  # the coefficients (d, k) of the combinations
    named = known.coefficients
    old = C @ null_basis(A - named @ (named.T @ A), known.new_part)
    U, s, _ = np.linalg.svd(C - old @ (old.T @ C), full_matrices=False)
    each = np.sqrt([g.places.size for g in groups])[:, None]  # a group counts once, whatever size
    new = U[:, s > 0.5] / each
    if not new.shape[1]:
        return
    orthonormal = [np.linalg.qr(M)[0] if M.shape[1] else M for M in (new, old / each)]
    for b in sparsest(*orthonormal).T:
        c = b * each[:, 0]
        c[abs(c) < TAKES_PART * abs(c).max()] = 0.0
        v = D @ c
        a = space.basis.T @ v
        # what is a small difference of large parts has to be a motion by itself
        if np.linalg.norm(v) > INSIDE * np.linalg.norm(D * c) and np.linalg.norm(
            v - space.basis @ a
        ) <= 10 * space.tolerance * np.linalg.norm(v):
            amounts = c / lengths
            yield [(g, float(x)) for g, x in zip(groups, amounts, strict=True) if x], a


def _in_ratio(parts: Sequence[tuple[Group, float]], exact: bool) -> tuple[str, str] | None:
    """The kind and the title of a combination; None for single numbers in an unlike ratio."""
    factors = [(group, c) for group, c in parts if group.factor]
    several = [(g, c) for g, c in parts if g.places.size > 1]
    by_block: dict[str, list[float]] = {}
    for group, c in parts:
        by_block.setdefault(group.block, []).append(c)
    alike = all(np.allclose(some, some[0], rtol=TAKES_PART) for some in by_block.values())
    rows = list(parts) if alike and len(by_block) < len(parts) else []
    main = factors or several or rows
    if not main:
        return None
    least = min((c for _, c in main), key=abs)
    unit = abs(least) * np.sign(main[0][1])
    if not exact and not factors and not np.allclose([abs(c) for _, c in parts], abs(least)):
        return None
    kind, motion = ("scale", "a common factor") if factors else ("offset", "a common offset")
    up = [_part(g, c / unit) for g, c in main if c / unit > 0]
    down = [_part(g, -c / unit) for g, c in main if c / unit < 0]
    others = [g.name for g, _ in parts if all(g is not leading for leading, _ in main)]
    down += [f"an offset of {name}" if factors else name for name in others]
    return kind, f"{motion} of {listed(up)}" + (f", undone by {listed(down)}" if down else "")


def _part(group: Group, amount: float) -> str:
    """`slope`, `size (to the power 2)` or `clock (2 times as much)`."""
    if abs(amount - 1) < 1e-3:
        return group.name
    how = f"to the power {amount:.3g}" if group.factor else f"{amount:.3g} times as much"
    return f"{group.name} ({how})"


# What is declared, and what rows tie together.


def is_gauge(gauge: Gauge, problem: Problem, values: Values, null: Array) -> bool:
    """Whether a declared motion is one that the other unknowns can undo."""
    space = NullSpace(problem.split(values)[0], np.ones(problem.free.size), null)
    return any(True for _ in _declared(gauge, problem.free, values, space))


def _declared(
    gauge: Gauge, free: Layout, values: Values, space: NullSpace
) -> Iterator[GaugeMotion]:
    """The motion that a user declares, if other unknowns undo it at this point."""
    changes = gauge.change(dict(values))
    names, places = list(changes), together(free, list(changes))
    flat = [free[name].taken(change).ravel() for name, change in changes.items()]
    column = np.concatenate([np.zeros(0), *flat])[:, None]
    here = NullSpace(space.x, space.lengths, space.basis, space.tolerance)
    segment = Segment("gauge", 1, lambda c: gauge.name)
    generator = Generator(listed(names), tuple(names), places, lambda x: column, (segment,))
    others = np.setdiff1d(np.arange(free.size), places)
    if column.any() and here.undone(generator, others).shape[1]:
        c = np.ones(1)
        a = here.completed(here.motion(generator, c), others)
        title = _title(gauge.name, generator, c, here.basis @ a, free, here)
        yield GaugeMotion("gauge", title, a)


def _islands(free: Layout, pattern: csc_array) -> list[Index]:
    """The unknowns that rows tie together, directly or through others; points stay whole."""
    point_of = np.zeros(free.size, dtype=np.int64)  # or the entry itself, where it is no point
    count = 0
    for block in free.blocks:
        width = block.shape[-1] if in_space(block) else 1
        own = np.arange(block.size) // width
        point_of[free.slices[block.name]] = count + own
        count += int(own.max(initial=-1)) + 1
    entries = pattern.tocoo()
    places = (entries.row, point_of[entries.col])
    tied = coo_array((entries.data, places), (pattern.shape[0], count))
    return [np.flatnonzero(np.isin(point_of, points)) for points in tied_columns(tied)]
