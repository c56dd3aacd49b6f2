"""Gauges: which motions of the catalogue other unknowns undo, so that no residual changes.

A generator moves some unknowns as its columns D(x) say, wherever they are. It is a gauge where some
changes of others, together with it, lie in the null space. This is a linear question, whatever the
form in which cameras are written: which combinations c of the columns lie in N + span(others)?
At one point almost anything may happen to be undone; a gauge is undone everywhere, in the same
combination c, so that the question is asked at the point itself and at a few points nearby. Of
those who may undo it the fewest are taken: nobody, one block, or all that are needed.

Triggs et al., Bundle adjustment - a modern synthesis (2000), section 9, treats gauges in general.
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import NamedTuple

import numpy as np
import scipy.linalg
from scipy.sparse import coo_array, csc_array

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout, Values
from workbench.diagnostics import generators
from workbench.diagnostics.bases import sparsest
from workbench.diagnostics.generators import Cloud, Generator, Group, Segment, places_of, together
from workbench.diagnostics.words import LENGTHS, in_space, listed, things
from workbench.problem import Problem
from workbench.problem.sparsity import tied_columns

SAME = 1e-6  # of its length: a motion that misses the null space by less lies in it
NEW = 1e-3  # of its length: what a motion has outside of those before, to be a new one
CLOSE = 1e-4  # between coefficients of motions, from spaces that are known up to SAME
PART = 1e-5  # of the largest coefficient: less takes no part
MANY = 400  # groups up to which combinations of few are looked for
LABOUR = 15_000  # unknowns times blocks, up to which each is asked whether it can be left out


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
        same: how much of its length a motion may have outside and still count as one.
        nearby: other points x (n,), each with its own basis (n, d').
    """

    x: Array = field(repr=False)
    lengths: Array = field(repr=False)
    basis: Array = field(repr=False)
    same: float = SAME
    nearby: tuple[tuple[Array, Array], ...] = field(default=(), repr=False)
    _ranges: dict[bytes, list[Array]] = field(default_factory=dict, repr=False)

    @property
    def exact(self) -> bool:
        """Whether motions miss the space by rounding alone."""
        return self.same <= SAME

    @property
    def everywhere(self) -> tuple[tuple[Array, Array], ...]:
        """The point and those nearby, each with its basis."""
        return ((self.x, self.basis), *self.nearby)

    def fixed(self, places: Index) -> int:
        """How many ways of moving these unknowns others cannot undo; 0 if they may move anyhow.

        Then it says nothing of a motion that others undo it.
        """
        return len(places) - len(_range(self.basis[places], self.same)[1])

    def moved(self, generator: Generator, c: Array, x: Array | None = None) -> Array:
        """How y (n,) moves with a combination c (g,) of the generator's columns."""
        v, at = np.zeros(len(self.x)), generator.places
        v[at] = generator.columns(self.x if x is None else x) @ c * self.lengths[at]
        return v

    def undone(self, generator: Generator, others: Index) -> Array:
        """Which combinations (g, k) of columns these other unknowns undo, the same at all points.

        They are orthonormal where columns have length 1; see `in_columns`.
        """
        at, lengths, missed = generator.places, None, []
        n, still = len(self.x), np.ones(len(self.x), dtype=bool)
        still[others] = False
        key = still.tobytes()
        if key not in self._ranges:
            bases = [basis[still] for _, basis in self.everywhere]
            self._ranges[key] = [_range(some, self.same)[0] for some in bases]
        for (x, _), U in zip(self.everywhere, self._ranges[key], strict=True):
            columns = generator.columns(x) * self.lengths[at, None]
            if lengths is None:
                lengths = _norms(columns)
            D = np.zeros((n, columns.shape[1]))
            D[at] = columns / lengths
            missed.append(D[still] - U @ (U.T @ D[still]))
        return nothing(np.vstack(missed), self.same)

    def in_columns(self, generator: Generator) -> Array:
        """The lengths (g,) of the columns."""
        return _norms(generator.columns(self.x) * self.lengths[generator.places, None])

    def whole(self, v: Array, others: Index) -> Array:
        """The coefficients (d,) of the smallest motion that is v (n,) but for these others."""
        still = np.ones(len(v), dtype=bool)
        still[others] = False
        U, s, Vt = _range(self.basis[still], self.same)
        return np.asarray(Vt.T @ ((U.T @ v[still]) / s))


def _norms(columns: Array) -> Array:
    lengths = np.linalg.norm(columns, axis=0)
    return np.asarray(np.where(lengths > 0, lengths, 1.0))


