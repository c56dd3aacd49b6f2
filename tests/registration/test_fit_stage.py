"""Runs of a stage that are given up: they cannot come down far enough, or lead to a known end."""

import casadi as cs
import numpy as np
import pytest

from workbench import Block, LevenbergMarquardt, Problem, Residual, load_body
from workbench.blocks import Values
from workbench.registration.fit_stage import StageRuns
from workbench.registration.unfolding import Known

LOWEST = 0.5  # of the cost below


def test_a_run_that_cannot_come_down_far_enough_is_given_up() -> None:
    """That is above a tenth more than `enough`, even after five more decreases like the last."""
    x = Block("x", (2,))
    valley = cs.vertcat(10 * (x.symbol[1] - x.symbol[0] ** 2), 1 - x.symbol[0], 1.0)
    problem = Problem([Residual("valley", valley, 1.0)], ["x"], blocks=[x])
    ends, given_up = {}, []
    for enough in (np.inf, LOWEST, 0.1 * LOWEST):
        runs = StageRuns(problem, LevenbergMarquardt(), None, lambda: False, (1, 1), 1)
        ends[enough] = runs.run(0, {"x": np.array([-1.2, 1.0])}, 60, 1e-9, enough)
        given_up.append(runs.given_up)
    assert given_up == [False, False, True]
    assert ends[np.inf].cost == pytest.approx(LOWEST)
    assert len(ends[LOWEST].trace) == len(ends[np.inf].trace)  # it can come down to that
    assert len(ends[0.1 * LOWEST].trace) < len(ends[np.inf].trace)


def test_a_run_that_comes_to_a_known_end_is_given_up() -> None:
    """Not where it begins: from there it may lead elsewhere."""
    x = Block("x", (2,))
    problem = Problem([Residual("off", x.symbol - 1, 1.0)], ["x"], blocks=[x])
    lengths, given_up = [], []
    for near in (0.0, 0.5, 10.0):
        runs = StageRuns(problem, LevenbergMarquardt(), None, lambda: False, (1, 1), 1)
        asked: list[float] = []

        def known(values: Values, near: float = near, asked: list[float] = asked) -> bool:
            asked.append(float(np.linalg.norm(values["x"] - 1)))
            return asked[-1] < near

        end = runs.run(0, {"x": np.array([3.0, -2.0])}, 60, 1e-9, known=known)
        assert asked[0] < np.hypot(2.0, 3.0)
        lengths.append(len(end.trace))
        given_up.append(runs.given_up)
    assert given_up == [False, True, True]
    assert lengths[2] == 2 <= lengths[1] < lengths[0]


def test_known_ends_are_told_by_their_joints() -> None:
    body = load_body("small")
    known = Known(body, 0.01)
    assert not known.knows(body.start())
    known.add(body.start())
    for off, near in ((0.009, True), (0.011, False)):
        moved = body.start()
        moved["trans"] = moved["trans"] + [off, 0.0, 0.0]
        assert known.knows(moved) == near
