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

import numpy as np
import scipy.linalg

from workbench.arrays import Array, Index
from workbench.blocks import Layout
from workbench.diagnostics.acts import (
    INDEPENDENT,
    Act,
    distances_to_measure,
    held,
    is_new,
    things_to_hold,
)
from workbench.diagnostics.diagnosis import Diagnosis
from workbench.diagnostics.suggestion import Suggestion
from workbench.diagnostics.trials import fewer_unseen, tried, with_more
from workbench.diagnostics.words import gathered
from workbench.problem import Constraint, Problem

MOST = 200  # null directions up to which remedies are searched for
FIRST = 6  # things that are tried as the first one
EXCHANGES = 100
DIGITS = 6  # of what remedies are compared by; fewer than rounding changes
TIE = 1e-6  # of a column: by less they count as equal
BETTER = 1.01  # by which an exchange must enlarge the determinant


def least_remedies(d: Diagnosis) -> list[Suggestion]:
    """Remedies of the least number of numbers, fewest acts first; each was carried out.

    Among those of as many acts the one comes first after which no direction is nearly unknown.
    """
    k = d.shape[1] - d.rank
    if not 0 < k <= MOST or k == d.shape[1]:
        return []
    null = d.point.null_in(d.point.measured, d.point.yardsticks.sizes)
    found: list[tuple[float, Suggestion]] = []
    seen: set[tuple[str, ...]] = set()
    for acts in sorted(_searched(d, null), key=len):
        key = tuple(sorted(act.what for act in acts))
        if key not in seen:
            seen.add(key)
            found += [(_weakest(acts, null), one) for one in _carried_out(d, acts)]
    ranked = [s for _, s in sorted(found, key=lambda f: (f[1].acts, f[1].numbers, -f[0]))]
    kinds = (ranked, [s for s in ranked if _measures(s, d)], [s for s in ranked if s.acts == k])
    return sorted({id(one): one for kind in kinds for one in kind[:1]}.values(), key=ranked.index)


def _weakest(acts: Sequence[Act], null: Array) -> float:
    """How far a set of acts is from leaving a direction of the null space (n, k) unknown.

    It is the smallest change of what is held along a unit vector, in yardsticks, so that no unit
    decides which set is the best one.
    """
    seen = np.vstack([act.seen(null) for act in acts])
    return float(np.round(np.linalg.svd(seen, compute_uv=False)[-1], DIGITS))


def _measures(suggestion: Suggestion, d: Diagnosis) -> bool:
    """Whether it measures a distance, and holds no more things than that needs."""
    return len(suggestion.problem.constraints) > len(d.problem.constraints)


def _searched(d: Diagnosis, null: Array) -> Iterator[list[Act]]:
    """Sets of acts that determine every direction of the null space (n, k)."""
    entries = _entries(d.free, null)
    yield entries
    groups = things_to_hold(d.free, null, d.structure.pattern)
    firsts = sorted(groups, key=lambda act: (-act.size, -_volume(act.seen(null))))
    wide = [act for act in firsts if act.size == firsts[0].size][:FIRST]
    distances = distances_to_measure(d, null)
    for first in [None, *wide, *_of_other_sizes(firsts)]:
        chosen = [] if first is None else [first]
        left = _left(null, chosen)
        while first is not None and left.shape[1]:
            fitting = [act for act in groups if act.size <= left.shape[1] and is_new(act, left)]
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


def _volume(seen: Array) -> float:
    """The logarithm of the product of the singular values of rows (g, k), for each row."""
    s = np.linalg.svd(seen, compute_uv=False)
    return float(np.round(np.mean(np.log(np.maximum(s, 1e-300))), DIGITS))


def _by_pivots(A: Array) -> tuple[Array, Index]:
    """R and the order of columns by QR with pivoting; of equal columns the first one leads."""
    first = 1 - TIE * np.arange(A.shape[1]) / A.shape[1]
    R, pivots = scipy.linalg.qr(A * first, mode="r", pivoting=True)
    return R, pivots


def _entries(free: Layout, null: Array) -> list[Act]:
    """As many entries as the null space (n, k) has dimensions, of a large determinant."""
    k = null.shape[1]
    if not k:
        return []
    chosen = _by_pivots(null.T)[1][:k]
    for _ in range(EXCHANGES):
        by = null @ np.linalg.inv(null[chosen])
        i, j = np.unravel_index(np.argmax(abs(by)), by.shape)
        if abs(by[i, j]) < BETTER:
            break
        chosen[j] = i
    return [held(free.label(int(i)), [int(i)]) for i in np.sort(chosen)]


def _pivoted(acts: Sequence[Act], null: Array) -> list[Act]:
    """As many independent acts of one number as there are, up to the dimension of null (n, k)."""
    seen = np.vstack([act.seen(null) for act in acts])
    R, pivots = _by_pivots(seen.T)
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
