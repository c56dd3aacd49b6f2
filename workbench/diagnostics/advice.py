"""Suggestions for null and weak directions; each is tried out before it is made."""

import numpy as np

from workbench.blocks import Values
from workbench.diagnostics.results import DiagnosisResults
from workbench.diagnostics.suggestion import RankAndCondition, Suggestion, tried
from workbench.problem import Problem
from workbench.residuals import gaussian

NEARBY = 1e-3  # of a yardstick: where a derivative may be finite that is not finite here
TURN = 2 * np.pi


def advise(diagnosis: DiagnosisResults) -> tuple[Suggestion, ...]:
    """Suggestions that improve the rank or the condition at the point of the diagnosis."""
    problem, at = diagnosis.problem, dict(diagnosis.at)
    return tuple(s for remedy in REMEDIES for s in remedy(diagnosis, problem, at))


def _fewer_unseen(before: RankAndCondition, after: RankAndCondition) -> bool:
    return after.unknowns - after.rank < before.unknowns - before.rank


def _clearly_better(before: RankAndCondition, after: RankAndCondition) -> bool:
    return _fewer_unseen(before, after) or 3 * after.condition < before.condition


def _somewhere_else(diagnosis: DiagnosisResults, problem: Problem, at: Values) -> list[Suggestion]:
    """A Jacobian that is not finite here may be finite nearby."""
    if diagnosis.here.finite:
        return []
    rng = np.random.default_rng(0)
    columns = sorted({j for _, j in diagnosis.not_finite if j >= 0})
    names = sorted({problem.free.block_of(i)[0].name for i in columns}) or problem.free.names
    if not names:
        return []
    sizes = _sizes(diagnosis)
    moved = at | {
        n: at[n] + NEARBY * sizes[n] * rng.standard_normal(np.shape(at[n])) for n in names
    }
    why = "the derivative is not finite at this very point"
    cost = "the formula stays fragile there; a series expansion near the point would cure it"
    return tried(
        "move",
        f"start a thousandth of a yardstick away in {', '.join(names)}",
        why,
        cost,
        diagnosis.state,
        problem,
        moved,
        lambda before, after: True,
    )


def _rewrap(diagnosis: DiagnosisResults, problem: Problem, at: Values) -> list[Suggestion]:
    """A rotation vector near a full turn is shortened by one: the same rotation."""
    suggestions = []
    for tree in problem.trees:
        if not diagnosis.here.finite:
            continue
        x = problem.split(at)[0]
        turned = tree.turned(problem.free)
        angle = {k: float(np.linalg.norm(x[place])) for k, place in turned.items()}
        far = [k for k in turned if abs(angle[k] - TURN) < 0.5]
        if not far:
            continue
        for k in far:
            x[turned[k]] *= 1 - TURN / angle[k]
        names = ", ".join(tree.names[k] for k in far)
        suggestions += tried(
            "rewrap",
            f"take one turn of 2 pi off the rotation vector of {names}",
            "at a full turn, two of the three numbers of a rotation vector change nothing, and "
            "near it they change little",
            "nothing: it is the same rotation",
            diagnosis.state,
            problem,
            at | problem.free.unpack(x, at),
            _clearly_better,
        )
    return suggestions


def _fix(diagnosis: DiagnosisResults, problem: Problem, at: Values) -> list[Suggestion]:
    """Blocks that take part in what is not seen, each fixed alone; at last all of them."""
    if not diagnosis.here.finite or not diagnosis.null_directions:
        return []
    unread = set(diagnosis.structure.unread.tolist())
    suggestions: list[Suggestion] = []
    for name in _blind_blocks(diagnosis)[: 3 if diagnosis.here.estimated else None]:
        part = problem.free.slices[name]
        others = problem.free.spelled([name])
        if others and not unread.issuperset(range(part.start, part.stop)):
            suggestions += tried(
                "fix",
                f"fix {name}",
                f"{name} takes part in null directions",
                f"{name} stays at its present value, whether right or wrong",
                diagnosis.state,
                problem.freeing(*others),
                at,
                _fewer_unseen,
            )
    return suggestions


