"""What a problem is asked is counted, timed and followed, whoever asks and however."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import casadi as cs
import numpy as np
import pytest

from tests.comparison.made_up import in_this_process
from tests.comparison.problems import LINE, line, slide
from tests.solvers.problems import body_fit, decay
from tests.tiers import few
from workbench import SOLVERS, Block, Constraint, GaussNewton, Problem, Residual, Solution, Values
from workbench.comparison import compare
from workbench.comparison.metered import RunMeter
from workbench.comparison.record import KINDS, ObservedRun, RunLog
from workbench.errors import NotSupported
from workbench.solvers import Callback, Evaluations, Status
from workbench.solvers.limits import Stop

NOTHING = np.zeros(0)


def watched(tmp_path: Path, most: int = 1000) -> tuple[RunMeter, Path]:
    problem = slide().problem
    return RunMeter(
        problem, NOTHING, most, 10.0, RunLog(tmp_path / "log", problem.free.size)
    ), tmp_path / "log"


def test_questions_are_counted_by_kind(tmp_path: Path) -> None:
    watch, log = watched(tmp_path)
    problem = watch.metered()
    x, fixed = problem.split({"x": np.array([1.0, 1.0])})
    problem.residual(x, fixed)
    problem.cost_and_gradient(x, fixed)
    problem.linearize({"x": x})
    problem.linearize_at(x, fixed)
    problem.hessian_at(x, fixed)
    seen = RunLog.read(log)
    assert seen.evaluations == Evaluations(1, 1, 2, 1)
    assert all(s > 0 for s in seen.spent[:4])
    assert len(seen.trace) == 1  # it never got better than at first
    np.testing.assert_array_equal(seen.best, x)
    assert slide().problem.residual(x, fixed).size == problem.size


def test_trace_holds_improvements_only(tmp_path: Path) -> None:
    watch, log = watched(tmp_path)
    problem = watch.metered()
    buffer = np.array([3.0, 1.0])
    for a in (3.0, 5.0, 2.0, np.nan, 1.0):
        buffer[0] = a
        problem.residual(buffer, np.zeros(0))
    seen = RunLog.read(log)
    np.testing.assert_array_equal(seen.trace[:, 0], [1, 3, 5])
    np.testing.assert_allclose(seen.trace[:, -1], [450, 200, 50])
    assert (np.diff(seen.trace[:, -2]) > 0).all()
    assert seen.not_finite == 1
    np.testing.assert_array_equal(seen.best, [1.0, 1.0])


def test_points_outside_the_bounds_are_no_progress(tmp_path: Path) -> None:
    problem, start = decay(bounds={"x": (0.4, 5.0)})
    watch = RunMeter(problem, problem.split(start)[1], 99, 9.0, RunLog(tmp_path / "log", 3))
    x, fixed = problem.split(start)
    watch.metered().residual(x, fixed)  # starts at c = 0
    assert not len(RunLog.read(tmp_path / "log").trace)
    watch.metered().residual(np.clip(x, 0.4, 5.0), fixed)
    assert len(RunLog.read(tmp_path / "log").trace) == 1


def test_evaluations_after_the_limit_are_no_progress(tmp_path: Path) -> None:
    watch, log = watched(tmp_path, most=2)
    problem = watch.metered()
    for a in (3.0, 2.0, 1.0, 1.0, 1.0):  # three more to close the books
        problem.residual(np.array([a, 1.0]), np.zeros(0))
    with pytest.raises(Stop) as stop:
        problem.residual(np.ones(2), np.zeros(0))
    assert stop.value.status is Status.MAX_EVALUATIONS
    seen = RunLog.read(log)
    assert seen.evaluations.residual == 5
    assert seen.best[0] == 2.0


def test_time_is_a_limit_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr("time.perf_counter", lambda: now[0])
    problem = slide().problem
    watch = RunMeter(problem, NOTHING, 99, 5.0, RunLog(tmp_path / "log", 2), closing=5.0)
    asked = watch.metered()
    asked.residual(np.full(2, 2.0), NOTHING)
    now[0] = 6.0
    asked.residual(np.ones(2), NOTHING)
    now[0] = 11.0
    with pytest.raises(Stop) as stop:
        asked.residual(np.ones(2), NOTHING)
    assert stop.value.status is Status.MAX_SECONDS
    assert len(RunLog.read(tmp_path / "log").trace) == 1


def test_stages_are_followed_and_other_costs_not(tmp_path: Path) -> None:
    problem, start = body_fit()
    x, fixed = problem.split(start)
    watch = RunMeter(problem, fixed, 99, 9.0, RunLog(tmp_path / "log", x.size))
    part = watch.metered().freeing("trans")
    there = np.array([0.1, 0.2, -0.1])
    part.residual(there, part.split(start)[1])
    seen = RunLog.read(tmp_path / "log")
    whole = problem.free.pack(start | {"trans": there})
    np.testing.assert_array_equal(seen.best, whole)
    r = problem.residual(whole, fixed)
    assert seen.trace[-1, -1] == pytest.approx(0.5 * r @ r)
    less = watch.metered().without(problem.residuals[0].name)
    less.linearize(start)
    seen = RunLog.read(tmp_path / "log")
    assert seen.evaluations == Evaluations(residual=1, jacobian=1)
    assert len(seen.trace) == 1


@pytest.mark.parametrize(
    "name",
    few(
        SOLVERS, ("trust-region", "levenberg-marquardt", "ipopt-exact", "nlopt-lbfgs", "scipy-trf")
    ),
)
def test_counters_agree_with_solvers(name: str, tmp_path: Path) -> None:
    problem, start = decay()
    log = RunLog(tmp_path / "log", problem.free.size)
    try:
        solution = SOLVERS[name].solve(
            RunMeter(problem, problem.split(start)[1], 9999, 60.0, log).metered(), start
        )
    except NotSupported:
        pytest.skip("not made for it")
    seen = RunLog.read(tmp_path / "log").evaluations
    all_of_them = solution.evaluations + solution.judging
    for kind in ("residual", "gradient", "hessian"):
        assert getattr(seen, kind) == getattr(all_of_them, kind), kind
    assert 0 <= seen.jacobian - solution.evaluations.jacobian <= 1  # the last look at the end


X = np.full(3, 5.0)


def line_watched(tmp_path: Path, most: int = 1000) -> tuple[Problem, Callable[[], ObservedRun]]:
    log = tmp_path / "log"
    watch = RunMeter(line().problem, NOTHING, most, 10.0, RunLog(log, 3))
    return watch.metered(), lambda: RunLog.read(log)


def counts(seen: ObservedRun) -> dict[str, int]:
    return {kind: n for kind, n in zip(KINDS, seen.counts, strict=True) if n}


@dataclass(frozen=True)
class Twin:
    """Solves a second problem made of the same residuals, and asks the first one nothing."""

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        return GaussNewton().solve(Problem(problem.residuals, problem.free.names), start)


def test_twins_of_a_problem_are_noticed() -> None:
    with in_this_process():
        compared = compare(LINE, {"twin": Twin(), "gauss-newton": GaussNewton()})
    instance = compared.instances[0].name
    assert compared.solved(instance, "twin", 1e-5)
    assert compared.uncounted(instance, "twin")
    assert not compared.uncounted(instance, "gauss-newton")
    assert compared.all_counted(1e-5) == ("gauss-newton",)


@pytest.mark.parametrize("name", ["function", "derivative", "adjoint", "hessian", "residuals"])
def test_graphs_that_are_taken_are_noticed(name: str, tmp_path: Path) -> None:
    problem, seen = line_watched(tmp_path)
    assert not seen().taken
    assert getattr(problem, name)
    assert seen().taken


def test_batches_keep_to_the_limits(tmp_path: Path) -> None:
    batch, seen = line_watched(tmp_path, most=4)
    z = np.linspace(4, 0, 10)[:, None] * np.ones(3)
    batch.costs(X, NOTHING)(z)  # of ten points at once only four count
    assert seen().trace[-1, 0] <= 4
    assert counts(seen()) == {"residual": 10}
    for ask in (batch.costs(X, NOTHING), batch.cost_gradients(X, NOTHING)):
        with pytest.raises(Stop):
            ask(X[None])


def test_constraints_are_counted_by_kind(tmp_path: Path) -> None:
    x = Block("x", (2,)).symbol
    circle = Constraint("circle", cs.sumsqr(x), 1.0, 1.0)
    problem = Problem((Residual("r", x, 1.0),), ("x",), constraints=(circle,))
    watch = RunMeter(problem, NOTHING, 99, 9.0, RunLog(tmp_path / "log", 2))
    asked, at = watch.metered(), np.array([0.6, 0.8])
    there = asked.stacked_constraints
    assert there is not None
    there.values(at, NOTHING)
    there.linearize(at, NOTHING)
    there.hessian(at, NOTHING, np.ones(1))
    asked.linearize_at(at, NOTHING)
    asked.residual(at, NOTHING)
    seen = RunLog.read(tmp_path / "log")
    assert counts(seen) == {
        "residual": 1,
        "jacobian": 1,
        "constraint": 1,
        "constraint_jacobian": 2,
        "constraint_hessian": 1,
    }
    assert seen.evaluations.constraint == 4