def _range(A: Array, same: float) -> tuple[Array, Array, Array]:
    """`U, s, Vt` of A, with singular values above `same` alone."""
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    some = s > same
    return U[:, some], s[some], Vt[some]


def nothing(A: Array, same: float) -> Array:
    """An orthonormal basis of what A (m, g) takes to nothing, up to `same`."""
    _, s, Vt = np.linalg.svd(A, full_matrices=len(A) < len(A.T))
    small = np.ones(len(Vt), dtype=bool)
    small[: len(s)] = s <= same
    return np.asarray(Vt[small].T)


class Found:
    """The motions that were found so far, as orthonormal coefficients (d, k)."""

    def __init__(self, space: NullSpace) -> None:
        self.space = space
        self.known = np.zeros((space.basis.shape[1], 0))
        self.new = max(NEW, 2 * space.same)  # of its length: less is nothing new

    def all(self) -> bool:
        """Whether nothing is left to be found."""
        return len(self.known.T) >= len(self.known)

    def adds(self, a: Array) -> bool:
        """Whether coefficients a (d,) are those of a new motion, which then counts as found."""
        length = np.linalg.norm(a)
        new = a - self.known @ (self.known.T @ a)
        new -= self.known @ (self.known.T @ new)
        if not length or np.linalg.norm(new) <= self.new * length:
            return False
        self.known = np.column_stack([self.known, new / np.linalg.norm(new)])
        return True

    def blocks_of(self, w: Array, free: Layout) -> list[str]:
        """The names of the blocks that a motion w (n,) moves."""
        least = max(SAME, self.space.same) * abs(w).max()
        return [name for name, at in free.slices.items() if (abs(w[at]) > least).any()]

    def does(self, v: Array, places: Index) -> bool:
        """Whether some combination of them moves these unknowns as v (n,) does.

        Then another motion that does the same differs from it only in what others do.
        """
        U = _range(self.space.basis[places] @ self.known, self.space.same)[0]
        outside = v[places] - U @ (U.T @ v[places])
        return bool(np.linalg.norm(outside) <= max(CLOSE, self.new) * np.linalg.norm(v[places]))


def gauges(
    problem: Problem,
    values: Values,
    found: Found,
    pattern: csc_array,
    declared: Sequence[Gauge] = (),
) -> Iterator[GaugeMotion]:
    """The gauges of a problem at these values, among the motions that are not seen.

    `pattern` (m, n) says which unknowns a row reads: points that no row ties together move
    independently of each other. A motion that adds nothing to those before it is left out.
    """
    free, space = problem.free, found.space
    for gauge in declared:
        yield from (m for m in _declared(gauge, free, values, space) if found.adds(m.coefficients))
    if found.all():
        return
    for generator in generators.rest(problem):
        yield from _of_generator(generator, free, found)
    if found.all():
        return
    blocks, islands, points = _looked_at(problem, space, pattern)
    of_points = {b.name for cloud in points for b in cloud.blocks}
    groups = list(generators.block_groups(free, blocks, islands))
    if points and space.nearby:  # what scales with the points
        yield from _of_groups([g for g in groups if g.factor], found, of_points)
    for stage, several in enumerate(_catalogue(problem, space, blocks, points)):
        for generator in several:
            if found.all():
                return
            yield from _of_generator(generator, free, found)
        if stage == 0:
            yield from _of_groups(groups, found, of_points)


def _looked_at(
    problem: Problem, space: NullSpace, pattern: csc_array
) -> tuple[list[Block], list[Index], list[Cloud]]:
    """The blocks that turn no joints, the unknowns that rows tie together, and what is points."""
    free = problem.free
    islands = _islands(free, pattern)
    posed = {name for tree in problem.trees for name in tree.blocks}
    blocks = [b for b in free.blocks if b.name not in posed]
    points: list[Cloud] = []
    for island in islands:
        for cloud in generators.clouds(free, island, blocks):
            enough = 1 if len(cloud.blocks) == 1 else cloud.places.shape[1]
            if space.fixed(cloud.places.ravel()) >= enough and _are_points(cloud, space):
                points.append(cloud)
    return blocks, islands, points


