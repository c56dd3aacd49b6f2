"""What is promised of every solver in the catalogue."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import casadi as cs
import numpy as np
import pytest
import scipy.optimize

from tests.solvers.problems import TEN, TRUTH, body_fit, decay, line, rosenbrock
from tests.tiers import few
from workbench import SOLVERS, Block, Problem, Residual, Status, Values, solve
from workbench.errors import NotSupported
from workbench.solvers import DEFAULT, Boxes, Iterate, Solution

LOCAL = [name for name, solver in SOLVERS.items() if not solver.abilities.is_global]
EACH_SOLVER = pytest.mark.parametrize("name", few(LOCAL, TEN))
BOUNDED = [name for name in LOCAL if SOLVERS[name].abilities.bounds is Boxes.TAKEN]
QUITTERS = ("nlopt-lbfgs", "nlopt-var2", "steepest-descent")
TOLERANCE = 1e-6  # every solver's gradient_tolerance


def cost(problem: Problem, values: Values) -> float:
    return problem.linearize(values).cost


def limited(name: str, **limits: Any) -> Any:
    return replace(SOLVERS[name], **limits)  # type: ignore[type-var]


@cache
def on_a_body(name: str) -> tuple[Problem, Values, Solution]:
    """Solved once, for all who want to know something about it: some take their time."""
    problem, start = body_fit()
    return problem, start, SOLVERS[name].solve(problem, start)


def solved(build: Callable[[], Any], name: str) -> tuple[Problem, Values, Solution]:
    if build is body_fit:
        return on_a_body(name)
    problem, start = build()
    return problem, start, SOLVERS[name].solve(problem, start)


# The same answer.


def reference(problem: Problem, start: Values) -> Any:
    """SciPy's trust region, with our derivatives."""
    x, fixed = problem.split(start)
    tight = dict.fromkeys(("ftol", "xtol", "gtol"), 1e-14)
    return scipy.optimize.least_squares(
        lambda x: problem.residual(x, fixed),
        x,
        jac=lambda x: problem.linearize_at(x, fixed).jacobian,
        bounds=(problem.lower, problem.upper),
        **tight,
    )


@EACH_SOLVER
@pytest.mark.parametrize("build", [decay, body_fit], ids=["decay", "body"])
def test_they_reach_the_same_minimum(build: Callable[[], Any], name: str) -> None:
    problem, start, solution = solved(build, name)
    assert solution.status is Status.CONVERGED, (solution.status, solution.message)
    expected = reference(problem, start)
    # the cost is flat: off by half the square of the optimality, 1e-12 of it
    assert solution.cost == pytest.approx(expected.cost, rel=1e-9)
    assert solution.cost > 1
    x = problem.free.pack(solution.values)
    np.testing.assert_allclose(x, expected.x, atol=1e-4)


@EACH_SOLVER
@pytest.mark.parametrize("build", few([decay, line, body_fit], 1))
def test_converged_is_what_the_problem_says(build: Callable[[], Any], name: str) -> None:
    problem, start, solution = solved(build, name)
    there = start | solution.values
    x, _ = problem.split(there)
    again = problem.optimality(x, problem.linearize(there))
    assert solution.status is Status.CONVERGED
    assert again <= TOLERANCE * (1 + 1e-6)
    assert solution.optimality == pytest.approx(again, abs=1e-12)
    assert solution.cost == pytest.approx(cost(problem, there), rel=1e-14)
    assert solution.converged
    assert solution.solver.startswith(name.split("-")[0])
    early = limited(name, max_iterations=1).solve(problem, start)
    if early.optimality > TOLERANCE:
        assert early.status is not Status.CONVERGED


@EACH_SOLVER
def test_no_end_is_worse_than_the_start(name: str) -> None:
    problem, _ = rosenbrock()
    for seed in range(3):
        start = {"x": 3 * np.random.default_rng(seed).normal(size=2)}
        solution = limited(name, max_iterations=3).solve(problem, start)
        assert solution.cost <= cost(problem, start)
        assert solution.cost == pytest.approx(cost(problem, solution.values), rel=1e-14)
        assert solution.cost <= min(iterate.cost for iterate in solution.trace)


