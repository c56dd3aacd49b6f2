"""A plan that recovers a body from registrations without noise."""

from dataclasses import replace
from math import inf

from workbench.training.blocks import BlockOptions
from workbench.training.estimate import TERMS, Sigmas
from workbench.training.first_guess import MOST_WEIGHTS
from workbench.training.plan import NO_LIMIT, Plan, Stage

FREE_ROUND = ("surfaces", "weights", "poses")
TO_THE_END = 3000  # products in a step: directions that hardly change the data need that many
EXACT = 1e-9  # m, rms of E_D: a thousandth of the accuracy that the model should have


def annealed(sigmas: Sigmas, factors: tuple[float, ...] = (1.0, 10.0, 1e2, 1e3, inf)) -> Plan:
    """A plan for registrations without noise, which switches every term but E_D off step by step.

    Each lambda falls with the square of its factor; the last stage fits the data alone. Only
    there the number of weights of a vertex is limited, because by then it is clear which of them
    are zero. Only the last steps are solved to the end: joints that move few vertices are found
    last.
    """
    free = BlockOptions(together_tolerance=1e-3, together_steps=12, most_weights=NO_LIMIT)
    first = Stage(sigmas, FREE_ROUND, 3, free)
    rest = [Stage(_loosened(sigmas, f), ("weights", "together"), options=free) for f in factors]
    limited = replace(free, most_weights=MOST_WEIGHTS, products=TO_THE_END, enough=EXACT)
    last = Stage(_loosened(sigmas, inf), ("cut", "weights", "together"), options=limited)
    return Plan((first, *rest, last))


def _loosened(sigmas: Sigmas, factor: float) -> Sigmas:
    """Every sigma but the data's multiplied by a factor."""
    return replace(sigmas, **{name: factor * getattr(sigmas, name) for name in TERMS})
