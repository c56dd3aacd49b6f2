"""A suggestion: what to do, why, what it costs, and the rank and condition before and after it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.diagnostics.active_set import ConstrainedJacobian, constrained_jacobian_at
from workbench.problem import Problem


@dataclass(frozen=True)
class RankAndCondition:
    """What a suggestion changes: unknowns, rank, condition (inf without full rank).

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
        said = f"rank {self.rank} of {self.unknowns}"
        return said if np.isinf(self.condition) else f"{said}, condition {self.condition:.3g}"


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
        at: the values with the suggestion carried out.
        kind: `fix`, `prior`, `drop`, `rescale`, `rewrap` or `move`.
    """

    what: str
    why: str
    cost: str
    before: RankAndCondition
    after: RankAndCondition
    problem: Problem = field(repr=False)
    at: Values = field(repr=False)
    kind: str = ""

    @property
    def cured(self) -> bool:
        """Whether every direction is seen afterwards."""
        return self.after.rank == self.after.unknowns


def rank_and_condition(tied: ConstrainedJacobian) -> RankAndCondition:
    """Rank and condition of a Jacobian under constraints."""
    n = tied.here.shape[1]
    if not tied.here.finite:
        return RankAndCondition(n, 0, float("inf"), finite=False)
    return RankAndCondition(n, tied.rank, tied.condition)


def tried(
    kind: str,
    what: str,
    why: str,
    cost: str,
    before: RankAndCondition,
    problem: Problem,
    at: Mapping[str, Array],
    better: Callable[[RankAndCondition, RankAndCondition], bool],
) -> list[Suggestion]:
    """Carry a suggestion out: it is given only if the state after it is `better` than before."""
    tied = constrained_jacobian_at(problem, at)
    if not tied.here.finite:
        return []
    after = rank_and_condition(tied)
    if not better(before, after):
        return []
    return [Suggestion(what, why, cost, before, after, problem, dict(at), kind)]
