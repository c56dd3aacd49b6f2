"""What a run may say of its end: no more than is true there."""

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

from tests.solvers.problems import body_fit, decay
from tests.tiers import few
from workbench import (
    SOLVERS,
    Block,
    Problem,
    Residual,
    Solution,
    Status,
    residuals,
    solve,
)
from workbench.experiments.more_wild import observed
from workbench.problem.naming import Bounds
from workbench.solvers import Dogleg, GaussNewton, Ipopt, Run, Solver, chumpy, gauss_newton_hessian
from workbench.solvers.no_minimum import EndPoint

LOCAL = [name for name in SOLVERS if name != "nlopt-mlsl"]  # which needs bounds
FEW = ("trust-region", "levenberg-marquardt", "dogleg", "ipopt", "nlopt-lbfgs")
X, XY = Block("x").symbol, Block("x", (2,)).symbol


def of(
    *rows: cs.MX, free: tuple[str, ...] = ("x",), bounds: Bounds | None = None, sigma: float = 1.0
) -> Problem:
    return Problem((Residual("fit", cs.vertcat(*rows), sigma),), free, bounds)


@pytest.mark.parametrize("name", few(LOCAL, FEW))
def test_a_far_start_does_not_lower_what_converged_means(name: str) -> None:
    """exp(x) - 1 from 30: e^30 is no measure of rounding where the minimum is, at 0."""
    problem = of(cs.exp(Block("x").symbol) - 1)
    solution = SOLVERS[name].solve(problem, {"x": 30.0})
    if solution.converged:
        assert abs(float(solution.values["x"])) < 1e-6
    elif name == "ipopt-lbfgs":  # which leaps to where exp(x) is zero, to all digits
        assert solution.status in (Status.INSENSITIVE, Status.NO_FINITE_MINIMUM)
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


@pytest.mark.parametrize("name", few(LOCAL, FEW))
def test_what_rounding_hides_is_not_called_found(name: str) -> None:
    """In rows with terms of 1e15, y is lost in rounding errors: found exactly, or not found."""
    x, y = Block("x").symbol, Block("y").symbol
    A = np.random.default_rng(0).standard_normal((5, 2))
    problem = of(A @ cs.vertcat(1e15 * (x - 1), y - 2), free=("x", "y"))
    solution = SOLVERS[name].solve(problem, {"x": 0.0, "y": 0.5})
    if solution.converged:
        assert float(solution.values["y"]) == pytest.approx(2.0, abs=1e-6)


@pytest.mark.parametrize("name", few(LOCAL, FEW))
def test_a_constant_residual_is_no_reason_to_stop(name: str) -> None:
    problem = of(Block("x").symbol - 1, cs.MX(1e6))
    solution = SOLVERS[name].solve(problem, {"x": 0.0})
    assert solution.iterations > 0
    if solution.converged:
        assert float(solution.values["x"]) == pytest.approx(1.0, abs=1e-6)


# Insensitive unknowns.


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
def test_a_leap_into_a_desert_is_insensitive(solver: Solver) -> None:
    """The first step ends where the exponential is zero, at 4e7 times the least cost."""
    solution = solver.solve(meyer(), {"b": [2.0, 400_000.0, 25_000.0]})
    assert solution.cost > 1e9
    assert solution.status is Status.INSENSITIVE
    assert solution.insensitive == ("b[0]", "b[1]", "b[2]")
    assert "hardly changes with b[0], b[1], b[2] here" in solution.message
    assert not solution.converged


def test_one_unknown_that_leads_away_is_named_alone() -> None:
    x = Block("x", (2,)).symbol
    problem = of(x[0] - 1, 1 + cs.exp(x[1]))  # x[1] falls for ever, and e^x[1] is soon zero
    solution = SOLVERS["gauss-newton"].solve(problem, {"x": [0.0, 0.0]})
    assert solution.status is Status.NO_FINITE_MINIMUM
    assert solution.diverging == ("x[1]",)


def test_an_inactive_penalty_is_not_insensitive() -> None:
    """Its rows are zero: nothing more can be gained, whoever is noticed."""
    x = Block("x", (2,)).symbol
    problem = of(x[0] - 1, cs.fmax(0, x[1] - 1), 0.3)
    solution = SOLVERS["gauss-newton"].solve(problem, {"x": [0.0, 4.0]})
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
def test_a_minimum_with_a_column_of_zeros_is_not_insensitive(name: str) -> None:
    """1 + x^2 has its least square where its derivative vanishes, and is noticed on both sides."""
    x = Block("x").symbol
    for residual in (1 + x**2, cs.sqrt(x**2 + 1) - 0.5):
        solution = SOLVERS[name].solve(of(residual), {"x": 1.0})
        assert solution.status is not Status.INSENSITIVE
        assert abs(float(solution.values["x"])) < 1e-2


