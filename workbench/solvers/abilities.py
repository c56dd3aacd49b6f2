"""What an algorithm needs and what it can: data, so that tables and refusals are made from it."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from workbench.blocks import Values
from workbench.errors import NotSupported
from workbench.problem import Problem
from workbench.solvers.solution import Callback, Solution


class Derivative(IntEnum):
    """The most that an algorithm asks a problem for."""

    COST = 0
    GRADIENT = 1
    JACOBIAN = 2
    HESSIAN = 3


class Boxes(IntEnum):
    """What an algorithm makes of bounds."""

    UNKNOWN = 0
    TAKEN = 1
    NEEDED = 2


@dataclass(frozen=True)
class Abilities:
    """What an algorithm needs and supports, and where it is described."""

    derivative: Derivative
    bounds: Boxes
    equations: bool = False  # constraints with equal limits
    inequalities: bool = False
    is_global: bool = False  # looks beyond the valley that it starts in
    stochastic: bool = False
    teaching: bool = False  # to be looked at, rather than relied on
    source: str = ""
    note: str = ""  # what else there is to know before choosing it


class Listed(Protocol):
    """A solver of the catalogue: one that says what it can."""

    @property
    def abilities(self) -> Abilities:
        """What it needs and supports."""

    def solve(
        self, problem: Problem, start: Values, *, callback: Callback | None = None
    ) -> Solution:
        """See Solver."""


def refuse(name: str, abilities: Abilities, problem: Problem) -> None:
    """Raise NotSupported, with what exists instead, for what the algorithm has not."""
    if abilities.bounds is Boxes.UNKNOWN and problem.bounded:
        raise NotSupported(
            f"{name} knows no bounds, but the problem bounds {', '.join(problem.bounds)}; "
            "use levenberg-marquardt, ipopt or an NLopt algorithm, or drop the bounds"
        )
    if abilities.bounds is Boxes.NEEDED:
        for i, (low, high) in enumerate(zip(problem.lower, problem.upper, strict=True)):
            if not float(high) - float(low) < float("inf"):
                raise NotSupported(
                    f"{name} searches between bounds, but {problem.free.label(i)} has not two; "
                    "bound every free block, or use a solver that needs none"
                )
    there = problem.stacked_constraints
    if there is None:
        return
    wanted = (("equations", there.equal), ("inequalities", ~there.equal))
    for what, rows in wanted:
        if rows.any() and not getattr(abilities, what):
            raise NotSupported(
                f"{name} knows no {what}, but the problem has {there.label(int(rows.argmax()))}; "
                "use ipopt, sqp or nlopt-slsqp, or make it a residual with a small sigma"
            )
