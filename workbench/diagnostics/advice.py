"""Suggestions for null and weak directions; each is tried out before it is made."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from math import comb

import numpy as np

from workbench.blocks import Values
from workbench.diagnostics.diagnosis import Diagnosis
from workbench.diagnostics.least_remedies import least_remedies
from workbench.diagnostics.scales import with_unit
from workbench.diagnostics.suggestion import RankAndCondition, Suggestion
from workbench.diagnostics.trials import fewer_unseen, tried, with_more
from workbench.errors import some_of
from workbench.problem import Problem
from workbench.residuals import gaussian
from workbench.threads import limited_threads

NEARBY = 1e-3  # of a yardstick: how far from a point that is not finite to try again
TURN = 2 * np.pi
MOST = 500  # sets of blocks of one size that are compared
LISTED = 3  # priors that are suggested
DETERMINED = 1e-3  # of a null direction: what a prior on some blocks must see of each
FEW = 5  # acts of a least remedy, from which on a prior leads that takes fewer
NAMED = 5  # blocks in a suggestion; there may be dozens


def advise(diagnosis: Diagnosis) -> tuple[Suggestion, ...]:
    """Suggestions that improve the rank or the condition at the point of the diagnosis."""
    remedies = REMEDIES if diagnosis.here.finite else (_somewhere_else,)
    problem, at = diagnosis.problem, dict(diagnosis.values)
    found: list[Suggestion] = []
    for remedy in remedies:
        suggested = list(remedy(diagnosis, problem, at))
        if remedy is _fix and any(s.kind in ("least", "prior") and s.cured for s in found):
            suggested = [s for s in suggested if s.cured]  # half a remedy helps nobody then
        found += suggested
    acts = {kind: [s.acts for s in found if s.kind == kind] for kind in ("least", "prior")}
    if acts["least"] and acts["prior"] and min(acts["least"]) > max(FEW, min(acts["prior"])):
        found.sort(key=lambda s: s.kind != "prior" or s.acts > FEW)
    return tuple(found)


def _clearly_better(before: RankAndCondition, after: RankAndCondition) -> bool:
    return fewer_unseen(before, after) or 3 * after.condition < before.condition


def _somewhere_else(diagnosis: Diagnosis, problem: Problem, at: Values) -> Iterator[Suggestion]:
    """Start nearby, where the Jacobian may be finite if it is not here."""
    rng = np.random.default_rng(0)
    columns = sorted({j for _, j in diagnosis.not_finite if j >= 0})
    names = sorted({problem.free.block_of(i)[0].name for i in columns}) or problem.free.names
    if not names:
        return
    sizes = diagnosis.free.placed(diagnosis.point.yardsticks.sizes)
    moved = at | {
        n: at[n] + NEARBY * sizes[n] * rng.standard_normal(np.shape(at[n])) for n in names
    }
    why = "the derivative is not finite at this very point"
    cost = "the formula stays fragile there; a series expansion near the point would cure it"
    yield from tried(
        diagnosis,
        "move",
        f"start a thousandth of a yardstick away in {', '.join(names)}",
        why,
        cost,
        problem,
        lambda before, after: True,
        moved,
    )


def _rewrap(diagnosis: Diagnosis, problem: Problem, at: Values) -> Iterator[Suggestion]:
    """Shorten rotation vectors near a full turn by one turn, which leaves the rotation the same."""
    for tree in problem.trees:
        x = problem.split(at)[0]
        turned = tree.turned(problem.free)
        angle = {k: float(np.linalg.norm(x[place])) for k, place in turned.items()}
        far = [k for k in turned if abs(angle[k] - TURN) < 0.5]
        if not far:
            continue
        for k in far:
            x[turned[k]] *= 1 - TURN / angle[k]
        names = ", ".join(tree.names[k] for k in far)
        yield from tried(
            diagnosis,
            "rewrap",
            f"take one turn of 2 pi off the rotation vector of {names}",
            "at a full turn, two of the three numbers of a rotation vector change nothing, and "
            "near it they change little",
            "nothing: it is the same rotation",
            problem,
            _clearly_better,
            at | problem.free.unpack(x, at),
        )


def _fix(diagnosis: Diagnosis, problem: Problem, at: Values) -> Iterator[Suggestion]:
    """Fix one of the blocks that take part in null directions."""
    unread = set(diagnosis.structure.unread.tolist())
    for name in _blind_blocks(diagnosis)[: _most(diagnosis)]:
        part = problem.free.slices[name]
        others = problem.free.spelled([name])
        if others and not unread.issuperset(range(part.start, part.stop)):
            yield from tried(
                diagnosis,
                "fix",
                f"fix {name}",
                f"{name} takes part in null directions",
                f"{name} stays at its present value, whether right or wrong"
                + _held_too(diagnosis, part),
                problem.freeing(*others),
                fewer_unseen,
            )


def _held_too(diagnosis: Diagnosis, part: slice) -> str:
    """How many of a block's numbers are fixed with it though they are known; or nothing."""
    unknown = diagnosis.point.constrained.null_rank(part)
    more = part.stop - part.start - unknown
    noun = "number that is" if more == 1 else "numbers that are"
    return f", and with it {more} {noun} known already" if more else ""


