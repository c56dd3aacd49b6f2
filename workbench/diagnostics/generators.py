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
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout
from workbench.blocks.points import Rest
from workbench.diagnostics.words import LENGTHS, in_space, listed, rows_of
from workbench.geometry.rotation import inverse_left_jacobian
from workbench.problem import Problem

ANGLES = ("rad", "deg")
MOST_NUMBERS = 4_000_000  # in the columns of a generator
MOST_COLUMNS = 24  # of a matrix, up to which every sum and rotation of two is asked for
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
        needs_others: whether it counts only if others really move.
        row_width: the width of rows that may move in the same way in other blocks; 0 for none.
    """

    name: str
    blocks: tuple[str, ...]
    places: Index
    columns: Callable[[Array], Array]
    segments: tuple[Segment, ...]
    single: bool = False
    others: Index | None = None
    needs_others: bool = False
    row_width: int = 0

    def slices(self) -> list[slice]:
        """The columns of each segment."""
        stops = np.cumsum([segment.width for segment in self.segments]).tolist()
        return [slice(start, stop) for start, stop in pairwise([0, *stops])]


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
    part = free.slices[block if isinstance(block, str) else block.name]
    return np.arange(part.start, part.stop)


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
            places = np.array([places_of(free, b) for b in single])
            yield Cloud(listed([b.name for b in single]), tuple(single), places)
    for size in sorted({b.size for b in lengths if b.size > 3}):
        alike = [b for b in lengths if b.size == size]
        if len(alike) in (2, 3):
            places = np.column_stack([places_of(free, b) for b in alike])
            yield Cloud(listed([b.name for b in alike]), tuple(alike), places)


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
    row_width = d if cloud.blocks[0].shape[-1] == d else 0
    return _of_points(cloud, 0, segments, row_width=row_width)


def bending(cloud: Cloud) -> Generator:
    """Stretches and shears of points, and moves of the plane, or line, at infinity."""
    d = cloud.places.shape[1]
    plane = "line" if d == 2 else "plane"
    mixings = [f"a stretch along {axis}" for axis in "xyz"[: d - 1]]
    mixings += [f"a shear of {'xyz'[i]} and {'xyz'[j]}" for i, j in combinations(range(d), 2)]
    maps = [f"a move of the {plane} at infinity along {axis}, a projective map" for axis in "xyz"]
    segments = (
        Segment("mixing", len(mixings), lambda c: mixings[int(np.argmax(abs(c)))]),
        Segment("projective", d, lambda c: maps[int(np.argmax(abs(c))) - len(mixings)]),
    )
    return _of_points(cloud, d + len(_planes(d)) + 1, segments, single=True)


def any_map(cloud: Cloud) -> Generator:
    """All motions of points at once, to tell points from rows of coefficients."""
    d = cloud.places.shape[1]
    turns = len(_planes(d))
    widths = {"translation": d, "rotation": turns, "scale": 1}
    widths |= {"stretch": d - 1, "shear": turns, "projective": d}
    segments = tuple(Segment(kind, width, lambda c: "") for kind, width in widths.items())
    return _of_points(cloud, 0, segments)


def _of_points(
    cloud: Cloud,
    first: int,
    segments: tuple[Segment, ...],
    *,
    single: bool = False,
    row_width: int = 0,
) -> Generator:
    """A generator of points by some of their columns, from the `first` on."""
    places, stop = cloud.places, first + sum(segment.width for segment in segments)

    def columns(x: Array) -> Array:
        return point_columns(x[places])[:, first:stop]

    names = tuple(b.name for b in cloud.blocks)
    return Generator(
        cloud.name, names, places.ravel(), columns, segments, single, row_width=row_width
    )


def _rotation(c: Array, d: int) -> str:
    """`a rotation about x`, with the point that stays in place where that is not the origin."""
    t, w = c[:d], c[d : d + len(_planes(d))]
    if d == 2:
        return "a rotation" + _about(np.array([-t[1], t[0]]) / w[0], t)
    center = np.cross(w, t) / (w @ w)
    return f"a rotation about {axis_of(w)}" + _about(center, t).replace("about", "through")


def _about(place: Array, shift: Array) -> str:
    if np.linalg.norm(shift) <= ROUNDING * np.linalg.norm(place) or not shift.any():
        return ""
    return f" about {_place(place)}"


def axis_of(v: Array) -> str:
    """The name of an axis (d,): `x`, or the vector `(0.6, 0.8, 0)`."""
    v = v / np.linalg.norm(v)
    largest = int(np.argmax(abs(v)))
    return "xyz"[largest] if abs(v[largest]) > 1 - ROUNDING else _place(v)


def _place(v: Array) -> str:
    v = np.where(abs(v) > ROUNDING * abs(v).max(initial=0.0), v, 0.0)
    return f"({', '.join(f'{c:.3g}' for c in v)})"


# Matrices of coefficients.


class Matrix(NamedTuple):
    """An array (N, h) of coefficients, whose columns may have factors and offsets, or mix.

    Attributes:
        block: the block that they belong to.
        column: what a column is called: `row`, `column` or `slice 0,` of the block; empty for a
            vector, which is one column.
        places: (N, h) their places among the free numbers.
        points: whether the block's rows are points.
    """

    block: Block
    column: str
    places: Index
    points: bool


def matrices(free: Layout, block: Block, points: bool) -> Iterator[Matrix]:
    """The rows, the columns or other slices of an array. Of points, only the rows."""
    places = places_of(free, block).reshape(block.shape)
    if len(block.shape) == 1 and block.size > 1:
        yield Matrix(block, "", places[:, None], points)
    if len(block.shape) == 2 and min(block.shape) > 1:
        yield Matrix(block, "row", places.T, points)
        if not points:
            yield Matrix(block, "column", places, points)
    if len(block.shape) > 2:
        for axis, h in enumerate(block.shape):
            if h < block.size:
                by_slice = np.moveaxis(places, axis, -1).reshape(-1, h)
                yield Matrix(block, f"slice {axis},", by_slice, points)


def may_scale(matrix: Matrix) -> bool:
    """Whether columns are asked for factors and offsets: not in a very large matrix."""
    return bool(2 * matrix.places.size * matrix.places.shape[1] <= MOST_NUMBERS)


def factors_and_offsets(matrix: Matrix) -> Generator:
    """A factor of one column of A, or the same amount added to it; of points, factors alone."""
    places, points = matrix.places, matrix.points
    N, h = places.shape

    def columns(x: Array) -> Array:
        D = np.zeros((N, h, h if points else 2 * h))
        each = np.arange(h)
        D[:, each, each] = x[places]
        if not points:
            D[:, each, h + each] = 1.0
        return D.reshape(N * h, -1)

    def words(motion: str, c: Array, first: int) -> str:
        k = int(np.argmax(abs(c))) - first
        return f"{motion} of {matrix.column} {k}" if matrix.column else motion

    factor = "a factor" if matrix.column else "a common factor"
    segments = [Segment("scale", h, lambda c: words(factor, c, 0))]
    if not points:
        segments.append(Segment("offset", h, lambda c: words("a common offset", c, h)))
    name = matrix.block.name
    return Generator(name, (name,), places.ravel(), columns, tuple(segments), single=True)


def may_mix(matrix: Matrix) -> bool:
    """Whether columns are asked whether they mix: not those of points or of a large matrix."""
    h = matrix.places.shape[1]
    small = h <= MOST_COLUMNS and matrix.places.size * h * h <= MOST_NUMBERS
    return bool(matrix.column) and not matrix.points and small


def column_sums(matrix: Matrix) -> Generator:
    """One column of A added to another."""
    name, h = matrix.block.name, matrix.places.shape[1]
    pairs = [(i, j) for i, j in np.ndindex(h, h) if i != j]

    def words(c: Array) -> str:
        i, j = pairs[int(np.argmax(abs(c)))]
        return f"{matrix.column} {i} added to {matrix.column} {j}"

    columns = _mixing(matrix.places, [[(i, j, 1.0)] for i, j in pairs])
    segment = Segment("mixing", len(pairs), words)
    return Generator(name, (name,), matrix.places.ravel(), columns, (segment,), single=True)


def column_rotations(matrix: Matrix) -> Generator:
    """Rotations among the columns of A."""
    name, h = matrix.block.name, matrix.places.shape[1]
    planes = list(combinations(range(h), 2))

    def words(c: Array) -> str:
        k = int(np.argmax(abs(c)))
        if abs(c[k]) < (1 - ROUNDING) * np.linalg.norm(c):
            return f"a rotation of the {matrix.column}s"
        return f"a rotation of {matrix.column}s {planes[k][0]} and {planes[k][1]}"

    columns = _mixing(matrix.places, [[(i, j, 1.0), (j, i, -1.0)] for i, j in planes])
    segment = Segment("rotation", len(planes), words)
    return Generator(name, (name,), matrix.places.ravel(), columns, (segment,))


def _mixing(
    places: Index, maps: Sequence[Sequence[tuple[int, int, float]]]
) -> Callable[[Array], Array]:
    """The columns by which A (N, h) moves with each map E, given by its entries (i, j, value)."""

    def columns(x: Array) -> Array:
        A = x[places]
        D = np.zeros((*A.shape, len(maps)))
        for k, entries in enumerate(maps):
            for i, j, value in entries:
                D[:, j, k] += value * A[:, i]
        return D.reshape(-1, len(maps))

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
                needs_others=True,
            )


def _identity(size: int, rows: int = 1) -> Callable[[Array], Array]:
    """The columns by which each of these rows may be shifted."""
    return lambda x: np.tile(np.eye(size), (rows, 1))


def _along(c: Array) -> str:
    return f"a translation along {axis_of(c)}"


def turns(block: Block, places: Index, frames: Index | None) -> Generator:
    """Rotation vectors (K, 3) turn about an axis of the world.

    What undoes that are the `frames`, or anything if they are None.
    """

    def columns(x: Array) -> Array:
        return np.asarray(inverse_left_jacobian(x[places].reshape(-1, 3)).reshape(-1, 3))

    segment = Segment("rotation", 3, lambda c: f"a rotation about {axis_of(c)}")
    return Generator(
        block.name,
        (block.name,),
        places,
        columns,
        (segment,),
        others=frames,
        needs_others=len(places) == 3,
    )


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
    as its rotation moves it (Loper et al., SMPL, 2015, section 4.1).
    """
    free = problem.free
    sources = [getattr(points.source, "rest", None) for points in problem.points]
    subjects: dict[tuple[str | None, str | None], list[Rest]] = {}
    for source in (source for source in sources if source is not None):
        if source.trans not in free.slices:
            return
        subjects.setdefault((source.template, source.joints), []).append(source)
    for (template, joints), scans in subjects.items():
        undoing = together(free, list(dict.fromkeys(scan.trans for scan in scans)))
        names = [name for name in (template, joints) if name and name in free.slices]
        moved = [(listed(names), names, together(free, names))] if names else []
        if joints and joints in free.slices:
            moved.append((f"{joints}[root]", [joints], places_of(free, joints)[:3]))
        for name, blocks, places in moved:
            segment = Segment("translation", 3, _along)
            columns = _identity(3, len(places) // 3)
            yield Generator(
                name, tuple(blocks), places, columns, (segment,), others=undoing, needs_others=True
            )
