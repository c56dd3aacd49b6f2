"""What an algorithm needs and supports, as data from which tables and refusals are made."""

from dataclasses import dataclass
from enum import IntEnum

from workbench.errors import NotSupported
from workbench.problem import Problem


class Derivative(IntEnum):
    """The highest derivative that an algorithm needs."""

    COST = 0
    GRADIENT = 1
    JACOBIAN = 2
    HESSIAN = 3


class Boxes(IntEnum):
    """Whether an algorithm takes bounds: it does not, it may, or it needs them."""

    REFUSED = 0
    TAKEN = 1
    NEEDED = 2


@dataclass(frozen=True)
class Abilities:
    """What an algorithm needs and supports, and where it is described.

    Attributes:
        derivative: the highest derivative that it needs.
        bounds: whether it takes bounds.
        equations: whether it takes constraints with equal limits.
        inequalities: whether it takes other constraints.
        is_global: whether it searches beyond the basin in which it starts.
        stochastic: whether its result depends on random numbers.
        teaching: whether it is meant for teaching and not for use.
        source: authors and year of its description.
        note: what else there is to know before choosing it.
    """

    derivative: Derivative
    bounds: Boxes
    equations: bool = False
    inequalities: bool = False
    is_global: bool = False
    stochastic: bool = False
    teaching: bool = False
    source: str = ""
    note: str = ""


def refuse(name: str, abilities: Abilities, problem: Problem) -> None:
    """Raise NotSupported, naming alternatives, if the algorithm does not take the problem."""
    if abilities.bounds is Boxes.REFUSED and problem.bounded:
        raise NotSupported(
            f"{name} takes no bounds, but the problem bounds {', '.join(problem.bounds)}; "
            "use trust-region, ipopt or an NLopt algorithm, or drop the bounds"
        )
    if abilities.bounds is Boxes.NEEDED:
        for i, (low, high) in enumerate(zip(problem.lower, problem.upper, strict=True)):
            if not float(high) - float(low) < float("inf"):
                raise NotSupported(
                    f"{name} searches between bounds, but {problem.free.label(i)} does not have "
                    "two; bound every free block, or use a solver that needs no bounds"
                )
    constraints = problem.stacked_constraints
    if constraints is None:
        return
    for kind, rows in (("equations", constraints.equal), ("inequalities", ~constraints.equal)):
        if rows.any() and not getattr(abilities, kind):
            label = constraints.label(int(rows.argmax()))
            raise NotSupported(
                f"{name} takes no {kind}, but the problem has {label}; "
                "use ipopt, sqp or nlopt-slsqp, or make it a residual with a small sigma"
            )