def _prior(diagnosis: DiagnosisResults, problem: Problem, at: Values) -> list[Suggestion]:
    """A Gaussian prior on the blocks that take part in what is not seen, as wide as a yardstick."""
    if not diagnosis.here.finite or not diagnosis.null_directions:
        return []
    names = _blind_blocks(diagnosis)
    sizes = diagnosis.point.yardsticks.sizes
    sigma = {n: float(sizes[problem.free.slices[n]][0]) for n in names}
    suggestions: list[Suggestion] = []
    for chosen in ([[name] for name in names] if len(names) > 1 else []) + [names]:
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
        blocks = (*(b.base for b in problem.free.blocks), *problem.fixed.blocks)
        fuller = Problem(
            (*problem.residuals, *priors),
            problem.free.spelled(),
            problem.bounds,
            blocks,
            problem.constraints,
        )
        units = ", ".join(_in_units(sigma[name], problem.free[name].unit) for name in chosen)
        suggestions += tried(
            "prior",
            f"add a Gaussian prior on {' and '.join(chosen)} (sigma {units})",
            "a prior determines what the residuals do not",
            "there the answer is the mean of the prior, not what the data say",
            diagnosis.state,
            fuller,
            at,
            _fewer_unseen,
        )
        if suggestions and suggestions[-1].cured:
            break
    return suggestions


def _drop(diagnosis: DiagnosisResults, problem: Problem, at: Values) -> list[Suggestion]:
    """The second of two residuals that say the same."""
    suggestions = []
    for first, second in diagnosis.duplicates:
        suggestions += tried(
            "drop",
            f"drop the residual {second}",
            f"it repeats {first} row by row; counted twice, it makes sigmas too small",
            "nothing: only a false certainty is lost",
            diagnosis.state,
            problem.without(second),
            at,
            lambda before, after: after.unknowns - after.rank == before.unknowns - before.rank,
        )
    return suggestions


def _unread(diagnosis: DiagnosisResults, problem: Problem, at: Values) -> list[Suggestion]:
    """Free blocks that no residual reads at all."""
    unread = set(diagnosis.structure.unread.tolist())
    whole = [
        name
        for name, part in problem.free.slices.items()
        if part.stop > part.start and unread.issuperset(range(part.start, part.stop))
    ]
    others = problem.free.spelled(whole)
    if not whole or not others or not diagnosis.here.finite:
        return []
    said = " and ".join(whole)
    return tried(
        "fix",
        f"do not free {said}",
        f"no residual depends on {said}",
        "nothing: the fit cannot change it",
        diagnosis.state,
        problem.freeing(*others),
        at,
        _fewer_unseen,
    )


def _rescale(diagnosis: DiagnosisResults, problem: Problem, at: Values) -> list[Suggestion]:
    """Columns of length 1, where that makes the condition at least a hundred times better."""
    here = diagnosis.here
    if not here.finite or diagnosis.null_directions or np.isinf(diagnosis.condition):
        return []
    if diagnosis.point.active.any:  # lengths of columns say nothing of what may move
        return []
    s = diagnosis.scaled_singular_values
    after = RankAndCondition(
        here.shape[1], int(np.sum(s > 0)), float(s[0] / s[-1]) if s[-1] > 0 else np.inf
    )
    if not after.condition * 100 < diagnosis.condition:
        return []
    return [
        Suggestion(
            "measure each unknown in units of 1 / |its column|, as scaling=columns does",
            "the columns of the Jacobian have very different lengths",
            "damping then treats all unknowns alike, also those that the data hardly determine",
            diagnosis.state,
            after,
            problem,
            dict(at),
            "rescale",
        )
    ]


def _blind_blocks(diagnosis: DiagnosisResults) -> list[str]:
    free = diagnosis.free
    part = np.zeros(free.size)
    for direction in diagnosis.null_directions:
        part = np.maximum(part, abs(direction.vector))
    return [name for name, at in free.slices.items() if (part[at] > 1e-6).any()]


def _sizes(diagnosis: DiagnosisResults) -> Values:
    return diagnosis.free.placed(diagnosis.point.yardsticks.sizes)


def _in_units(number: float, unit: str) -> str:
    return f"{number:.4g}" if unit == "1" else f"{number:.4g} {unit}"


def _unused(name: str, problem: Problem) -> str:
    while name in problem.rows:
        name += "'"
    return name


REMEDIES = (_somewhere_else, _rewrap, _unread, _drop, _fix, _prior, _rescale)