@EACH_SOLVER
def test_a_warm_start_is_where_it_ends(name: str) -> None:
    problem, start = decay(bounds=BOUNDS if name in BOUNDED else None)
    cold = SOLVERS[name].solve(problem, start | {"x": np.array([1.0, 0.5, 1.0])})
    warm = SOLVERS[name].solve(problem, start | cold.values)
    assert warm.status is Status.CONVERGED
    assert warm.iterations == 0
    np.testing.assert_array_equal(warm.values["x"], cold.values["x"])


@EACH_SOLVER
def test_a_problem_without_noise_converges_too(name: str) -> None:
    """There the residual is rounding error, and so is its angle with the Jacobian."""
    problem, start = decay(noise=0.0)
    solution = SOLVERS[name].solve(problem, start)
    if name == "gauss-newton-full":  # whose full steps end elsewhere, and it says so
        assert solution.status is Status.STALLED
        return
    np.testing.assert_allclose(solution.values["x"], TRUTH, atol=1e-5)
    if name not in QUITTERS:  # which leave when the cost, 1e-18, is small to them
        assert solution.status is Status.CONVERGED


# Bounds.

BOUNDS = {"x": ([0.0, 0.0, 0.55], [1.9, 5.0, 5.0])}  # holds a and c back from their minimum


@EACH_SOLVER
def test_bounds_are_honoured_or_refused(name: str) -> None:
    problem, start = decay(bounds=BOUNDS)
    if name not in BOUNDED:
        with pytest.raises(
            NotSupported, match=r"takes no bounds.*bounds x; use trust-region, ipopt"
        ):
            SOLVERS[name].solve(problem, start)
        return
    solution = SOLVERS[name].solve(problem, start | {"x": np.array([1.0, 0.5, 1.0])})
    expected = reference(problem, start | {"x": np.array([1.0, 0.5, 1.0])})
    assert solution.status is Status.CONVERGED, (solution.status, solution.message)
    # first order in the way that is left to a bound, which may be the tolerance of |r|
    assert solution.cost == pytest.approx(expected.cost, rel=10 * TOLERANCE)
    for iterate in (*solution.trace, solution):
        x = iterate.values["x"]
        assert (x >= BOUNDS["x"][0]).all()
        assert (x <= BOUNDS["x"][1]).all()
    assert solution.values["x"][0] == pytest.approx(1.9, abs=1e-5)
    assert solution.values["x"][2] == pytest.approx(0.55, abs=1e-5)


@pytest.mark.parametrize("name", few(BOUNDED, TEN))
def test_a_start_outside_is_moved_inside(name: str) -> None:
    problem, start = decay(bounds=BOUNDS)
    solution = SOLVERS[name].solve(problem, start | {"x": np.array([7.0, -1.0, 0.0])})
    assert solution.status is Status.CONVERGED
    assert (problem.lower <= solution.values["x"]).all()
    assert (solution.values["x"] <= problem.upper).all()


# Limits.


def long_way(name: str) -> tuple[Problem, Values]:
    """A problem that this solver does not solve in a few steps."""
    if name != "gauss-newton-full":
        return rosenbrock()
    problem, start = decay(noise=0.6)  # two full steps are enough for Rosenbrock's valley
    return problem, start | {"x": np.array([1.5, 1.0, 0.3])}


@EACH_SOLVER
def test_iterations_are_limited(name: str) -> None:
    problem, start = long_way(name)
    solution = limited(name, max_iterations=2).solve(problem, start)
    assert solution.status is Status.MAX_ITERATIONS
    assert solution.iterations == 2
    assert "max_iterations" in solution.message


