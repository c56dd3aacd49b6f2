"""What a run may say of its end: no more than is true there."""

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

from tests.solvers.problems import decay
from tests.tiers import few
from workbench import SOLVERS, Block, Nlopt, Problem, Residual, Solution, Status, solve
from workbench.errors import NotSupported
from workbench.experiments import find
from workbench.experiments.more_wild_formulas import observed
from workbench.solvers import Dogleg, Ipopt, Solver, chumpy, gauss_newton_hessian

LOCAL = [name for name in SOLVERS if name != "nlopt-mlsl"]  # which needs bounds
FEW = ("trust-region", "levenberg-marquardt", "dogleg", "ipopt", "nlopt-lbfgs")


def of(*rows: cs.MX, free: tuple[str, ...] = ("x",)) -> Problem:
    return Problem((Residual("fit", cs.vertcat(*rows), 1.0),), free)


@pytest.mark.parametrize("name", few(LOCAL, FEW))
def test_a_far_start_does_not_lower_what_converged_means(name: str) -> None:
    """exp(x) - 1 from 30: e^30 is no measure of rounding where the minimum is, at 0."""
    problem = of(cs.exp(Block("x").symbol) - 1)
    solution = SOLVERS[name].solve(problem, {"x": 30.0})
    if solution.converged:
        assert abs(float(solution.values["x"])) < 1e-6
    elif name == "ipopt-lbfgs":  # which leaps to where exp(x) is zero, to all digits
        assert solution.status is Status.INSENSITIVE
    else:
        assert solution.status in (Status.MAX_EVALUATIONS, Status.STALLED)


@pytest.mark.parametrize("ratio", [1e8, 1e15])
def test_the_default_finds_what_it_notices_faintly(ratio: float) -> None:
    """x is noticed 1e8 or 1e15 times as strongly as y; y is found all the same."""
    x, y = Block("x").symbol, Block("y").symbol
    problem = of(ratio * (x - 1), y - 2, y**2 - 4, free=("x", "y"))
    solution = solve(problem, {"x": 0.0, "y": 0.5})
    assert solution.converged
    assert float(solution.values["y"]) == pytest.approx(2.0, abs=1e-9)


def test_the_default_finds_it_in_the_same_rows_too() -> None:
    x, y = Block("x").symbol, Block("y").symbol
    A = np.random.default_rng(0).standard_normal((5, 2))
    problem = of(A @ cs.vertcat(1e8 * (x - 1), y - 2), free=("x", "y"))
    solution = solve(problem, {"x": 0.0, "y": 0.5})
    assert solution.converged
    assert float(solution.values["y"]) == pytest.approx(2.0, abs=1e-5)


@pytest.mark.parametrize("name", few(LOCAL, FEW))
def test_what_rounding_hides_is_not_called_found(name: str) -> None:
    """In rows with terms of 1e15, y is lost in rounding errors: found exactly, or not found."""
    x, y = Block("x").symbol, Block("y").symbol
    A = np.random.default_rng(0).standard_normal((5, 2))
    problem = of(A @ cs.vertcat(1e15 * (x - 1), y - 2), free=("x", "y"))
    solution = SOLVERS[name].solve(problem, {"x": 0.0, "y": 0.5})
    if solution.converged:
        assert float(solution.values["y"]) == pytest.approx(2.0, abs=1e-6)


def test_what_rounding_hides_is_said() -> None:
    """By a solver that stays beside the answer.

    Other solvers, among them the default, hit y = 2 exactly from most starts, where no residual is
    left and nothing is hidden.
    """
    x, y = Block("x").symbol, Block("y", unit="m").symbol
    rows = A_HIDDEN @ cs.vertcat(1e15 * (x - 1), y - 2)
    problem = Problem((Residual("fit", rows, 1.0),), ("x", "y"), blocks=(Block("z"),))
    solution = SOLVERS["levenberg-marquardt"].solve(problem, {"x": 0.0, "y": 0.5})
    assert solution.status is Status.STALLED
    assert "rounding hides what is left" in solution.message
    assert "that y is known only to about" in solution.message


A_HIDDEN = np.random.default_rng(0).standard_normal((5, 2))


@pytest.mark.parametrize("name", few(LOCAL, FEW))
def test_a_constant_residual_is_no_reason_to_stop(name: str) -> None:
    problem = of(Block("x").symbol - 1, cs.MX(1e6))
    solution = SOLVERS[name].solve(problem, {"x": 0.0})
    assert solution.iterations > 0
    if solution.converged:
        assert float(solution.values["x"]) == pytest.approx(1.0, abs=1e-6)


# Unknowns that the residual loses.


def meyer() -> Problem:
    """MGH10 of NIST, problem 10 of Moré, Garbow and Hillstrom (1981)."""
    b = Block("b", (3,)).symbol
    t = 45 + 5 * np.arange(1.0, 17.0)
    return Problem(
        (Residual("fit", b[0] * cs.exp(b[1] / (t + b[2])) - cs.DM(observed("meyer")), 1.0),), "b"
    )


@pytest.mark.parametrize(
    "solver", [Dogleg(rule=chumpy), Ipopt(hessian=gauss_newton_hessian)], ids=["chumpy", "ipopt"]
)
def test_a_leap_into_a_desert_is_lost(solver: Solver) -> None:
    """The first step ends where the exponential is zero, at 4e7 times the least cost."""
    solution = solver.solve(meyer(), {"b": [2.0, 400_000.0, 25_000.0]})
    assert solution.cost > 1e9
    assert solution.status is Status.INSENSITIVE
    assert solution.insensitive == ("b[0]", "b[1]", "b[2]")
    assert "does not change with b[0], b[1], b[2] here" in solution.message
    assert not solution.converged