# What the words promise.


# Ends on which nothing depends.


def mgh_gulf(x: cs.MX) -> cs.MX:
    """Problem 11 of Moré, Garbow and Hillstrom (1981)."""
    t = np.arange(1.0, 100) / 100
    y = cs.DM(25 + (-50 * np.log(t)) ** (2 / 3))
    return cs.exp(-(cs.fabs(y - x[1]) ** x[2]) / x[0]) - cs.DM(t)


@pytest.mark.parametrize(
    ("problem", "start"),
    [
        (of(cs.exp(-50 * (X - 3) ** 2) - 1), 0.0),
        (of(mgh_gulf(Block("x", (3,)).symbol)), [500.0, 250.0, 15.0]),
        (of(1e12 + Block("zero").symbol * XY), [1.0, 1.0]),
    ],
    ids=["a peak elsewhere", "gulf", "a constant"],
)
def test_start_on_which_nothing_depends_is_insensitive(problem: Problem, start) -> None:
    solution = solve(problem, {"x": start, "zero": 0.0})
    assert solution.status is Status.INSENSITIVE
    assert solution.insensitive == tuple(problem.free.labels_of(np.arange(problem.free.size)))
    assert "the residual hardly changes with x" in solution.message
    assert solution.evaluations.total == 1


def test_what_changes_nothing_anywhere_does_not_spoil_an_end() -> None:
    """As a finger that no keypoint shows, which the formula reads all the same."""
    zero = Block("zero", (2,)).symbol
    problem = of(XY[0] - 1, XY[0] + 2 + zero.T @ XY)
    solution = solve(problem, {"x": [5.0, 3.0], "zero": np.zeros(2)})
    assert solution.converged
    assert solution.insensitive == ("x[1]",)
    assert "no residual changes with x[1] where its Jacobian was computed" in solution.message


def test_a_coefficient_near_zero_is_not_insensitive() -> None:
    """Noise in the other rows is a hundred thousand times what it does at its own size."""
    noise = np.random.default_rng(0).standard_normal(30)
    solution = solve(of(1e-3 * XY[0], noise + XY[1]), {"x": [1e-6, 0.0]})
    assert solution.converged


# Ends of runs that lead away.


@pytest.mark.parametrize("scale", [10.0, 100.0])
def test_beale_from_afar_has_no_finite_minimum(scale: float) -> None:
    a, b = cs.vertsplit(XY)
    rows = (y - a * (1 - b ** (i + 1)) for i, y in enumerate((1.5, 2.25, 2.625)))
    solution = solve(of(*rows), {"x": [scale, scale]})
    assert solution.status is Status.NO_FINITE_MINIMUM
    assert solution.diverging == ("x[0]",)
    assert solution.iterations < 200


def test_a_run_that_leads_away_is_ended() -> None:
    """x y = 1 with a small x: y grows for ever."""
    solution = solve(of(XY[0] * XY[1] - 1, XY[0] / 2), {"x": [1.0, 1.0]})
    assert solution.status is Status.NO_FINITE_MINIMUM
    assert solution.diverging == ("x[1]",)
    assert solution.iterations < 200


# Rounding.


@pytest.mark.parametrize("unit", [1.0, 1e-34])
def test_residuals_far_below_one_sigma_are_fitted(unit: float) -> None:
    """The photoelectric effect in joules, with a sigma of 1 J: h and W."""
    h, work, nu = 6.626e-34, 3.2e-19, np.array([5.5, 6.0, 7.0, 8.0, 9.0]) * 1e14
    noise = np.array([1, -2, 1, 1, -1]) * 1e-22
    rows = unit * XY[0] * nu - 1e-19 * XY[1] - (h * nu - work + noise)
    solution = solve(of(rows), {"x": [1e-34 / unit, 1.0]})
    assert solution.converged
    exact = np.linalg.lstsq(np.c_[nu * h, np.full(5, -work)], h * nu - work + noise, rcond=None)[0]
    in_units = solution.values["x"] * [unit / h, 1e-19 / work]
    np.testing.assert_allclose(in_units, exact, rtol=1e-9)


