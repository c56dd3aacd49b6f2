"""Whoever computes a residual, its Jacobian and a Gauss-Newton step, and whether they agree."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.bodies_made_up import SIGMA, Case
from workbench.arrays import Array


@dataclass(frozen=True, eq=False)
class Candidate:
    """Three functions of the flat unknowns x (n,); what they return, `numpy.asarray` can read.

    The tolerances say how far from the workbench they may be: metres, and metres per unit.
    """

    name: str
    forward: Callable[[Array], Any]  # x -> r (m,)
    jacobian: Callable[[Array], tuple[Any, Any]]  # x -> r, J (m, n)
    step: Callable[[Array], Any]  # x -> p (n,), the least |J p + r|
    value_tolerance: float = 1e-10
    jacobian_tolerance: float = 1e-8
    remark: str = ""


class Disagreement(Exception):
    """A candidate computes something else than the workbench."""


def check(candidate: Candidate, case: Case, x: Array) -> dict[str, float]:
    """How far the candidate is from the workbench: m, m per unit, and relative for the step.

    Raises Disagreement beyond the candidate's tolerances.
    """
    ours = case.problem.linearize_at(x, case.fixed)
    r, (also_r, J) = candidate.forward(x), candidate.jacobian(x)
    step, our_step = np.asarray(candidate.step(x)), ours.step()
    away = {
        "value": SIGMA * max(_apart(r, ours.residual), _apart(also_r, ours.residual)),
        "jacobian": SIGMA * _apart(J, ours.jacobian),
        "step": _apart(step, our_step) / float(np.abs(our_step).max()),
    }
    allowed = {
        "value": candidate.value_tolerance,
        "jacobian": candidate.jacobian_tolerance,
        "step": 1e3 * candidate.jacobian_tolerance,  # the condition of J comes in
    }
    for what, distance in away.items():
        if not distance <= allowed[what]:
            raise Disagreement(
                f"{candidate.name} on {case.name}: its {what} is {distance:.1e} from the "
                f"workbench's, and {allowed[what]:.0e} is allowed"
            )
    return away


def _apart(a: Any, b: Array) -> float:
    return float(np.abs(np.asarray(a) - b).max())
