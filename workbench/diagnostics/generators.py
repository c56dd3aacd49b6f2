"""The catalogue of motions that problems may be invariant to, a function for each kind.

A generator is how some unknowns move, wherever they are: the columns of D(x), elements of the Lie
algebra of a group that acts on them (Olver, Applications of Lie groups to differential equations,
1993, section 2.1). Which combinations of its columns are gauges is asked by `gauges`; here is only
what the columns are and what they are called. A new kind of motion is a new function.

points     rows in the plane or in space: shifts, turns and a scale; stretches and shears; moves of
           the plane at infinity, X -> X / (1 - v'X) (Hartley and Zisserman, Multiple View Geometry
           in Computer Vision, 2004, section 10.2)
matrix     an array of coefficients: factors and offsets of its rows or columns, one added to
           another, rotations among them
shifts     a place is shifted, and other places undo that
turns      rotation vectors turn about an axis of the world
rest       the arrays of a body at rest against the poses and places of its registrations
groups     offsets and factors of blocks, in a ratio that is the same everywhere
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout
from workbench.blocks.points import Rest
from workbench.diagnostics.words import LENGTHS, in_space, listed, rows_of
from workbench.geometry.rotation import inverse_left_jacobian
from workbench.problem import Problem

ANGLES = ("rad", "deg")
LARGEST = 4_000_000  # numbers in the columns of a generator
WIDEST = 24  # rows or columns among which every sum and every rotation is asked for
ROUNDING = 1e-6  # of an axis: less is none


class Segment(NamedTuple):
    """Some columns of a generator, one after another: their kind, and words for a combination."""

    kind: str
    width: int
    words: Callable[[Array], str]


class Generator(NamedTuple):
    """How some unknowns may move.

    Attributes:
        name: what moves, such as `points` or `5 rows of points (0, 1, 2, ...)`.
        blocks: the blocks that these unknowns belong to.
        places: (q,) the unknowns, among the free numbers.
        columns: from the unknowns x (n,) to how those at the places move, (q, g).
        segments: what the columns are, in order. A combination may have parts in earlier segments.
        single: whether each column is asked for by itself, and not their combinations.
        others: the unknowns that may undo it; None for all others.
        with_others: whether it counts only if others really move.
        like: the width of rows that may move in the same way in other blocks; 0 for none.
    """

    name: str
    blocks: tuple[str, ...]
    places: Index
    columns: Callable[[Array], Array]
    segments: tuple[Segment, ...]
    single: bool = False
    others: Index | None = None
    with_others: bool = False
    like: int = 0


class Group(NamedTuple):
    """Unknowns that change together: by the same amount, or in proportion to what they are."""

    name: str
    places: Index
    factor: bool
    block: str

    def column(self, x: Array) -> Array:
        """How all unknowns (n,) move."""
        v = np.zeros(len(x))
        v[self.places] = x[self.places] if self.factor else 1.0
        return v


class Cloud(NamedTuple):
    """What may be points: rows of a block, blocks of a point each, or a block for each coordinate.

    `places` (N, d) are those of the coordinates.
    """

    name: str
    blocks: tuple[Block, ...]
    places: Index


def places_of(free: Layout, block: Block | str) -> Index:
    """The places of a block's entries among the free numbers."""
    at = free.slices[block if isinstance(block, str) else block.name]
    return np.arange(at.start, at.stop)


def together(free: Layout, blocks: Sequence[Block | str]) -> Index:
    """The places of the entries of some blocks."""
    return np.concatenate([np.zeros(0, dtype=np.int64), *(places_of(free, b) for b in blocks)])


# Points.


