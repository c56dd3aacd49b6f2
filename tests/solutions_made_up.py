"""A made-up solution of several starts."""

from collections.abc import Mapping

import numpy as np

from workbench.solvers import Evaluations, Hypothesis, Solution, Status


def solution_of(
    minima: Mapping[float, tuple[int, ...]], statuses: tuple[Status, ...] = ()
) -> Solution:
    """One whose hypotheses have these costs and starts, in this order; all x are zero."""
    statuses = statuses or (Status.CONVERGED,) * len(minima)
    x = {"x": np.zeros(2)}
    hypotheses = tuple(
        Hypothesis(x, cost, status, starts)
        for (cost, starts), status in zip(minima.items(), statuses, strict=True)
    )
    cost = min(minima, default=1.0)
    return Solution(
        x, cost, 0.0, Status.CONVERGED, "", "made-up", Evaluations(), 1.0, (), hypotheses=hypotheses
    )
