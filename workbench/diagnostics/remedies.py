"""Remedies for null directions: each is carried out before it is suggested.

A null space of dimension d needs d numbers, and no d numbers serve if a null direction changes none
of them: to hold g numbers takes g rows of an orthonormal basis N (n, d), measured in characteristic
scales. A user does not hold numbers but things, a camera or a row of points. They are chosen
greedily: the one of the most numbers that are all still unknown, and of these the one of the
largest volume; single numbers by QR with pivoting.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from math import comb
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.linalg

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.diagnostics.active_set import ConstrainedJacobian, constrained_jacobian_at
from workbench.diagnostics.null_space import MOST_NAMED
from workbench.diagnostics.scales import with_unit
from workbench.diagnostics.words import families, gathered, row_label
from workbench.errors import TooLarge, joined, some_of
from workbench.problem import Problem
from workbench.residuals import Residual, gaussian

if TYPE_CHECKING:
    from workbench.diagnostics.diagnosis import Diagnosis

MOST_NULL = 200  # null directions up to which the fewest things to hold are searched for
MOST_SETS = 500  # sets of blocks of one size that are compared
MOST_PRIORS = 3  # that are suggested
MOST_BLOCKS_NAMED = 5  # in a suggestion; there may be dozens
FEW_THINGS = 5  # of a least remedy that has more, a prior on fewer blocks leads
DETERMINED = 1e-3  # of a null direction: what a prior on some blocks must see of each
INDEPENDENT = 1e-3  # smallest singular value of the rows of a thing, of the largest
TIE = 1e-6  # of a column: by less two count as equal, and the first one leads
MOST_ROWS = 2000  # of a block, up to which each is tried as a thing


@dataclass(frozen=True)
class RankAndCondition:
    """Unknowns, rank and condition of a problem at a point.

    Attributes:
        unknowns: how many there are.
        rank: how many directions the residuals or constraints determine.
        condition: the condition of the Jacobian; infinite without full rank.
        finite: whether the Jacobian is finite; if not, it has no rank.
    """

    unknowns: int
    rank: int
    condition: float
    finite: bool = True

    def __str__(self) -> str:
        if not self.finite:
            return "not finite"
        rank = f"rank {self.rank} of {self.unknowns}"
        return rank if np.isinf(self.condition) else f"{rank}, condition {self.condition:.3g}"


@dataclass(frozen=True, eq=False)
class Suggestion:
    """One thing to do, and what it did when it was tried.

    Attributes:
        what: what to do, such as `fix pose`.
        why: the reason.
        cost: what is given up by it.
        before: rank and condition before.
        after: rank and condition with the suggestion carried out.
        problem: the problem with the suggestion carried out.
        values: the values with the suggestion carried out.
        kind: `least`, `fix`, `prior` or `drop`.
        acts: how many things a user does for it.
    """

    what: str
    why: str
    cost: str
    before: RankAndCondition
    after: RankAndCondition
    problem: Problem = field(repr=False)
    values: Values = field(repr=False)
    kind: str = ""
    acts: int = 1

    @property
    def cured(self) -> bool:
        """Whether every direction is determined afterwards."""
        return self.after.rank == self.after.unknowns


def rank_and_condition(constrained: ConstrainedJacobian) -> RankAndCondition:
    """Rank and condition of a Jacobian under constraints."""
    n = constrained.here.shape[1]
    if not constrained.here.finite:
        return RankAndCondition(n, 0, float("inf"), finite=False)
    return RankAndCondition(n, constrained.rank, constrained.condition)


def with_more(problem: Problem, residuals: Iterable[Residual]) -> Problem:
    """The problem with further residuals; nothing else changes."""
    return Problem(
        (*problem.residuals, *residuals),
        problem.free.spelled(),
        problem.bounds,
        problem.known.values(),
        problem.constraints,
    )


def advise(d: "Diagnosis") -> tuple[Suggestion, ...]:
    """Suggestions that improve the rank or the condition at the point of the diagnosis.

    None where the Jacobian is not finite, as the findings say.
    """
    if not d.here.finite:
        return ()
    least, priors = _least(d), list(_priors(d))
    few = [s for s in priors if s.acts <= FEW_THINGS]
    if least and few and min(s.acts for s in least) > FEW_THINGS:
        least, priors = [*few, *least], [s for s in priors if s not in few]
    fixes = list(_fixed(d))
    if any(s.cured for s in (*least, *priors)):
        fixes = [s for s in fixes if s.cured]  # half a remedy helps nobody then
    return (*least, *_dropped(d), *priors, *fixes)


def fewer_null(before: RankAndCondition, after: RankAndCondition) -> bool:
    """Whether fewer directions change no residual."""
    return after.unknowns - after.rank < before.unknowns - before.rank


def _tried(
    d: "Diagnosis",
    kind: str,
    what: str,
    why: str,
    cost: str,
    problem: Problem,
    *,
    better: Callable[[RankAndCondition, RankAndCondition], bool] = fewer_null,
    acts: int = 1,
) -> Iterator[Suggestion]:
    """Carry a suggestion out: it is made only if the state after it is `better` than before."""
    values = dict(d.values)
    try:
        after = rank_and_condition(constrained_jacobian_at(problem, values))
    except TooLarge:  # it cannot be tried
        return
    if after.finite and better(d.state, after):
        yield Suggestion(what, why, cost, d.state, after, problem, values, kind, acts)


def _dropped(d: "Diagnosis") -> Iterator[Suggestion]:
    """Leave out the second of two residuals that repeat each other."""
    for first, second in d.duplicates:
        yield from _tried(
            d,
            "drop",
            f"drop the residual {second}",
            f"it repeats {first} row by row; counted twice, it makes sigmas too small",
            "nothing; sigmas that were too small become right",
            d.problem.without(second),
            better=lambda a, b: b.unknowns - b.rank == a.unknowns - a.rank,
        )


def _priors(d: "Diagnosis") -> Iterator[Suggestion]:
    """Gaussian priors, as wide as the characteristic scales, on the fewest blocks that suffice."""
    names = _null_blocks(d)
    for chosen in _fewest(d, names) if names else ():
        priors, widths = [], []
        for name in chosen:
            block, scale = d.free[name], d.scales.sizes[d.free.slices[name]]
            low, high = float(scale.min()), float(scale.max())
            widths.append(
                with_unit(high, block.unit)
                if low == high
                else f"{low:.4g} to {with_unit(high, block.unit)}"
            )
            priors.append(
                gaussian(
                    block.symbol,
                    mean=block.taken(d.values[name]).ravel(),
                    covariance=scale**2,
                    unit=block.unit,
                    name=_unused(f"prior on {name}", d.problem.rows),
                )
            )
        sigmas = some_of(widths, MOST_BLOCKS_NAMED)
        yield from _tried(
            d,
            "prior",
            f"add a Gaussian prior on {_together(chosen)} (sigma {sigmas})",
            "a prior determines what the residuals do not",
            "there the answer is the mean of the prior, not what the data say",
            with_more(d.problem, priors),
            acts=len(chosen),
        )


def _fewest(d: "Diagnosis", names: Sequence[str]) -> list[Sequence[str]]:
    """The smallest sets of blocks in which no null direction stays without a change, best first."""
    if d.here.estimated:
        return [names]
    null = d.null_in_scales
    for count in range(1, len(names)):
        if comb(len(names), count) > MOST_SETS:
            break
        ranked = []
        for chosen in combinations(names, count):
            rows = np.vstack([null[d.free.slices[name]] for name in chosen])
            s = np.linalg.svd(rows, compute_uv=False)
            if len(s) == null.shape[1] and s[-1] > DETERMINED:
                ranked.append((-round(float(s[-1]), 6), chosen))
        if ranked:
            ranked.sort(key=lambda pair: pair[0])
            return [chosen for _, chosen in ranked[:MOST_PRIORS]]
    return [names]


def _fixed(d: "Diagnosis") -> Iterator[Suggestion]:
    """Fix one of the blocks that take part in null directions, unless these are very many."""
    if d.shape[1] - d.rank > MOST_NAMED:
        return
    for name in _null_blocks(d)[: 3 if d.here.estimated else None]:
        if others := d.free.spelled([name]):
            yield from _tried(
                d,
                "fix",
                f"fix {name}",
                f"{name} takes part in null directions",
                f"{name} stays at its present value, whether right or wrong",
                d.problem.freeing(*others),
            )


def _null_blocks(d: "Diagnosis") -> list[str]:
    """The blocks that take part in null directions."""
    moved = np.zeros(d.free.size, dtype=bool)
    for direction in d.null_directions:
        moved |= abs(direction.vector) > 1e-6
    return [name for name, part in d.free.slices.items() if moved[part].any()]


def _together(names: Sequence[str]) -> str:
    """All names, or the first few and how many more there are."""
    return (
        " and ".join(names)
        if len(names) <= MOST_BLOCKS_NAMED
        else some_of(names, MOST_BLOCKS_NAMED)
    )


def _unused(name: str, used: Iterable[str]) -> str:
    """The name with as many primes as make it new."""
    names = set(used)
    while name in names:
        name += "'"
    return name


# The fewest things to hold.


class HeldPlaces(NamedTuple):
    """What can be held as one thing, such as `cam0`: the places of its unknowns."""

    what: str
    places: list[int]

    def volume(self, null: Array) -> float:
        """The mean logarithm of the singular values of its rows; -inf if one is nothing."""
        s = np.linalg.svd(null[self.places], compute_uv=False)
        if len(s) < len(self.places) or s[-1] <= INDEPENDENT * max(s[0], 1e-3):
            return -np.inf
        return float(np.round(np.mean(np.log(s)), 1))  # of nearly equal ones the first


def _least(d: "Diagnosis") -> list[Suggestion]:
    """The remedy of the least number of numbers: things and entries, or else entries alone."""
    null, k = d.null_in_scales, d.shape[1] - d.rank
    if not 0 < k <= MOST_NULL or k == d.shape[1]:
        return []
    entries = [HeldPlaces(d.free.label(i), [i]) for i in range(d.free.size)]
    # blocks of one number come before entries: a focal length, and not one point of many
    numbers = [entries[p.start] for p in d.free.slices.values() if p.stop == p.start + 1]
    for groups in (_things(d), []):
        things = _chosen(null, groups, numbers, entries)
        if len(_rows(null, things)) == k and (least := list(_held(d, things))):
            return least
    return []


def _rows(null: Array, things: Sequence[HeldPlaces]) -> Array:
    return null[[i for thing in things for i in thing.places]]


def _chosen(
    null: Array, groups: Sequence[HeldPlaces], *singles: Sequence[HeldPlaces]
) -> list[HeldPlaces]:
    """Things that together determine the null space (n, d), the largest first; then `singles`."""
    chosen: list[HeldPlaces] = []
    left = null
    while left.shape[1]:
        fitting = [(len(thing.places), thing.volume(left), thing) for thing in groups]
        fitting = [entry for entry in fitting if np.isfinite(entry[1])]
        if not fitting:
            break
        chosen.append(max(fitting, key=lambda entry: entry[:2])[2])
        left = _left(null, chosen)
        groups = [thing for *_, thing in fitting if thing is not chosen[-1]]
    for things in singles:
        if left.shape[1] and things:
            chosen += _pivoted(things, left)
            left = _left(null, chosen)
    return chosen


def _left(null: Array, things: Sequence[HeldPlaces]) -> Array:
    """What of the null space (n, d) is still free when these things are held."""
    if not things:
        return null
    _, s, Vt = np.linalg.svd(_rows(null, things))
    rank = int(np.sum(s > 1e-3 * INDEPENDENT * s.max(initial=0.0)))
    return np.asarray(null @ Vt[rank:].T)


def _pivoted(things: Sequence[HeldPlaces], null: Array) -> list[HeldPlaces]:
    """As many independent things of one number as there are, up to the dimension of `null`."""
    rows = _rows(null, things)
    earlier = 1 - TIE * np.arange(len(rows)) / len(rows)  # of equal ones the first one leads
    R, pivots = scipy.linalg.qr(rows.T * earlier, mode="r", pivoting=True)
    count = int(np.sum(abs(np.diag(R)) > INDEPENDENT))
    return [things[int(p)] for p in np.sort(pivots[:count])]


def _things(d: "Diagnosis") -> list[HeldPlaces]:
    """What can be held as one thing: families of blocks, blocks, and rows."""
    free, most = d.free, d.shape[1] - d.rank
    places = {name: list(range(part.start, part.stop)) for name, part in free.slices.items()}
    named: dict[tuple[int, ...], str] = {}
    for stem, members in families(free.names).items():
        named.setdefault(tuple(i for name in members for i in places[name]), stem)
    for name in free.names:
        named.setdefault(tuple(places[name]), name)
    for block in free.blocks:
        if len(block.shape) == 2 and block.shape[1] > 1 and 1 < block.shape[0] <= MOST_ROWS:
            for row, entries in enumerate(np.reshape(places[block.name], block.shape).tolist()):
                label = row_label(block, row, block.shape[1])
                named.setdefault(tuple(entries), f"{block.name}[{label}]")
    return [HeldPlaces(what, list(own)) for own, what in named.items() if 1 < len(own) <= most]


def _held(d: "Diagnosis", things: Sequence[HeldPlaces]) -> Iterator[Suggestion]:
    """What is held is not free any more."""
    free = np.setdiff1d(np.arange(d.free.size), [i for thing in things for i in thing.places])
    if not free.size:
        return
    k = d.free.size - free.size
    entries = [thing.what for thing in things if len(thing.places) == 1]
    others = [thing.what for thing in things if len(thing.places) > 1]
    yield from _tried(
        d,
        "least",
        f"{'hold' if others else 'fix'} {joined(others + gathered(entries))}",
        f"{'one number' if k == 1 else f'{k} numbers'} for as many null directions: the fewest "
        "that can determine everything",
        "nothing where these directions are gauges; elsewhere what is held must be right",
        d.problem.freeing(*d.free.chosen(free).spelled()),
        better=lambda a, b: fewer_null(a, b) and b.rank == b.unknowns,
        acts=len(things),
    )
