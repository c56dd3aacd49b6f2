"""Runs of one stage: a run that cannot come down far enough is given up."""

import casadi as cs
import numpy as np
import pytest

from workbench import Block, LevenbergMarquardt, Problem, Residual
from workbench.registration.fit_stage import StageRuns

LOWEST = 0.5  # of the cost below


def test_a_run_that_cannot_come_down_far_enough_is_given_up() -> None:
    """That is above a tenth more than `enough`, even after five more decreases like the last."""
    x = Block("x", (2,))
    valley = cs.vertcat(10 * (x.symbol[1] - x.symbol[0] ** 2), 1 - x.symbol[0], 1.0)
    problem = Problem([Residual("valley", valley, 1.0)], ["x"], blocks=[x])
    ends = {}
    for enough in (np.inf, LOWEST, 0.1 * LOWEST):
        runs = StageRuns(problem, LevenbergMarquardt(), None, lambda: False, (1, 1), 1)
        ends[enough] = runs.run(0, {"x": np.array([-1.2, 1.0])}, 60, 1e-9, enough)
    assert ends[np.inf].cost == pytest.approx(LOWEST)
    assert len(ends[LOWEST].trace) == len(ends[np.inf].trace)  # it can come down to that
    assert len(ends[0.1 * LOWEST].trace) < len(ends[np.inf].trace)