def test_one_lost_unknown_is_named_alone() -> None:
    x = Block("x", (2,)).symbol
    problem = of(x[0] - 1, 1 + cs.exp(x[1]))  # x[1] falls for ever, and e^x[1] is soon zero
    solution = SOLVERS["gauss-newton"].solve(problem, {"x": [0.0, 0.0]})
    assert solution.status is Status.INSENSITIVE
    assert solution.insensitive == ("x[1]",)


def test_an_inactive_penalty_is_not_lost() -> None:
    """Its rows are zero: nothing more can be gained, whoever is noticed."""
    x = Block("x", (2,)).symbol
    problem = of(x[0] - 1, cs.fmax(0, x[1] - 1), 0.3)
    solution = SOLVERS["gauss-newton"].solve(problem, {"x": [0.0, 4.0]})
    assert solution.converged
    assert solution.insensitive == ()


def test_a_far_start_loses_nothing() -> None:
    """From 50 the column falls from e^50 to 1: much smaller, and noticed all the same."""
    solution = solve(of(cs.exp(Block("x").symbol) - 1), {"x": 50.0})
    assert solution.converged
    assert solution.insensitive == ()


def test_an_unread_unknown_is_listed() -> None:
    x = Block("x", (3,)).symbol
    problem = of(x[0] - 1, x[0] + x[2] - 3)
    solution = solve(problem, {"x": [5.0, 7.0, 0.0]})
    assert solution.converged
    assert solution.insensitive == ("x[1]",)
    assert solution.message.endswith("(no residual reads x[1])")
    decayed, start = decay()
    assert solve(decayed, start).message == Status.CONVERGED.value


@pytest.mark.parametrize(
    "name", ["gauss-newton", "dogleg", "nlopt-lbfgs", "scipy-dogbox", "newton"]
)
def test_a_minimum_with_a_column_of_zeros_is_not_lost(name: str) -> None:
    """1 + x^2 has its least square where its derivative vanishes, and is noticed on both sides."""
    x = Block("x").symbol
    for residual in (1 + x**2, cs.sqrt(x**2 + 1) - 0.5):
        solution = SOLVERS[name].solve(of(residual), {"x": 1.0})
        assert solution.status is not Status.INSENSITIVE
        assert abs(float(solution.values["x"])) < 1e-2


def test_a_maximum_is_a_saddle() -> None:
    solution = solve(of(2 - Block("x").symbol ** 2), {"x": 0.0})
    assert solution.insensitive == ("x",)
    assert solution.status is Status.SADDLE


def test_an_unknown_unnoticed_at_a_minimum_is_listed() -> None:
    solution = solve(of(2 + Block("x").symbol ** 2), {"x": 0.0})
    assert solution.insensitive == ("x",)
    assert solution.converged
    assert "no residual changes with x where its Jacobian was computed" in solution.message


def test_what_was_lost_is_saved(tmp_path) -> None:
    solution = SOLVERS["dogleg-chumpy"].solve(meyer(), {"b": [2.0, 400_000.0, 25_000.0]})
    assert solution.insensitive
    solution.save(tmp_path / "meyer.npz")
    again = Solution.load(tmp_path / "meyer.npz")
    assert (again.status, again.insensitive) == (solution.status, solution.insensitive)
    assert again.judging == solution.judging


# What the words promise.


@pytest.mark.thorough
def test_a_step_that_cannot_be_interrupted_is_not_begun() -> None:
    """NLopt's SLSQP needs seconds for a step in 1,000 unknowns, and looks at no clock in it."""
    x = Block("x", (1000,)).symbol
    problem = of(cs.vertcat(10 * (x[1:] - x[:-1] ** 2), 1 - x[:-1]))
    start = {"x": np.full(1000, -1.2)}
    solution = replace(SOLVERS["nlopt-slsqp"], max_seconds=2.0).solve(problem, start)
    assert solution.status is Status.MAX_SECONDS
    assert "cannot be interrupted" in solution.message
    assert solution.evaluations.gradient == 0
    with pytest.raises(NotSupported):
        Nlopt("GN_DIRECT_L").solve(problem, start)


@pytest.mark.parametrize("problem", few(["jennrich-sampson", "bard", "box", "osborne-1"], 1))
def test_convergence_from_far_starts_is_true(problem: str) -> None:
    """Whoever says CONVERGED has no gradient left, rounding errors of the start apart."""
    setup = find(f"more-wild-{problem}", {}).setup()
    free = setup.problem.free.names
    start = {k: 10 * np.asarray(v) if k in free else v for k, v in setup.start.items()}
    for name in ("gauss-newton", "levenberg-marquardt", "dogleg", "newton", "ipopt", "scipy-trf"):
        solution = replace(SOLVERS[name], max_evaluations=500).solve(setup.problem, start)
        if solution.converged:
            here = setup.problem.linearize(setup.start | solution.values)
            left = np.abs(here.gradient) / np.maximum(here.column_norms, 1e-300)
            assert left.max() <= 1e-5 * np.sqrt(2 * here.cost) + 1e-9, name