def clouds(free: Layout, island: Index, blocks: Sequence[Block]) -> Iterator[Cloud]:
    """What may be points among the unknowns that rows tie together, the largest block first."""
    for block in sorted([b for b in blocks if in_space(b)], key=lambda b: -b.size):
        own = np.intersect1d(island, places_of(free, block))
        if len(own) > block.shape[-1]:
            part = len(own) < block.size
            name = rows_of(block, own - free.slices[block.name].start) if part else block.name
            yield Cloud(name, (block,), own.reshape(-1, block.shape[-1]))
    lengths = [b for b in blocks if b.unit in LENGTHS[1:] and len(b.shape) == 1]
    lengths = [b for b in lengths if np.isin(places_of(free, b), island).all()]
    for d in (2, 3):
        single = [b for b in lengths if b.shape == (d,)]
        if len(single) > 1:
            at = np.array([places_of(free, b) for b in single])
            yield Cloud(listed([b.name for b in single]), tuple(single), at)
    for size in sorted({b.size for b in lengths if b.size > 3}):
        alike = [b for b in lengths if b.size == size]
        if len(alike) in (2, 3):
            at = np.column_stack([places_of(free, b) for b in alike])
            yield Cloud(listed([b.name for b in alike]), tuple(alike), at)


def point_columns(X: Array) -> Array:
    """How points (N, d) move, (N d, g): d shifts, the turns, a scale, and what else is projective.

    Stretches and shears complete the linear maps; then every point moves along itself by X (v'X).
    """
    d, axes = X.shape[1], np.eye(X.shape[1])
    turns = [X @ (np.outer(axes[i], axes[j]) - np.outer(axes[j], axes[i])) for i, j in _planes(d)]
    shears = [
        X @ (np.outer(axes[i], axes[j]) + np.outer(axes[j], axes[i]))
        for i, j in combinations(range(d), 2)
    ]
    moves = [*(np.broadcast_to(axis, X.shape) for axis in axes), *turns, X]
    moves += [*(X * axis for axis in axes[:-1]), *shears, *(X * X[:, k : k + 1] for k in range(d))]
    return np.column_stack([move.ravel() for move in moves])


def _planes(d: int) -> list[tuple[int, int]]:
    """The planes of the turns: about x, y and z in space, counter-clockwise."""
    return [(0, 1)] if d == 2 else [(1, 2), (2, 0), (0, 1)]


def similarity(cloud: Cloud) -> Generator:
    """Shifts, turns and a scale of points."""
    d = cloud.places.shape[1]
    turns = len(_planes(d))
    segments = (
        Segment("translation", d, lambda c: f"a translation along {axis_of(c[:d])}"),
        Segment("rotation", turns, lambda c: _rotation(c, d)),
        Segment("scale", 1, lambda c: "a scale" + _about(-c[:d] / c[d + turns], c[:d])),
    )
    like = d if cloud.blocks[0].shape[-1] == d else 0
    return _of_points(cloud, 0, d + turns + 1, segments, like=like)


def bending(cloud: Cloud) -> Generator:
    """Stretches and shears of points, and moves of the plane, or line, at infinity."""
    d = cloud.places.shape[1]
    plane = "line" if d == 2 else "plane"
    said = [f"a stretch along {axis}" for axis in "xyz"[: d - 1]]
    said += [f"a shear of {'xyz'[i]} and {'xyz'[j]}" for i, j in combinations(range(d), 2)]
    moved = [f"a move of the {plane} at infinity along {axis}, a projective map" for axis in "xyz"]
    segments = (
        Segment("mixing", len(said), lambda c: said[int(np.argmax(abs(c)))]),
        Segment("projective", d, lambda c: moved[int(np.argmax(abs(c))) - len(said)]),
    )
    first = d + len(_planes(d)) + 1
    return _of_points(cloud, first, first + len(said) + d, segments, single=True)


def any_map(cloud: Cloud) -> Generator:
    """All motions of points at once, to tell points from rows of coefficients."""
    d = cloud.places.shape[1]
    count = 2 * d + d * d
    return _of_points(cloud, 0, count, (Segment("", count, lambda c: ""),))


def _of_points(
    cloud: Cloud,
    first: int,
    last: int,
    segments: tuple[Segment, ...],
    *,
    single: bool = False,
    like: int = 0,
) -> Generator:
    places = cloud.places

    def columns(x: Array) -> Array:
        return point_columns(x[places])[:, first:last]

    names = tuple(b.name for b in cloud.blocks)
    return Generator(cloud.name, names, places.ravel(), columns, segments, single, like=like)


