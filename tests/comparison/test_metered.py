"""The problem's own counters, whoever asks and however."""

import time
from pathlib import Path

import casadi as cs
import numpy as np
import pytest

from tests.comparison.problems import slide
from tests.solvers.problems import body_fit, decay
from workbench import SOLVERS, Block, Constraint, Problem, Residual, solve
from workbench.comparison.log import Log
from workbench.comparison.metered import Metered
from workbench.errors import NotSupported
from workbench.solvers import Evaluations, Status
from workbench.solvers.limits import Stop

NOTHING = np.zeros(0)


def watched(tmp_path: Path, most: int = 1000) -> tuple[Metered, Path]:
    problem = slide().problem
    return Metered(
        problem, NOTHING, most, 10.0, Log(tmp_path / "log", problem.free.size)
    ), tmp_path / "log"


def test_every_kind_of_question_is_counted(tmp_path: Path) -> None:
    watch, log = watched(tmp_path)
    problem = watch.metered()
    x, fixed = problem.split({"x": np.array([1.0, 1.0])})
    problem.residual(x, fixed)
    problem.cost_and_gradient(x, fixed)
    problem.linearize({"x": x})
    problem.linearize_at(x, fixed)
    problem.hessian_at(x, fixed)
    seen = Log.read(log)
    assert seen.evaluations == Evaluations(1, 1, 2, 1)
    assert all(s > 0 for s in seen.spent[:4])
    assert len(seen.trace) == 1  # it never got better than at first
    np.testing.assert_array_equal(seen.best, x)
    assert slide().problem.residual(x, fixed).size == problem.size


def test_a_wrong_call_is_told_by_the_name_that_was_called(tmp_path: Path) -> None:
    """Not by that of the function which counts in its place."""
    problem = watched(tmp_path)[0].metered()
    for name in ("residual", "linearize_at", "cost_and_gradient", "hessian_at", "costs"):
        with pytest.raises(TypeError, match=rf"^Problem\.{name}\(\) missing"):
            getattr(problem, name)()


def test_a_trace_holds_improvements_only_and_the_best_point_is_a_copy(tmp_path: Path) -> None:
    watch, log = watched(tmp_path)
    problem = watch.metered()
    buffer = np.array([3.0, 1.0])
    for a in (3.0, 5.0, 2.0, np.nan, 1.0):
        buffer[0] = a
        problem.residual(buffer, np.zeros(0))
    seen = Log.read(log)
    np.testing.assert_array_equal(seen.trace[:, 0], [1, 3, 5])
    np.testing.assert_allclose(seen.trace[:, -1], [450, 200, 50])
    assert (np.diff(seen.trace[:, -2]) > 0).all()
    assert seen.not_finite == 1
    np.testing.assert_array_equal(seen.best, [1.0, 1.0])


def test_points_outside_the_bounds_are_no_progress(tmp_path: Path) -> None:
    problem, start = decay(bounds={"x": (0.4, 5.0)})
    watch = Metered(problem, problem.split(start)[1], 99, 9.0, Log(tmp_path / "log", 3))
    x, fixed = problem.split(start)
    watch.metered().residual(x, fixed)  # starts at c = 0
    assert not len(Log.read(tmp_path / "log").trace)
    watch.metered().residual(np.clip(x, 0.4, 5.0), fixed)
    assert len(Log.read(tmp_path / "log").trace) == 1


def test_what_comes_after_the_limit_is_no_progress_and_then_it_ends(tmp_path: Path) -> None:
    watch, log = watched(tmp_path, most=2)
    problem = watch.metered()
    for a in (3.0, 2.0, 1.0, 1.0, 1.0):  # three more to close the books
        problem.residual(np.array([a, 1.0]), np.zeros(0))
    with pytest.raises(Stop) as stop:
        problem.residual(np.ones(2), np.zeros(0))
    assert stop.value.status is Status.MAX_EVALUATIONS
    seen = Log.read(log)
    assert seen.evaluations.residual == 5
    assert seen.best[0] == 2.0