def _catalogue(
    problem: Problem, space: NullSpace, blocks: Sequence[Block], points: Sequence[Cloud]
) -> Iterator[Iterator[Generator]]:
    """All generators of a problem, in two stages: numbers in a fixed ratio are asked in between."""
    free = problem.free
    of_points = {b.name for cloud in points for b in cloud.blocks}
    matrices = [
        (b, what, at, b.name in of_points)
        for b in (blocks if space.nearby else ())
        if b.whole is None and b.shape
        for what, at in generators.matrices(free, b, b.name in of_points)
    ]
    factors = [
        (one[1], generator)
        for one in matrices
        if (generator := generators.factors_and_offsets(*one)) is not None
    ]
    spatial = [b for b in free.blocks if b.unit in LENGTHS[1:] and b.shape in ((2,), (3,))]
    coefficients = [m[:3] for m in matrices if not m[3] and generators.may_mix(*m[1:3])]
    yield chain(
        (generators.similarity(cloud) for cloud in points),
        (generator for what, generator in factors if what),
    )
    yield chain(
        (generator for what, generator in factors if not what),
        (generators.bending(cloud) for cloud in points),
        generators.shifts(free, spatial),
        _turns(problem, space),
        chain(*zip(*(generators.mixtures(*one) for one in coefficients), strict=True)),
    )


def _turns(problem: Problem, space: NullSpace) -> Iterator[Generator]:
    """Turns of roots and rotation vectors; a single one that others undo anyhow says little."""
    free = problem.free
    posed = {name for tree in problem.trees for name in tree.blocks}
    angles = [b for b in free.blocks if b.unit in generators.ANGLES and b.name not in posed]
    blocks = [b for b in angles if b.shape and b.shape[-1] == 3 and len(b.shape) < 3]
    spatial = [b for b in free.blocks if b.shape == (3,) and b.unit in LENGTHS[1:]]
    spatial += [b for b in blocks if b.size == 3]
    roots = [np.array(tree.entries(0, free), dtype=np.int64) for tree in problem.trees]
    moved = [(r, free.block_of(int(r[0]))[0]) for r in roots if len(r) == 3 and blocks]
    moved += [(places_of(free, b), b) for b in blocks]
    for at, block in moved:
        frames = [b for b in spatial if b is not block]
        if frames:
            yield generators.turns(block, at, together(free, frames))
        if len(at) > 3 or (space.nearby and space.fixed(at) > 1):
            yield generators.turns(block, at, None)


def _are_points(cloud: Cloud, space: NullSpace) -> bool:
    """Whether the motions that others undo are such as points have, and not coefficients.

    What is a point, and what a row of coefficients, no shape of an array tells. Rows are points if
    a move of the plane at infinity is undone. With a unit of length they are unless all linear maps
    are, and no translation; without one, if a rotation is, and no factor of a single column. Blocks
    for each coordinate are if a rotation is.
    """
    d, at = cloud.places.shape[1], cloud.places.ravel()
    every = generators.any_map(cloud)
    Q = space.undone(every, np.setdiff1d(np.arange(len(space.x)), at))
    lengths = space.in_columns(every)
    linear = slice(d, d + d * d)
    turns, scale = d * (d - 1) // 2, d + d * (d - 1) // 2
    about_any_point = nothing(Q[d + turns :], CLOSE)  # shifts and turns alone
    turned = np.linalg.norm((Q @ about_any_point)[d : d + turns]) > CLOSE
    if cloud.blocks[0].shape[-1] != d:  # a block for each coordinate
        return bool(turned)
    if _inside(Q, np.eye(len(Q))[:, -d:]).any():
        return True
    if cloud.blocks[0].unit != "1":
        shifts = np.eye(len(Q))[:, :d]
        return not _inside(Q, np.eye(len(Q))[:, linear]).all() or bool(_inside(Q, shifts).any())
    own = np.zeros((len(Q), d))  # the factor of each column, by the scale and the stretches
    own[scale, -1], own[scale + 1 : scale + d] = 1.0, np.eye(d)[: d - 1]
    own[scale + 1 : scale + d, -1] = -1.0
    return bool(turned) and not _inside(Q, own * lengths[:, None]).any()


def _inside(Q: Array, wanted: Array) -> Array:
    """Which coefficients (g, w) lie in a space with the orthonormal basis Q (g, k): (w,)."""
    W = wanted / np.linalg.norm(wanted, axis=0)
    return np.asarray(np.linalg.norm(W - Q @ (Q.T @ W), axis=0) <= CLOSE)