def _rotation(c: Array, d: int) -> str:
    """`a rotation about x`, with the point that it holds where that is not the origin."""
    t, w = c[:d], c[d : d + len(_planes(d))]
    if d == 2:
        return "a rotation" + _about(np.array([-t[1], t[0]]) / w[0], t)
    held = np.cross(w, t) / (w @ w)
    return f"a rotation about {axis_of(w)}" + _about(held, t).replace("about", "through")


def _about(place: Array, shift: Array) -> str:
    if np.linalg.norm(shift) <= ROUNDING * np.linalg.norm(place) or not shift.any():
        return ""
    return f" about {_place(place)}"


def axis_of(v: Array) -> str:
    """The name of an axis (d,): `x`, or the vector `(0.6, 0.8, 0)`."""
    v = v / np.linalg.norm(v)
    main = int(np.argmax(abs(v)))
    return "xyz"[main] if abs(v[main]) > 1 - ROUNDING else _place(v)


def _place(v: Array) -> str:
    v = np.where(abs(v) > ROUNDING * abs(v).max(initial=0.0), v, 0.0)
    return f"({', '.join(f'{c:.3g}' for c in v)})"


# Matrices of coefficients.


def matrices(free: Layout, block: Block, points: bool) -> Iterator[tuple[str, Index]]:
    """The rows, columns or other slices of an array (N, h): what they are, and their places.

    A vector is one column without a name. Of points only rows may have factors of their own.
    """
    at = places_of(free, block).reshape(block.shape)
    if len(block.shape) == 1 and block.size > 1:
        yield "", at[:, None]
    if len(block.shape) == 2 and min(block.shape) > 1:
        yield "row", at.T
        if not points:
            yield "column", at
    if len(block.shape) > 2:
        for axis, h in enumerate(block.shape):
            if h < block.size:
                yield f"slice {axis},", np.moveaxis(at, axis, -1).reshape(-1, h)


def factors_and_offsets(block: Block, what: str, places: Index, points: bool) -> Generator | None:
    """A factor of one column of A, or the same amount added to it."""
    N, h = places.shape
    if N * h * 2 * h > LARGEST:
        return None

    def columns(x: Array) -> Array:
        found = np.zeros((N, h, h if points else 2 * h))
        each = np.arange(h)
        found[:, each, each] = x[places]
        if not points:
            found[:, each, h + each] = 1.0
        return found.reshape(N * h, -1)

    def words(said: str, c: Array, first: int) -> str:
        k = int(np.argmax(abs(c))) - first
        return f"{said} of {what} {k}" if what else said

    one = "a factor" if what else "a common factor"
    segments = [Segment("scale", h, lambda c: words(one, c, 0))]
    if not points:
        segments.append(Segment("offset", h, lambda c: words("a common offset", c, h)))
    return Generator(
        block.name, (block.name,), places.ravel(), columns, tuple(segments), single=True
    )


def may_mix(what: str, places: Index) -> bool:
    """Whether columns of A (N, h) are asked whether they mix."""
    h = places.shape[1]
    return bool(what) and h <= WIDEST and places.size * h * h <= LARGEST


def mixtures(block: Block, what: str, places: Index) -> Iterator[Generator]:
    """One column of A added to another, then rotations among them."""
    h = places.shape[1]
    pairs = [(i, j) for i, j in np.ndindex(h, h) if i != j]
    planes = list(combinations(range(h), 2))

    def added(c: Array) -> str:
        i, j = pairs[int(np.argmax(abs(c)))]
        return f"{what} {i} added to {what} {j}"

    def turned(c: Array) -> str:
        k = int(np.argmax(abs(c)))
        if abs(c[k]) < (1 - ROUNDING) * np.linalg.norm(c):
            return f"a rotation of the {what}s"
        return f"a rotation of {what}s {planes[k][0]} and {planes[k][1]}"

    own = (block.name, (block.name,), places.ravel())
    sums = _mixing(places, [[(i, j, 1.0)] for i, j in pairs])
    yield Generator(*own, sums, (Segment("mixing", len(pairs), added),), single=True)
    turns = _mixing(places, [[(i, j, 1.0), (j, i, -1.0)] for i, j in planes])
    yield Generator(*own, turns, (Segment("rotation", len(planes), turned),))