@pytest.mark.parametrize("scale", [1e-20, 1e-10, 1e10, 1e20])
def test_the_scale_of_a_residual_does_not_matter(scale: float) -> None:
    t = np.linspace(0, 3, 12)
    rows = XY[0] * cs.exp(-XY[1] * t) - 2 * np.exp(-1.3 * t) - 0.01 * np.sin(9 * t)
    solution, usual = (solve(of(k * rows), {"x": [1.0, 0.5]}) for k in (scale, 1.0))
    assert solution.converged
    np.testing.assert_allclose(solution.values["x"], usual.values["x"], rtol=1e-6)


def falls_beside(problem: Problem, solution: Solution) -> bool:
    """Whether the cost at `lower` is less than at the end, as the problem says."""
    assert solution.lower is not None
    return problem.linearize(solution.lower).cost < solution.cost


# Saddles and maxima.


@pytest.mark.parametrize(
    "name", few(LOCAL, ("trust-region", "levenberg-marquardt", "newton", "ipopt", "scipy-trf"))
)
def test_the_ridge_between_two_minima_is_a_saddle(name: str) -> None:
    """(x^2 - 1)^2 + y^2 from the ridge x = 0: nothing pushes to either side."""
    problem = of(XY[0] ** 2 - 1, XY[1])
    solution = SOLVERS[name].solve(problem, {"x": [0.0, 1.0]})
    if float(np.abs(solution.values["x"][0])) > 0.5:  # it left the ridge by its rounding errors
        assert solution.status is not Status.SADDLE
        return
    assert solution.status is Status.SADDLE
    assert not solution.converged
    assert "along +1 of x[0]" in solution.message
    assert "start from there" in solution.message
    assert falls_beside(problem, solution)
    assert solution.lower is not None
    again = solve(problem, solution.lower)
    assert again.converged
    np.testing.assert_allclose(np.abs(again.values["x"]), [1, 0], atol=1e-6)


@pytest.mark.parametrize("residual", [X**2 - 1, 1 - X**4, 1 + X**3, cs.cos(X)], ids=str)
def test_a_start_on_the_top_is_no_minimum(residual: cs.MX) -> None:
    """The curvature there is negative, or zero with a cost that falls all the same."""
    problem = of(residual)
    solution = solve(problem, {"x": 0.0})
    assert solution.status is Status.SADDLE
    assert falls_beside(problem, solution)


def test_units_do_not_matter() -> None:
    for unit in (1e-6, 1e6):
        problem = of((XY[0] / unit - 1) ** 2 - 1, XY[1] * unit - 3)
        assert solve(problem, {"x": [unit, 0.0]}).status is Status.SADDLE


def test_a_saddle_among_many_unknowns_is_found() -> None:
    """One of 300 unknowns sits on a ridge; all others are at their minimum."""
    x = Block("x", (300,)).symbol
    A = np.random.default_rng(0).standard_normal((400, 299))
    problem = of(A @ x[1:] - np.ones(400), 3 * (x[0] ** 2 - 1))
    solution = SOLVERS["levenberg-marquardt"].solve(problem, {"x": np.zeros(300)})
    assert solution.status is Status.SADDLE
    assert "along +1 of x[0]" in solution.message
    assert solve(problem, {"x": np.full(300, 1e-9)}).converged  # beside the ridge it goes down


# Minima that are none of these.


@pytest.mark.parametrize("offset", few([0.0, 1.0], 1))
@pytest.mark.parametrize("residual", [X**2, X**2 + 1, X**4 + 1, cs.cosh(X)], ids=str)
def test_a_flat_minimum_is_no_saddle(residual: cs.MX, offset: float) -> None:
    """The Hessian of x^4 is zero at its minimum, and rounding errors may make it negative."""
    for start in (0.0, 1e-8, 0.5):
        for name in ("levenberg-marquardt", "newton", "nlopt-lbfgs", "ipopt"):
            solution = SOLVERS[name].solve(of(residual, offset), {"x": start})
            assert solution.status not in (
                Status.SADDLE,
                Status.NO_FINITE_MINIMUM,
                Status.INSENSITIVE,
            )