@EACH_SOLVER
def test_evaluations_are_limited(name: str) -> None:
    problem, start = long_way(name)
    solution = limited(name, max_evaluations=6).solve(problem, start)
    assert solution.status is Status.MAX_EVALUATIONS
    counts = solution.evaluations
    assert counts.residual + counts.gradient + counts.jacobian + counts.hessian == 6


@EACH_SOLVER
def test_seconds_are_limited(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = iter(range(10**6))  # a clock that goes one second forward whenever it is read
    clock = SimpleNamespace(perf_counter=lambda: float(next(ticks)))
    monkeypatch.setattr("workbench.solvers.limits.time", clock)
    problem, start = long_way(name)
    solution = limited(name, max_seconds=10.0).solve(problem, start)
    assert solution.status is Status.MAX_SECONDS
    assert solution.cost <= cost(problem, start)
    assert 10 < solution.seconds < 20


# The way.


@EACH_SOLVER
def test_the_callback_sees_every_iterate(name: str) -> None:
    problem, start = decay()
    seen: list[Iterate] = []
    solution = SOLVERS[name].solve(problem, start, callback=seen.append)
    assert seen == list(solution.trace)
    assert solution.iterations == len(seen) - 1 > 0
    seconds = [iterate.seconds for iterate in seen]
    assert seconds == sorted(seconds)


@EACH_SOLVER
def test_the_callback_can_stop(name: str) -> None:
    problem, start = long_way(name)
    seen: list[Iterate] = []

    def after_three(iterate: Iterate) -> Any:
        seen.append(iterate)
        return np.True_ if len(seen) == 3 else len(seen)  # only true stops

    solution = SOLVERS[name].solve(problem, start, callback=after_three)
    assert solution.status is Status.STOPPED
    assert len(seen) == 3
    assert solution.cost <= min(iterate.cost for iterate in seen)


@EACH_SOLVER
def test_an_interrupt_keeps_the_best_point(name: str) -> None:
    problem, start = long_way(name)
    seen: list[Iterate] = []

    def interrupted(iterate: Iterate) -> None:
        seen.append(iterate)
        if len(seen) == 3:
            raise KeyboardInterrupt

    solution = SOLVERS[name].solve(problem, start, callback=interrupted)
    assert solution.status is Status.STOPPED
    assert "keyboard" in solution.message
    assert solution.cost <= min(iterate.cost for iterate in seen)


@EACH_SOLVER
def test_errors_of_the_callback_are_raised(name: str) -> None:
    def broken(iterate: Iterate) -> None:
        raise LookupError("of the caller")

    with pytest.raises(LookupError, match="of the caller"):
        SOLVERS[name].solve(*decay(), callback=broken)


@EACH_SOLVER
def test_the_trace_tells_the_numbers_of_each_iterate(name: str) -> None:
    problem, start = decay()
    solution = SOLVERS[name].solve(problem, start)
    first = solution.trace[0]
    np.testing.assert_array_equal(first.values["x"], start["x"])
    assert first.step_norm == 0
    for before, after in zip(solution.trace, solution.trace[1:], strict=False):
        step = np.linalg.norm(after.values["x"] - before.values["x"])
        assert after.step_norm == pytest.approx(step)
    for iterate in solution.trace:
        here = problem.linearize(start | iterate.values)
        assert iterate.cost == pytest.approx(here.cost, rel=1e-12)
        if not np.isnan(iterate.optimality):
            there = problem.optimality(iterate.values["x"], here)
            assert iterate.optimality == pytest.approx(there, abs=1e-12)


@EACH_SOLVER
def test_evaluations_are_counted(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    problem, start = decay()
    asked = dict.fromkeys(("residual", "cost_and_gradient", "linearize_at", "hessian_at"), 0)

    def counting(method: str) -> Callable[..., Any]:
        original = getattr(problem, method)

        def counted(*arguments: Any) -> Any:
            asked[method] += 1
            return original(*arguments)

        return counted

    for method in asked:
        monkeypatch.setattr(problem, method, counting(method))
    solution = SOLVERS[name].solve(problem, start)
    counts, own = solution.evaluations + solution.judging, solution.evaluations
    assert counts.residual == asked["residual"]
    assert counts.gradient == asked["cost_and_gradient"]
    assert counts.hessian == asked["hessian_at"]
    # the judge looks at the best point too, if the solver did not do so last
    assert asked["linearize_at"] - counts.jacobian in (0, 1)
    assert solution.trace[-1].evaluations.jacobian <= own.jacobian
    assert solution.judging.jacobian == solution.judging.hessian == 0


# Objectives that misbehave.


COME_BACK = (
    "trust-region",
    "gauss-newton",
    "levenberg-marquardt",
    "levenberg-marquardt-columns",
    "dogleg",
    "newton",
    "dogleg-chumpy",
    "steepest-descent",
    "ipopt",
    "ipopt-exact",
    "scipy-lm",
    "nlopt-bobyqa",
)


def root() -> Problem:
    """sqrt(x) = 0.1: a full Gauss-Newton step from 4 goes to where there is no root."""
    return Problem((Residual("root", cs.sqrt(Block("x").symbol) - 0.1, 0.1),), ("x",))


@EACH_SOLVER
def test_nan_on_the_way_is_survived_or_told(name: str) -> None:
    problem = root()
    solution = SOLVERS[name].solve(problem, {"x": np.array(4.0)})
    if solution.status is Status.CONVERGED or solution.cost < 1e-20:  # or all but
        assert solution.values["x"] == pytest.approx(0.01, rel=1e-3)
    else:
        assert solution.status is Status.NOT_FINITE
        assert "NaN or infinite" in solution.message
    assert solution.cost <= cost(problem, {"x": np.array(4.0)})
    assert np.isfinite(solution.values["x"])
    if name in COME_BACK:  # by their line search, damping or trust region
        assert solution.converged


@EACH_SOLVER
def test_nan_at_the_start_is_said(name: str) -> None:
    solution = SOLVERS[name].solve(root(), {"x": np.array(-1.0)})
    assert solution.status is Status.NOT_FINITE
    assert solution.values["x"] == -1.0


class Fussy(cs.Callback):
    """x -> x, until it has been asked often enough."""

    def __init__(self, patience: int) -> None:
        super().__init__()
        self.patience = patience
        self.construct("fussy", {"enable_fd": True})

    def eval(self, arguments: list[cs.DM]) -> list[cs.DM]:
        self.patience -= 1
        if self.patience < 0:
            raise ValueError("out of patience")
        return [arguments[0]]


@EACH_SOLVER
@pytest.mark.parametrize("patience", few([12, 0], 1))
def test_an_exception_in_the_residual_ends_the_run(
    name: str, patience: int, capfd: pytest.CaptureFixture[str]
) -> None:
    fussy = Fussy(patience)
    x = Block("x", (2,)).symbol
    valley = cs.vertcat(10 * (x[1] - fussy(x[0]) ** 2), 1 - x[0])
    problem = Problem((Residual("valley", valley, 1.0),), ("x",))
    start = {"x": np.array([-1.2, 1.0])}
    solution = SOLVERS[name].solve(problem, start)
    capfd.readouterr()  # CasADi complains aloud
    assert solution.status is Status.RAISED
    assert "out of patience" in solution.message
    assert np.isfinite(solution.values["x"]).all()
    if patience:
        before = cost(rosenbrock()[0], start)
        assert cost(rosenbrock()[0], solution.values) <= before


# The catalogue.


def test_a_trust_region_is_asked_unless_told_otherwise() -> None:
    problem, start = decay()
    assert solve(problem, start).solver == DEFAULT == "trust-region"
    other = solve(problem, start, SOLVERS["gauss-newton"])
    assert isinstance(other, Solution)
    assert other.solver == "gauss-newton"