def _mixing(
    places: Index, maps: Sequence[Sequence[tuple[int, int, float]]]
) -> Callable[[Array], Array]:
    """The columns by which A (N, h) moves with each map E, given by its entries (i, j, value)."""

    def columns(x: Array) -> Array:
        A = x[places]
        found = np.zeros((*A.shape, len(maps)))
        for k, entries in enumerate(maps):
            for i, j, value in entries:
                found[:, j, k] += value * A[:, i]
        return found.reshape(-1, len(maps))

    return columns


# Frames.


def shifts(free: Layout, spatial: Sequence[Block]) -> Iterator[Generator]:
    """A place moves along a fixed direction, and other places undo that."""
    for block in spatial:
        others = [b for b in spatial if b is not block and b.size == block.size]
        if others:
            yield Generator(
                block.name,
                (block.name,),
                places_of(free, block),
                _identity(block.size),
                (Segment("translation", block.size, _along),),
                others=together(free, others),
                with_others=True,
            )


def _identity(size: int, rows: int = 1) -> Callable[[Array], Array]:
    """The columns by which each of these rows may be shifted."""
    return lambda x: np.tile(np.eye(size), (rows, 1))


def _along(c: Array) -> str:
    return f"a translation along {axis_of(c)}"


def turns(block: Block, at: Index, frames: Index | None) -> Generator:
    """Rotation vectors (K, 3) turn about an axis of the world.

    What undoes that are the `frames`, or anything if they are None.
    """

    def columns(x: Array) -> Array:
        return np.asarray(inverse_left_jacobian(x[at].reshape(-1, 3)).reshape(-1, 3))

    segments = (Segment("rotation", 3, lambda c: f"a rotation about {axis_of(c)}"),)
    alone = len(at) == 3
    return Generator(block.name, (block.name,), at, columns, segments, False, frames, alone)


# Groups of numbers.


def block_groups(
    free: Layout, blocks: Sequence[Block], islands: Sequence[Index]
) -> Iterator[Group]:
    """Blocks, as far as rows tie them; of what may be points each column may shift by itself."""
    for block in blocks:
        for island in islands:
            own = np.intersect1d(island, places_of(free, block))
            if not own.size:
                continue
            part = own.size < block.size
            name = rows_of(block, own - free.slices[block.name].start) if part else block.name
            yield Group(name, own, True, block.name)
            d = block.shape[-1] if in_space(block) else 1
            if d == 1:
                yield Group(name, own, False, block.name)
            elif own.size > d:
                for k in range(d):
                    yield Group(f"column {k} of {name}", own[k::d], False, block.name)


# Bodies at rest.


def rest(problem: Problem) -> Iterator[Generator]:
    """What registrations cannot tell of a body whose arrays are unknown: the gauges of training.

    A subject's template and joints move, and every place moves back; so does the root joint, as far
    as its rotation moves it. (That all templates may turn, and with them joints and blend shapes,
    is a rotation of points.)

    Loper et al. (SMPL, 2015, section 4.1) keep joints near the rings between segments, since data
    do not determine the root.
    """
    free = problem.free
    sources = [getattr(points.source, "rest", None) for points in problem.points]
    subjects: dict[tuple[str | None, str | None], list[Rest]] = {}
    for one in (source for source in sources if source is not None):
        if one.trans not in free.slices:
            return
        subjects.setdefault((one.template, one.joints), []).append(one)
    for (template, joints), scans in subjects.items():
        back = together(free, list(dict.fromkeys(one.trans for one in scans)))
        names = [name for name in (template, joints) if name and name in free.slices]
        moved = [(listed(names), names, together(free, names))] if names else []
        if joints and joints in free.slices:
            moved.append((f"{joints}[root]", [joints], places_of(free, joints)[:3]))
        for name, blocks, at in moved:
            segment = Segment("translation", 3, _along)
            columns = _identity(3, len(at) // 3)
            yield Generator(
                name, tuple(blocks), at, columns, (segment,), others=back, with_others=True
            )