def _of_generator(generator: Generator, free: Layout, found: Found) -> Iterator[GaugeMotion]:
    """The motions of a generator that others undo, each by the fewest of them."""
    space, at = found.space, generator.places
    others = generator.others
    if others is None:
        others = np.setdiff1d(np.arange(free.size), at)
        if not space.fixed(at):
            return
    lengths = space.in_columns(generator)
    Q = space.undone(generator, others)
    if not Q.shape[1]:
        return
    for segment, c in _chosen(Q, generator):
        v = space.moved(generator, c / lengths)
        if np.linalg.norm(v) <= SAME * np.linalg.norm(c):
            continue  # such as a turn of points about the line on which they all lie
        if not generator.with_others and found.does(v, at):
            continue
        for a in _ways(generator, v, c / lengths, others, space, free):
            w = space.basis @ a
            still = np.linalg.norm(w[others]) <= SAME * np.linalg.norm(w)
            if not (generator.with_others and still) and found.adds(a):
                said, blocks = segment.words(c / lengths), found.blocks_of(w, free)
                title = _title(said, generator, c / lengths, w, blocks, free, space)
                yield GaugeMotion(segment.kind, title, a)


def _chosen(Q: Array, generator: Generator) -> Iterator[tuple[Segment, Array]]:
    """Combinations (g,) that span those in Q (g, k), by segments: single columns, where it may be.

    A combination has parts in earlier segments: a rotation about a point is a turn and a shift.
    """
    first, g = 0, len(Q)
    known = np.zeros((g, 0))
    for segment in generator.segments:
        own = slice(first, first + segment.width)
        first += segment.width
        if generator.single:
            unit = np.eye(g)[:, own]
            yield from ((segment, c) for c in unit[:, _inside(Q, unit)].T)
            continue
        S = Q @ nothing(Q[first:], SAME) if first < g else Q
        S = S - known @ (known.T @ S)
        U, s, _ = np.linalg.svd(S, full_matrices=False)
        S = U[:, s > SAME]
        known = np.column_stack([known, S])
        if S.shape[1]:
            rows = S[own]
            pivots = np.sort(scipy.linalg.qr(rows.T, mode="r", pivoting=True)[1][: S.shape[1]])
            for c in (S @ np.linalg.pinv(rows[pivots])).T:
                yield segment, np.where(abs(c) > SAME * abs(c).max(), c, 0.0)


def _ways(
    generator: Generator,
    v: Array,
    c: Array,
    others: Index,
    space: NullSpace,
    free: Layout,
) -> Iterator[Array]:
    """The motions (d,) that are v (n,) but for what undoes it: nobody, each single block that can,
    or the fewest blocks, one after the other being left out, the last ones first.
    """
    nobody, at = np.zeros(0, dtype=np.int64), generator.places
    choice = _range(space.basis[at], space.same)[1].size < space.basis.shape[1]
    if not choice:
        yield space.whole(v, others)
        return
    along = generator._replace(columns=lambda x: (generator.columns(x) @ c)[:, None])
    choices = [np.intersect1d(others, places_of(free, b)) for b in free.blocks]
    choices = [some for some in choices if some.size]
    few = len(v) * len(choices) <= LABOUR
    single = [nobody, *choices] if few else [nobody]
    alone = False
    for some in single:
        if space.undone(along, some).shape[1]:
            yield space.whole(v, some)
            alone = True
            if not some.size:
                return
    if alone:
        return
    left = choices
    for one in reversed(choices if few else []):
        fewer = [some for some in left if some is not one]
        if space.undone(along, np.concatenate([nobody, *fewer])).shape[1]:
            left = fewer
    yield space.whole(v, np.concatenate([nobody, *left]))


def _title(
    said: str,
    generator: Generator,
    c: Array,
    w: Array,
    moved: Sequence[str],
    free: Layout,
    space: NullSpace,
) -> str:
    """`a rotation about x of points, undone by cam0, cam1 and cam2`; w (n,) is the whole motion."""
    blocks = [free[name] for name in moved if name not in generator.blocks]
    alike, d = [generator.name], generator.like
    for block in [b for b in blocks if d and in_space(b) and b.shape[-1] == d]:
        at = free.slices[block.name]
        rows = generators.point_columns(space.x[at].reshape(-1, d))[:, : len(c)] @ c
        same = rows * space.lengths[at] - w[at]
        if np.linalg.norm(same) <= 10 * max(SAME, space.same) * np.linalg.norm(w):
            alike.append(block.name)
            blocks.remove(block)
    back = things(free.names, [b.name for b in blocks])
    return f"{said} of {listed(alike)}" + (f", undone by {listed(back)}" if back else "")


# Numbers that change in a fixed ratio.


