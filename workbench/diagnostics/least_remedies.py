"""The least remedies: the fewest numbers to hold, or distances to measure, so that all is known.

A null space of dimension k needs k numbers, and no set of k numbers serves if a direction of the
null space changes none of them. In rows of an orthonormal basis N (n, k), measured in yardsticks,
the entries S serve if N[S] (k, k) is invertible, and well if its determinant is large. They are
found by QR with pivoting (Golub and Van Loan, Matrix Computations, section 5.4), and then exchanged
for others as long as that makes the determinant larger.

A user does not hold numbers but things: a camera, a row of points. A thing of g entries counts as
one act, and is taken if its g rows of N are independent: so no more is held than is unknown. The
length between two points is one act and one number.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
import scipy.linalg

from workbench.arrays import Array, Index
from workbench.blocks import Layout
from workbench.diagnostics.diagnosis import Diagnosis
from workbench.diagnostics.structure import gathered
from workbench.diagnostics.suggestion import Suggestion
from workbench.diagnostics.things import families, in_space, row_label
from workbench.diagnostics.trials import fewer_unseen, tried, with_more
from workbench.problem import Constraint, Problem

MOST = 200  # null directions up to which remedies are searched for
RIGID = ("translation", "rotation", "shift")  # gauges of points, between which there are distances
ENDS = 30  # points of a block between which distances are tried
FIRST = 6  # things that are tried as the first one
WIDE = 2000  # rows of a block up to which each is tried as a thing
INDEPENDENT = 1e-3  # smallest singular value of the rows of a thing, of their largest
EXCHANGES = 100
BETTER = 1.01  # by which an exchange must enlarge the determinant


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


def least_remedies(d: Diagnosis) -> list[Suggestion]:
    """Remedies of the least number of numbers, fewest acts first; each was carried out."""
    k = d.shape[1] - d.rank
    if not 0 < k <= MOST or k == d.shape[1]:
        return []
    sizes = d.point.yardsticks.sizes
    null = np.linalg.qr(d.point.constrained.null / sizes[:, None])[0]
    found: list[Suggestion] = []
    seen: set[tuple[str, ...]] = set()
    for acts in sorted(_searched(d, null), key=len):
        key = tuple(sorted(act.what for act in acts))
        if key not in seen:
            seen.add(key)
            found += _carried_out(d, acts)
    ranked = sorted(found, key=lambda s: (s.acts, s.numbers, s.after.condition))
    kinds = (ranked, [s for s in ranked if _measures(s, d)], [s for s in ranked if s.acts == k])
    return sorted({id(one): one for kind in kinds for one in kind[:1]}.values(), key=ranked.index)


def _measures(suggestion: Suggestion, d: Diagnosis) -> bool:
    """Whether it measures a distance, and holds no more things than that needs."""
    return len(suggestion.problem.constraints) > len(d.problem.constraints)


def _searched(d: Diagnosis, null: Array) -> Iterator[list[Act]]:
    """Sets of acts that determine every direction of the null space (n, k)."""
    entries = _entries(d.free, null)
    yield entries
    groups = _things(d.free, null)
    firsts = sorted(groups, key=lambda act: (-act.size, -_volume(act.seen(null))))
    wide = [act for act in firsts if act.size == firsts[0].size][:FIRST]
    distances = _distances(d, null)
    for first in [None, *wide, *_of_other_sizes(firsts)]:
        chosen = [] if first is None else [first]
        left = _left(null, chosen)
        while first is not None and left.shape[1]:
            fitting = [act for act in groups if act.size <= left.shape[1] and _new(act, left)]
            if not fitting:
                break
            chosen.append(max(fitting, key=lambda act: (act.size, _volume(act.seen(left)))))
            left = _left(null, chosen)
        if chosen:
            yield [*chosen, *_entries(d.free, left)]
        if distances and left.shape[1]:
            measured = _pivoted(distances, left)
            rest = _left(left, measured)
            yield [*chosen, *measured, *_entries(d.free, rest)]


def _of_other_sizes(acts: Sequence[Act]) -> list[Act]:
    """The first act of each size but the first one."""
    found: dict[int, Act] = {}
    for act in acts:
        found.setdefault(act.size, act)
    return list(found.values())[1:]


def _left(null: Array, acts: Sequence[Act]) -> Array:
    """What of the null space (n, k) is still free when these acts are done."""
    if not acts or not null.shape[1]:
        return null
    seen = np.vstack([act.seen(null) for act in acts])
    _, s, Vt = np.linalg.svd(seen, full_matrices=True)
    rank = int(np.sum(s > INDEPENDENT * 1e-3 * s.max(initial=0.0)))
    return np.asarray(null @ Vt[rank:].T)


def _new(act: Act, null: Array) -> bool:
    """Whether every number of an act determines something that is still free."""
    seen = act.seen(null)
    lengths = np.linalg.norm(act.weights, axis=1)
    s = np.linalg.svd(seen / lengths[:, None], compute_uv=False)
    return bool(s[-1] > INDEPENDENT * max(s[0], 1e-3)) and len(s) == act.size


def _volume(seen: Array) -> float:
    """The logarithm of the product of the singular values of rows (g, k), for each row."""
    s = np.linalg.svd(seen, compute_uv=False)
    return float(np.mean(np.log(np.maximum(s, 1e-300))))


def _entries(free: Layout, null: Array) -> list[Act]:
    """As many entries as the null space (n, k) has dimensions, of a large determinant."""
    k = null.shape[1]
    if not k:
        return []
    chosen = scipy.linalg.qr(null.T, mode="r", pivoting=True)[1][:k]
    for _ in range(EXCHANGES):
        by = null @ np.linalg.inv(null[chosen])
        i, j = np.unravel_index(np.argmax(abs(by)), by.shape)
        if abs(by[i, j]) < BETTER:
            break
        chosen[j] = i
    return [_held(free.label(int(i)), [int(i)]) for i in np.sort(chosen)]


def _held(what: str, entries: Sequence[int]) -> Act:
    return Act(what, np.eye(len(entries)), np.array(entries, dtype=np.int64), tuple(entries))


def _things(free: Layout, null: Array) -> list[Act]:
    """What can be held as one thing, and is not known in any of its directions."""
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
        for row in range(count):
            wide = {name: free[name].shape[1] for name in names}
            some = {n: list(at[n][row * w : (row + 1) * w]) for n, w in wide.items()}
            called = {n: _row(free, n, row) for n in names}
            for name in names:
                add(called[name], some[name])
            for pair in combinations(names, 2):
                add(" and ".join(called[n] for n in pair), [i for n in pair for i in some[n]])
    acts = [_held(what, entries) for entries, what in found.items()]
    return [act for act in acts if _new(act, null)]


def _row(free: Layout, name: str, row: int) -> str:
    """`pose[left_hand]`, or `points[3]`."""
    return f"{name}[{row_label(free[name], row, free[name].shape[-1])}]"


def _distances(d: Diagnosis, null: Array) -> list[Act]:
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


def _pivoted(acts: Sequence[Act], null: Array) -> list[Act]:
    """As many independent acts of one number as there are, up to the dimension of null (n, k)."""
    seen = np.vstack([act.seen(null) for act in acts])
    _, R, pivots = scipy.linalg.qr(seen.T, mode="economic", pivoting=True)
    size = abs(np.diag(R))
    return [acts[int(p)] for p, s in zip(pivots, size, strict=False) if s > INDEPENDENT]


def _carried_out(d: Diagnosis, acts: Sequence[Act]) -> list[Suggestion]:
    held = sorted({i for act in acts for i in act.entries})
    left = np.setdiff1d(np.arange(d.free.size), held)
    if not left.size:
        return []
    k = sum(act.size for act in acts)
    problem = d.problem.freeing(*d.free.chosen(left).spelled())
    problem = with_more(
        problem, constraints=[_measured(d, act, problem) for act in acts if act.ends]
    )
    numbers = "one number" if k == 1 else f"{k} numbers"
    return tried(
        d,
        "least",
        _said(acts),
        f"{numbers} for as many null directions: the fewest that can determine everything",
        "nothing where these directions are gauges; elsewhere what is held must be right",
        problem,
        lambda before, after: fewer_unseen(before, after) and after.rank == after.unknowns,
        acts=len(acts),
        numbers=k,
    )


def _measured(d: Diagnosis, act: Act, problem: Problem) -> Constraint:
    """The distance held at its present value."""
    assert act.ends is not None
    name, i, j = act.ends
    block = d.problem.known[name]
    X = np.asarray(d.values[name]).reshape(block.shape)
    length = float(np.linalg.norm(X[i] - X[j]))
    apart = block.symbol[:, i] - block.symbol[:, j]
    square = (apart.T @ apart) / (2 * length) - length / 2  # of slope 1 in the distance
    return Constraint(_unused(act.what, problem), square, 0.0, 0.0, block.unit)


def _unused(name: str, problem: Problem) -> str:
    while name in {constraint.name for constraint in problem.constraints}:
        name += "'"
    return name


def _said(acts: Sequence[Act]) -> str:
    """`hold cam0 and the distance of points[0] and points[3]`, or `fix a, b[2 3] and c`."""
    single = [act.what for act in acts if len(act.entries) == 1]
    others = [act.what for act in acts if len(act.entries) != 1]
    words = others + gathered(single)
    verb = "hold" if others else "fix"
    return (
        f"{verb} {words[0]}"
        if len(words) == 1
        else f"{verb} {', '.join(words[:-1])} and {words[-1]}"
    )