def test_bounds_that_hold_the_fall_make_a_minimum() -> None:
    ridge = XY[0] ** 2 - 1, XY[1]
    held = of(*ridge, bounds={"x[0]": (0.0, 0.0)})
    assert solve(held, {"x": [0.0, 1.0]}).converged
    one_side = of(*ridge, bounds={"x[0]": (0.0, 3.0)})
    solution = solve(one_side, {"x": [0.0, 1.0]})
    assert solution.status is Status.SADDLE
    assert solution.lower is not None
    assert solution.lower["x"][0] > 0
    # x[1] is pressed against its bound, and bends down more than x[0], which is on a ridge
    bent = 1 + XY[1] - 5e6 * XY[1] ** 2
    pressed = of(XY[0] ** 2 - 1, bent, bounds={"x[1]": (0.0, 5e-8)})
    solution = solve(pressed, {"x": [0.0, 0.0]})
    assert solution.status is Status.SADDLE
    assert "along +1 of x[0]" in solution.message
    alone = of(bent, XY[0], bounds={"x[1]": (0.0, 5e-8)})
    assert solve(alone, {"x": [0.0, 0.0]}).converged


# Flat minima.


def test_directions_that_change_nothing_are_counted() -> None:
    """Two decays of equal rates: only the sum of their amplitudes matters."""
    t, b = np.linspace(0, 3, 12), Block("x", (3,)).symbol
    noise = 0.1 * np.random.default_rng(0).standard_normal(12)
    rows = (b[0] + b[1]) * cs.exp(-t) + b[2] * t - 1 - noise
    flat = solve(of(rows), {"x": [0.3, 0.1, 0.0]})
    assert flat.converged
    assert "1 direction changes no residual here, so that" in flat.message
    both = solve(of(rows + 1e-3 * (b[0] - b[1])), {"x": [0.3, 0.1, 0.0]})
    assert both.message == Status.CONVERGED.value
    b = Block("x", (4,)).symbol
    twice = solve(of(b[0] + b[1] - 1, b[2] + b[3] - 2, 0.1 * b[0] + 0.1 * b[1]), {"x": np.ones(4)})
    assert "2 directions change no residual here" in twice.message


# Counting.


def test_judging_is_counted_apart() -> None:
    problem, start = body_fit()
    solution = solve(problem, start)
    assert solution.converged
    assert 0 < solution.judging.gradient <= 2 * problem.free.size
    assert solution.judging.jacobian == solution.judging.hessian == 0
    assert solution.evaluations.gradient == 0
    exact = solve(*decay(noise=0.0))
    assert exact.judging.total == 0  # no cost is left that could fall


# Costs that fall for ever.

ENDLESS = {
    "exp(-x)": (of(cs.exp(-X)), 0.0),
    "exp(-x) above 1": (of(cs.exp(-X), cs.MX(1.0)), 0.0),
    "1 / x": (of(1 / X, cs.MX(1.0)), 1.0),
    "x y = 1, y small": (of(XY[0] * XY[1] - 1, XY[1]), [1.0, 1.0]),
}


@pytest.mark.parametrize("name", few(["levenberg-marquardt", "newton", "nlopt-lbfgs", "ipopt"], 1))
@pytest.mark.parametrize("problem", list(ENDLESS))
def test_a_cost_that_falls_for_ever_is_no_minimum(problem: str, name: str) -> None:
    of_it, start = ENDLESS[problem]
    solution = SOLVERS[name].solve(of_it, {"x": start})
    assert solution.status is Status.NO_FINITE_MINIMUM
    assert solution.diverging[0] in ("x", "x[0]")
    assert f"as unknowns ({solution.diverging[0]} = " in solution.message
    assert "give them a prior" in solution.message
    assert not solution.converged


def test_what_judging_raises_leaves_the_best_point(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_room(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr(EndPoint, "gradient", no_room)
    with Run("stalled", GaussNewton(), *decay(), None) as run:
        run.linearize(run.x)
        run.stall()
    assert run.solution().status is Status.STALLED


def test_a_far_minimum_is_finite() -> None:
    """The unknown grows a million times, and the run is cut off before it arrives."""
    for most in (6, 20, 200):
        for name in ("levenberg-marquardt", "steepest-descent", "newton", "nlopt-lbfgs"):
            solver = replace(SOLVERS[name], max_iterations=most)
            for residual in (cs.log(X) - cs.log(1e6), (X / 1e6) ** 2 - 1):
                assert solver.solve(of(residual), {"x": 1.0}).status is not Status.NO_FINITE_MINIMUM


def test_a_prior_gives_a_cost_that_falls_for_ever_a_minimum() -> None:
    """With a prior on what runs off, every one of these has a minimum."""
    for problem, start in ENDLESS.values():
        unknown = X if np.shape(start) == () else XY
        prior = residuals.gaussian(unknown, mean=np.ones(np.shape(start)), covariance=1e4)
        both = Problem((*problem.residuals, prior), ("x",))
        assert solve(both, {"x": start}).converged