def _prior(diagnosis: Diagnosis, problem: Problem, at: Values) -> Iterator[Suggestion]:
    """Gaussian priors, as wide as a yardstick, on the fewest blocks that determine everything."""
    names = _blind_blocks(diagnosis)
    if not names:
        return
    sizes = diagnosis.point.yardsticks.sizes
    sigma = {n: float(sizes[problem.free.slices[n]][0]) for n in names}
    for chosen in _fewest(diagnosis, names):
        priors = [
            gaussian(
                problem.free[name].symbol,
                mean=problem.free[name].taken(at[name]).ravel(),
                covariance=sigma[name] ** 2,
                unit=problem.free[name].unit,
                name=_unused(f"prior on {name}", problem),
            )
            for name in chosen
        ]
        fuller = with_more(problem, priors)
        units = [with_unit(sigma[name], problem.free[name].unit) for name in chosen]
        yield from tried(
            diagnosis,
            "prior",
            f"add a Gaussian prior on {_together(chosen)} (sigma {some_of(units, NAMED)})",
            "a prior determines what the residuals do not",
            "there the answer is the mean of the prior, not what the data say",
            fuller,
            fewer_unseen,
            acts=len(chosen),
        )


def _fewest(diagnosis: Diagnosis, names: Sequence[str]) -> list[Sequence[str]]:
    """The smallest sets of blocks in which no null direction stays without a change, best first.

    A block is one act. Of a Jacobian that was eliminated part after part only all blocks are tried.
    """
    point, free = diagnosis.point, diagnosis.free
    if diagnosis.here.estimated:
        return [names]
    null = point.null_in(point.measured, point.yardsticks.sizes)
    for count in range(1, len(names)):
        if comb(len(names), count) > MOST:
            break
        found = []
        for chosen in combinations(names, count):
            rows = np.vstack([null[free.slices[name]] for name in chosen])
            s = np.linalg.svd(rows, compute_uv=False)
            if len(s) == null.shape[1] and s[-1] > DETERMINED:
                found.append((-round(float(s[-1]), 6), chosen))
        if found:
            return [chosen for _, chosen in sorted(found, key=lambda one: one[0])[:LISTED]]
    return [names]


def _drop(diagnosis: Diagnosis, problem: Problem, at: Values) -> Iterator[Suggestion]:
    """Leave out the second of two residuals that repeat each other."""
    for first, second in diagnosis.duplicates:
        yield from tried(
            diagnosis,
            "drop",
            f"drop the residual {second}",
            f"it repeats {first} row by row; counted twice, it makes sigmas too small",
            "nothing; sigmas that were too small become right",
            problem.without(second),
            lambda before, after: after.unknowns - after.rank == before.unknowns - before.rank,
        )


def _unread(diagnosis: Diagnosis, problem: Problem, at: Values) -> Iterator[Suggestion]:
    """Do not free blocks on which no residual depends."""
    unread = set(diagnosis.structure.unread.tolist())
    whole = [
        name
        for name, part in problem.free.slices.items()
        if part.stop > part.start and unread.issuperset(range(part.start, part.stop))
    ]
    others = problem.free.spelled(whole)
    if not whole or not others:
        return
    blocks = _together(whole)
    yield from tried(
        diagnosis,
        "fix",
        f"do not free {blocks}",
        f"no residual depends on {blocks}",
        "nothing: the fit cannot change it",
        problem.freeing(*others),
        fewer_unseen,
    )


def _rescale(diagnosis: Diagnosis, problem: Problem, at: Values) -> Iterator[Suggestion]:
    """Scale the columns to length 1, where that improves the condition a hundred times."""
    if diagnosis.null_directions or np.isinf(diagnosis.condition):
        return
    if diagnosis.point.active.any:  # lengths of columns do not show what may move
        return
    after = _by_unit_columns(diagnosis)
    if after.condition * 100 < diagnosis.condition:
        yield Suggestion(
            "measure each unknown in units of 1 / |its column|, as scaling=columns does",
            "the columns of the Jacobian have very different lengths",
            "damping then treats all unknowns alike, even those that the data hardly determine",
            diagnosis.state,
            after,
            problem,
            dict(at),
            "rescale",
        )


def _most(diagnosis: Diagnosis) -> int | None:
    """How many blocks are tried one by one; None for all."""
    return 3 if diagnosis.here.estimated else None


def _by_unit_columns(diagnosis: Diagnosis) -> RankAndCondition:
    """Rank and condition with columns of length 1."""
    n, eliminated = diagnosis.here.shape[1], diagnosis.point.constrained.by_elimination
    if eliminated is not None:
        with limited_threads():
            unit = eliminated.scaled(1 / eliminated.lengths)
            return RankAndCondition(n, diagnosis.rank, unit.condition)
    s = diagnosis.scaled_singular_values
    return RankAndCondition(n, int(np.sum(s > 0)), float(s[0] / s[-1]) if s[-1] > 0 else np.inf)


def _blind_blocks(diagnosis: Diagnosis) -> list[str]:
    free = diagnosis.free
    part = np.zeros(free.size)
    for direction in diagnosis.null_directions:
        part = np.maximum(part, abs(direction.vector))
    return [name for name, at in free.slices.items() if (part[at] > 1e-6).any()]


def _together(names: Sequence[str]) -> str:
    """All names, or the first few and how many more there are."""
    return " and ".join(names) if len(names) <= NAMED else some_of(names, NAMED)


def _unused(name: str, problem: Problem) -> str:
    while name in problem.rows:
        name += "'"
    return name


def _least(diagnosis: Diagnosis, problem: Problem, at: Values) -> Iterator[Suggestion]:
    """The fewest things to hold or to measure."""
    yield from least_remedies(diagnosis)


REMEDIES = (_rewrap, _least, _unread, _drop, _prior, _fix, _rescale)