def _of_groups(
    groups: list[Group], found: Found, of_points: Collection[str] = ()
) -> Iterator[GaugeMotion]:
    """Offsets and factors of groups that cancel: combinations of few, the same ratio everywhere.

    Offsets are asked first, then factors, then both. A factor `of_points` is called a scale.
    """
    space = found.space
    kinds = [[g for g in groups if not g.factor], [g for g in groups if g.factor]]
    kinds += [groups] if space.nearby else []
    for some in kinds:
        if found.all() or len(some) > MANY:
            continue
        for parts, a in _cancelling(some, found):
            # at one point alone, single numbers undo each other in ways that say nothing
            if not space.nearby and max(group.places.size for group, _ in parts) == 1:
                continue
            named = _in_ratio(parts, exact=bool(space.nearby))
            if named and found.adds(a):
                kind, title = named
                if any(group.factor and group.block in of_points for group, _ in parts):
                    title = title.replace("a common factor", "a scale", 1)
                yield GaugeMotion(kind, title, a)


def _cancelling(
    groups: list[Group], found: Found
) -> Iterator[tuple[list[tuple[Group, float]], Array]]:
    """Combinations of few groups, with their amounts, that nothing else undoes: (d,) each."""
    space = found.space
    every = np.arange(len(space.x))

    def columns(x: Array) -> Array:
        return np.column_stack([group.column(x) for group in groups])

    groups = [g for g in groups if g.column(space.x).any()]
    if not groups:
        return
    whole = Generator("", (), every, columns, ())
    size = space.in_columns(whole)
    C = space.undone(whole, every[:0])
    D = columns(space.x) * space.lengths[:, None] / size
    A = space.basis.T @ D @ C  # the coefficients (d, k) of the combinations
    known = C @ nothing(A - found.known @ (found.known.T @ A), found.new)
    U, s, _ = np.linalg.svd(C - known @ (known.T @ C), full_matrices=False)
    each = np.sqrt([g.places.size for g in groups])[:, None]  # a group counts once, whatever size
    fresh = U[:, s > 0.5] / each
    if not fresh.shape[1]:
        return
    orthonormal = [np.linalg.qr(M)[0] if M.shape[1] else M for M in (fresh, known / each)]
    for b in sparsest(*orthonormal).T:
        c = b * each[:, 0]
        c[abs(c) < PART * abs(c).max()] = 0.0
        v = D @ c
        a = space.basis.T @ v
        # what is a small difference of large parts has to be a motion by itself
        if np.linalg.norm(v) > SAME * np.linalg.norm(D * c) and np.linalg.norm(
            v - space.basis @ a
        ) <= 10 * space.same * np.linalg.norm(v):
            amounts = c / size
            yield [(g, float(x)) for g, x in zip(groups, amounts, strict=True) if x], a


def _in_ratio(parts: Sequence[tuple[Group, float]], exact: bool) -> tuple[str, str] | None:
    """The kind and the title of a combination; None for single numbers in an unlike ratio."""
    factors = [(group, c) for group, c in parts if group.factor]
    several = [(g, c) for g, c in parts if g.places.size > 1]
    by_block: dict[str, list[float]] = {}
    for group, c in parts:
        by_block.setdefault(group.block, []).append(c)
    alike = all(np.allclose(some, some[0], rtol=PART) for some in by_block.values())
    rows = list(parts) if alike and len(by_block) < len(parts) else []
    main = factors or several or rows
    if not main:
        return None
    least = min((c for _, c in main), key=abs)
    unit = abs(least) * np.sign(main[0][1])
    if not exact and not factors and not np.allclose([abs(c) for _, c in parts], abs(least)):
        return None
    kind, said = ("scale", "a common factor") if factors else ("offset", "a common offset")
    up = [_part(g, c / unit) for g, c in main if c / unit > 0]
    down = [_part(g, -c / unit) for g, c in main if c / unit < 0]
    others = [g.name for g, _ in parts if all(g is not one for one, _ in main)]
    down += [f"an offset of {name}" if factors else name for name in others]
    return kind, f"{said} of {listed(up)}" + (f", undone by {listed(down)}" if down else "")


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
    moved = gauge.change(dict(values))
    at = together(free, list(moved))
    changes = [free[name].taken(change).ravel() for name, change in moved.items()]
    v = np.concatenate([np.zeros(0), *changes])[:, None]
    here = NullSpace(space.x, space.lengths, space.basis, space.same)
    segment = Segment("gauge", 1, lambda c: gauge.name)
    one = Generator(listed(list(moved)), tuple(moved), at, lambda x: v, (segment,))
    others = np.setdiff1d(np.arange(free.size), at)
    if v.any() and here.undone(one, others).shape[1]:
        a = here.whole(here.moved(one, np.ones(1)), others)
        w = here.basis @ a
        blocks = Found(here).blocks_of(w, free)
        yield GaugeMotion("gauge", _title(gauge.name, one, np.ones(1), w, blocks, free, here), a)


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
