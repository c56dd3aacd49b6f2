"""Suggestions carried out: one is made only if it improves the rank or the condition."""

from collections.abc import Callable, Iterable

from workbench.blocks import Values
from workbench.diagnostics.active_set import constrained_jacobian_at
from workbench.diagnostics.diagnosis import Diagnosis
from workbench.diagnostics.suggestion import RankAndCondition, Suggestion, rank_and_condition
from workbench.errors import TooLarge
from workbench.problem import Constraint, Problem
from workbench.residuals import Residual


def fewer_unseen(before: RankAndCondition, after: RankAndCondition) -> bool:
    """Whether fewer directions change no residual."""
    return after.unknowns - after.rank < before.unknowns - before.rank


def tried(
    diagnosis: Diagnosis,
    kind: str,
    what: str,
    why: str,
    cost: str,
    problem: Problem,
    better: Callable[[RankAndCondition, RankAndCondition], bool],
    at: Values | None = None,
    acts: int = 1,
    numbers: int = 0,
) -> list[Suggestion]:
    """Carry a suggestion out: it is made only if the state after it is `better` than before.

    The values are those of the diagnosis unless others are given.
    """
    at = dict(diagnosis.values) if at is None else at
    constrained = constrained_jacobian_at(problem, at)
    try:
        after = rank_and_condition(constrained)
    except TooLarge:  # it cannot be tried
        return []
    if not constrained.here.finite or not better(diagnosis.state, after):
        return []
    before = diagnosis.state
    return [Suggestion(what, why, cost, before, after, problem, at, kind, acts, numbers)]


def with_more(
    problem: Problem, residuals: Iterable[Residual] = (), constraints: Iterable[Constraint] = ()
) -> Problem:
    """The problem with further residuals and constraints; nothing else changes."""
    return Problem(
        (*problem.residuals, *residuals),
        problem.free.spelled(),
        problem.bounds,
        problem.known.values(),
        (*problem.constraints, *constraints),
    )
