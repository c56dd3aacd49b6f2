"""What a user may do to make something known: hold a camera or a row, or measure a distance."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from scipy.sparse import csc_array, csr_array

from workbench.arrays import Array, Index
from workbench.blocks import Layout
from workbench.diagnostics.diagnosis import Diagnosis
from workbench.diagnostics.words import families, in_space, row_label

RIGID = ("translation", "rotation", "shift")  # gauges of points, between which there are distances
ENDS = 30  # points of a block between which distances are tried
WIDE = 2000  # rows of a block up to which each is tried as a thing
INDEPENDENT = 1e-3  # smallest singular value of the rows of a thing, of their largest


@dataclass(frozen=True, eq=False)
class Act:
    """One thing that a user does.

    Attributes:
        what: what is held, such as `cam0` or `the distance of points[1] and points[7]`.
        weights: (g, q) the combinations of unknowns that it determines.
        places: (q,) the places of these unknowns.
        entries: the places of the unknowns that are held; none for a distance.
        ends: the block and the two rows between which a distance is measured.
    """

    what: str
    weights: Array = field(repr=False)
    places: Index = field(repr=False)
    entries: tuple[int, ...] = ()
    ends: tuple[str, int, int] | None = None

    @property
    def size(self) -> int:
        """How many numbers it determines."""
        return len(self.weights)

    def seen(self, null: Array) -> Array:
        """How its numbers change along the directions of a null space (n, k): (g, k)."""
        return np.asarray(self.weights @ null[self.places])


def held(what: str, entries: Sequence[int]) -> Act:
    """These entries (g,) are held, under one name."""
    return Act(what, np.eye(len(entries)), np.array(entries, dtype=np.int64), tuple(entries))


def is_new(act: Act, null: Array) -> bool:
    """Whether every number of an act determines something that is still free."""
    seen = act.seen(null)
    lengths = np.linalg.norm(act.weights, axis=1)
    s = np.linalg.svd(seen / lengths[:, None], compute_uv=False)
    return bool(s[-1] > INDEPENDENT * max(s[0], 1e-3)) and len(s) == act.size


def things_to_hold(free: Layout, null: Array, pattern: csc_array) -> list[Act]:
    """What can be held as one thing, and is not known in any of its directions.

    `pattern` (m, n) says which unknowns a residual reads. Rows of the same number in two blocks are
    one thing, unless a residual reads different rows of the two.
    """
    k = null.shape[1]
    at = {b.name: range(free.slices[b.name].start, free.slices[b.name].stop) for b in free.blocks}
    found: dict[tuple[int, ...], str] = {}

    def add(what: str, entries: Sequence[int]) -> None:
        if 1 < len(entries) <= k:
            found.setdefault(tuple(entries), what)

    for one, members in families(free.names).items():
        add(one, [i for name in members for i in at[name]])
    by_count: dict[int, list[str]] = {}
    for block in free.blocks:
        add(block.name, at[block.name])
        if len(block.shape) == 2 and block.shape[1] > 1 and 1 < block.shape[0] <= WIDE:
            by_count.setdefault(block.shape[0], []).append(block.name)
    for count, names in by_count.items():
        pairs = [p for p in combinations(names, 2) if _row_by_row(free, p, count, pattern)]
        for row in range(count):
            wide = {name: free[name].shape[1] for name in names}
            some = {n: list(at[n][row * w : (row + 1) * w]) for n, w in wide.items()}
            called = {n: _row(free, n, row) for n in names}
            for name in names:
                add(called[name], some[name])
            for pair in pairs:
                add(" and ".join(called[n] for n in pair), [i for n in pair for i in some[n]])
    acts = [held(what, entries) for entries, what in found.items()]
    return [act for act in acts if is_new(act, null)]


def _row_by_row(free: Layout, pair: tuple[str, str], count: int, pattern: csc_array) -> bool:
    """Whether what reads both blocks reads some row of the one and the same row of the other.

    So do residuals of a star that has a place and a velocity. Markers and views, of which there may
    be as many by chance, are read in any order.
    """
    reads = []
    for name in pair:
        part = pattern[:, free.slices[name]].tocoo()
        row = part.col // (free[name].size // count)
        reads.append(csr_array((np.ones(row.size), (part.row, row)), (pattern.shape[0], count)))
    both = np.diff(reads[0].indptr).astype(bool) & np.diff(reads[1].indptr).astype(bool)
    same = np.diff(csr_array(reads[0].multiply(reads[1])).indptr).astype(bool)
    return bool(same[both].all())


def _row(free: Layout, name: str, row: int) -> str:
    """`pose[left_hand]`, or `points[3]`."""
    return f"{name}[{row_label(free[name], row, free[name].shape[-1])}]"


def distances_to_measure(d: Diagnosis, null: Array) -> list[Act]:
    """Distances between points that move in the null space."""
    free, x = d.free, d.problem.split(d.values)[0]
    moved = np.zeros(free.size, dtype=bool)
    for direction in d.null_directions:
        if direction.kind in RIGID:
            moved |= direction.vector != 0
    found = []
    for block in free.blocks:
        wide = block.shape[-1] if block.shape else 0
        if not in_space(block) or block.size <= wide or block.whole is not None:
            continue
        at = free.slices[block.name]
        if not moved[at].all():
            continue
        X = x[at].reshape(-1, wide)
        if np.linalg.norm(null[at]) < INDEPENDENT:
            continue
        for i, j in combinations(range(0, len(X), -(-len(X) // ENDS)), 2):
            apart = X[i] - X[j]
            length = float(np.linalg.norm(apart))
            if not length:
                continue
            row = np.concatenate([apart, -apart])[None] / length
            places = at.start + np.concatenate([wide * k + np.arange(wide) for k in (i, j)])
            ends = f"{_row(free, block.name, i)} and {_row(free, block.name, j)}"
            act = Act(f"the distance of {ends}", row, places, (), (block.name, i, j))
            if np.linalg.norm(act.seen(null)) > INDEPENDENT:
                found.append(act)
    return found
