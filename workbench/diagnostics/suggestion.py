"""A suggestion: what to do, why, what it costs, and the rank and condition before and after it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Values
from workbench.diagnostics.held import Tied, tied_at
from workbench.problem import Problem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class State:
    """What a suggestion changes: unknowns, rank, condition (inf without full rank)."""

    unknowns: int
    rank: int
    condition: float
    finite: bool = True  # the Jacobian; if not, nothing has a rank

    def __str__(self) -> str:
        if not self.finite:
            return "not finite"
        said = f"rank {self.rank} of {self.unknowns}"
        return said if np.isinf(self.condition) else f"{said}, condition {self.condition:.3g}"


@dataclass(frozen=True, eq=False)
class Suggestion:
    """One thing to do, and what it did when it was tried."""

    what: str  # `fix pose`
    why: str
    cost: str  # what is given up by it
    before: State
    after: State
    problem: Problem = field(repr=False)  # with the suggestion carried out
    at: Values = field(repr=False)
    kind: str = ""  # fix, prior, drop, rescale, rewrap, move

    @property
    def cured(self) -> bool:
        """Whether every direction is seen afterwards."""
        return self.after.rank == self.after.unknowns


def state_of(tied: Tied) -> State:
    """Rank and condition of a Jacobian under constraints."""
    n = tied.here.shape[1]
    if not tied.here.finite:
        return State(n, 0, float("inf"), finite=False)
    return State(n, tied.rank, tied.condition)


def tried(
    kind: str, what: str, why: str, cost: str, before: State,
    problem: Problem, at: Mapping[str, Array], better: Callable[[State, State], bool],
) -> list[Suggestion]:  # fmt: skip
    """Carry a suggestion out: it is given only if the state after it is `better` than before."""
    tied = tied_at(problem, at)
    if not tied.here.finite:
        return []
    after = state_of(tied)
    if not better(before, after):
        return []
    return [Suggestion(what, why, cost, before, after, problem, dict(at), kind)]