def test_time_is_a_limit_too(tmp_path: Path) -> None:
    problem = slide().problem
    watch = Metered(problem, NOTHING, 99, 0.05, Log(tmp_path / "log", 2), closing=0.05)
    asked = watch.metered()
    asked.residual(np.full(2, 2.0), NOTHING)
    time.sleep(0.06)
    asked.residual(np.ones(2), NOTHING)
    time.sleep(0.05)
    with pytest.raises(Stop) as stop:
        asked.residual(np.ones(2), NOTHING)
    assert stop.value.status is Status.MAX_SECONDS
    assert len(Log.read(tmp_path / "log").trace) == 1


def test_stages_are_seen_and_other_costs_make_no_progress(tmp_path: Path) -> None:
    problem, start = body_fit()
    x, fixed = problem.split(start)
    watch = Metered(problem, fixed, 99, 9.0, Log(tmp_path / "log", x.size))
    part = watch.metered().freeing("trans")
    there = np.array([0.1, 0.2, -0.1])
    part.residual(there, part.split(start)[1])
    seen = Log.read(tmp_path / "log")
    whole = problem.free.pack(start | {"trans": there})
    np.testing.assert_array_equal(seen.best, whole)
    r = problem.residual(whole, fixed)
    assert seen.trace[-1, -1] == pytest.approx(0.5 * r @ r)
    less = watch.metered().without(problem.residuals[0].name)
    less.linearize(start)
    seen = Log.read(tmp_path / "log")
    assert seen.evaluations == Evaluations(residual=1, jacobian=1)
    assert len(seen.trace) == 1


def test_points_at_which_an_end_is_judged_are_no_progress(tmp_path: Path) -> None:
    """The ridge of (x^2 - 1)^2: the judge finds a lower point beside it, and the run did not."""
    x = Block("x").symbol
    problem = Problem((Residual("ridge", x**2 - 1, 1.0),), ("x",))
    watch = Metered(problem, NOTHING, 99, 9.0, Log(tmp_path / "log", 1))
    solution = solve(watch.metered(), {"x": 0.0})
    assert solution.status is Status.SADDLE
    assert solution.judging.residual > 0
    seen = Log.read(tmp_path / "log")
    assert seen.trace[-1, -1] == solution.cost == 0.5
    assert seen.best == solution.values["x"]
    assert seen.evaluations.residual == solution.evaluations.residual + solution.judging.residual


def test_what_constraints_forbid_is_no_progress(tmp_path: Path) -> None:
    x = Block("x", (2,)).symbol
    circle = Constraint("circle", cs.sumsqr(x), 1.0, 1.0)
    problem = Problem((Residual("r", x, 1.0),), ("x",), constraints=(circle,))
    watch = Metered(problem, NOTHING, 99, 9.0, Log(tmp_path / "log", 2))
    watch.metered().residual(np.zeros(2), NOTHING)
    assert not len(Log.read(tmp_path / "log").trace)
    watch.metered().residual(np.array([0.6, 0.8]), NOTHING)
    assert Log.read(tmp_path / "log").trace[-1, -1] == pytest.approx(0.5)


@pytest.mark.parametrize("name", SOLVERS)
def test_the_counters_agree_with_what_a_solver_of_the_house_says(name: str, tmp_path: Path) -> None:
    problem, start = decay()
    log = Log(tmp_path / "log", problem.free.size)
    try:
        solution = SOLVERS[name].solve(
            Metered(problem, problem.split(start)[1], 9999, 60.0, log).metered(), start
        )
    except NotSupported:
        pytest.skip("not made for it")
    seen = Log.read(tmp_path / "log").evaluations
    all_of_them = solution.evaluations + solution.judging
    for kind in ("residual", "gradient", "hessian"):
        assert getattr(seen, kind) == getattr(all_of_them, kind), kind
    assert 0 <= seen.jacobian - solution.evaluations.jacobian <= 1  # the last look at the end


def test_a_log_that_was_never_begun_is_empty(tmp_path: Path) -> None:
    (tmp_path / "log").touch()
    seen = Log.read(tmp_path / "log")
    assert seen.evaluations == Evaluations()
    assert not seen.best.size
