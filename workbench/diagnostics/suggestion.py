"""A suggestion: what to do, why, what it costs, and the rank and condition before and after it."""

from dataclasses import dataclass, field

import numpy as np

from workbench.blocks import Values
from workbench.diagnostics.active_set import ConstrainedJacobian
from workbench.problem import Problem


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
        kind: `least`, `fix`, `prior`, `drop`, `rescale`, `rewrap` or `move`.
        acts: how many things a user does for it.
        numbers: how many numbers a least remedy holds or measures; 0 for others.
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
    numbers: int = 0

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
