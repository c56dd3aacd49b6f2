"""Ends that are no minimum, and minima that look as if they were none."""

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

from tests.solvers.problems import body_fit, decay
from tests.tiers import few
from workbench import SOLVERS, Block, Problem, Residual, Solution, Status, residuals, solve
from workbench.geometry.rotation import rodrigues
from workbench.problem.bounds import Bounds
from workbench.residuals.kernels import geman_mcclure

LOCAL = [name for name in SOLVERS if name not in ("nlopt-mlsl", "nlopt-bobyqa")]
X, XY = Block("x").symbol, Block("x", (2,)).symbol


def of(*rows: cs.MX, bounds: Bounds | None = None) -> Problem:
    return Problem((Residual("fit", cs.vertcat(*rows), 1.0),), ("x",), bounds)


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


def rigid(points: np.ndarray, observed: np.ndarray) -> Problem:
    turned = rodrigues(Block("turn", (3,)).symbol) @ cs.DM(points.T)
    return Problem((Residual("fit", cs.vec(turned - cs.DM(observed.T)), 0.01),), ("turn",))


def test_a_rigid_fit_off_by_pi_is_a_saddle() -> None:
    """The gradient vanishes there for points on the axes."""
    points = np.vstack([np.diag([3.0, 2.0, 1.0]), -np.diag([3.0, 2.0, 1.0])])
    for axis in np.eye(3):
        half = 2 * np.outer(axis, axis) - np.eye(3)  # half a turn
        problem = rigid(points, points @ half.T)
        solution = solve(problem, {"turn": np.zeros(3)})
        assert solution.status is Status.SADDLE
        assert "turn" in solution.message
        assert solution.lower is not None
        again = solve(problem, solution.lower)
        assert again.converged
        assert again.cost < 1e-12


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
            assert solution.status not in (Status.SADDLE, Status.VALLEY, Status.LOST)


def test_a_minimum_with_a_large_residual_is_no_saddle() -> None:
    """Data far from any model: the second-order part of the Hessian is as large as the first."""
    rng = np.random.default_rng(3)
    for size in (1.0, 100.0):
        t, noise = np.linspace(0, 3, 30), size * rng.standard_normal(30)
        b = Block("x", (3,)).symbol
        problem = of(b[0] * cs.sin(b[1] * t + b[2]) - noise)
        for start in rng.standard_normal((4, 3)):
            solution = solve(problem, {"x": start})
            x, fixed = problem.split(solution.values)
            H = np.asarray(problem.hessian(x, fixed))
            lengths = np.sqrt(np.abs(np.diag(H)))
            least = float(np.linalg.eigvalsh(H / np.outer(lengths, lengths))[0])
            if solution.converged:
                assert least > -1e-6
            if solution.status is Status.SADDLE:
                assert least < 1e-6


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


def test_robust_ridges_are_told_from_minima() -> None:
    """Between two groups of equal weight, the kernel has a ridge in their middle."""

    def groups(at: float) -> Problem:
        rows = cs.vertcat(*[X - one for one in (-at, -at, at, at)])
        return Problem((Residual("fit", rows, 1.0, kernel=geman_mcclure),), ("x",))

    near, far = solve(groups(0.1), {"x": 0.0}), solve(groups(2.0), {"x": 0.0})
    assert near.converged
    assert far.status is Status.SADDLE
    assert falls_beside(groups(2.0), far)


# Flat minima.


def test_a_combination_that_changes_nothing_is_named() -> None:
    """Two decays of equal rates: only the sum of their amplitudes matters."""
    t, b = np.linspace(0, 3, 12), Block("x", (3,)).symbol
    noise = 0.1 * np.random.default_rng(0).standard_normal(12)
    rows = (b[0] + b[1]) * cs.exp(-t) + b[2] * t - 1 - noise
    flat = solve(of(rows), {"x": [0.3, 0.1, 0.0]})
    assert flat.converged
    assert "the cost hardly depends on +1 of x[0] with -1 of x[1], so that" in flat.message
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


def test_a_failing_gradient_changes_no_judgement() -> None:
    problem = of(X**2 - 1)
    original, calls = problem.cost_and_gradient, []

    def failing(x: np.ndarray, fixed: np.ndarray) -> tuple[float, np.ndarray]:
        calls.append(x)
        raise RuntimeError("no gradient")

    vars(problem)["cost_and_gradient"] = failing
    assert solve(problem, {"x": 0.0}).status is Status.CONVERGED
    assert calls
    vars(problem)["cost_and_gradient"] = original
    assert solve(problem, {"x": 0.0}).status is Status.SADDLE


# Valleys without end.

ENDLESS = {
    "exp(-x)": (of(cs.exp(-X)), 0.0),
    "exp(-x) above 1": (of(cs.exp(-X), cs.MX(1.0)), 0.0),
    "1 / x": (of(1 / X, cs.MX(1.0)), 1.0),
    "x y = 1, y small": (of(XY[0] * XY[1] - 1, XY[1]), [1.0, 1.0]),
}


@pytest.mark.parametrize("name", few(["levenberg-marquardt", "newton", "nlopt-lbfgs", "ipopt"], 1))
@pytest.mark.parametrize("problem", list(ENDLESS))
def test_a_valley_without_end_is_no_minimum(problem: str, name: str) -> None:
    of_it, start = ENDLESS[problem]
    solution = SOLVERS[name].solve(of_it, {"x": start})
    assert solution.status is Status.VALLEY
    assert solution.running[0] in ("x", "x[0]")
    assert f"grow without limit ({solution.running[0]} = " in solution.message
    assert "give them a prior" in solution.message
    assert not solution.converged


def test_separable_data_have_no_logistic_fit() -> None:
    """The steeper the curve, the better it fits two groups that do not overlap."""
    t = np.r_[-2.0:-0.5:8j, 0.5:2.0:8j]
    for labels, separable in ((t > 0, True), ((t > 0) ^ (np.abs(t) < 0.8), False)):
        problem = of(1 / (1 + cs.exp(-XY[0] * t - XY[1])) - labels)
        solution = solve(problem, {"x": [0.1, 0.0]})
        endless = (Status.VALLEY, Status.LOST)  # the shift of the curve goes blind in the end
        assert (solution.status in endless) == separable
        assert separable or solution.converged
    bounded = of(1 / (1 + cs.exp(-XY[0] * t - XY[1])) - (t > 0), bounds={"x": (-20.0, 20.0)})
    assert solve(bounded, {"x": [0.1, 0.0]}).converged


def test_a_far_minimum_is_no_valley() -> None:
    """The unknown grows a million times, and the run is cut off before it arrives."""
    for most in (6, 20, 200):
        for name in ("levenberg-marquardt", "steepest-descent", "newton", "nlopt-lbfgs"):
            solver = replace(SOLVERS[name], max_iterations=most)
            for residual in (cs.log(X) - cs.log(1e6), (X / 1e6) ** 2 - 1):
                assert solver.solve(of(residual), {"x": 1.0}).status is not Status.VALLEY


# Unknowns that go blind.


def peak() -> tuple[Problem, dict[str, list[float]]]:
    """A peak that the first steps carry away from the data."""
    t = np.linspace(-3, 3, 13)
    return of(XY[1] * cs.exp(-((t - XY[0]) ** 2)) - np.exp(-(t**2))), {"x": [4.5, 1.0]}


@pytest.mark.parametrize("name", ["gauss-newton-full", "dogleg"])
def test_the_best_point_before_going_blind_is_returned(name: str) -> None:
    problem, start = peak()
    solution = SOLVERS[name].solve(problem, start)
    assert solution.status is Status.LOST
    assert solution.lost == ("x[0]", "x[1]")
    since = min(solution.lost_since)
    before = solution.trace[:since]
    assert solution.cost == min(iterate.cost for iterate in before)
    best = min(before, key=lambda iterate: iterate.cost)
    np.testing.assert_array_equal(solution.values["x"], best.values["x"])
    here = problem.linearize(solution.values)
    assert (here.column_norms > 1e-12).all()
    blind = problem.linearize(solution.trace[since].values)
    assert (blind.column_norms < 1e-10).any()


def test_a_prior_gives_endless_valleys_a_minimum() -> None:
    """With a prior on what runs off, every one of these has a minimum."""
    for problem, start in ENDLESS.values():
        unknown = X if np.shape(start) == () else XY
        prior = residuals.gaussian(unknown, mean=np.ones(np.shape(start)), covariance=1e4)
        both = Problem((*problem.residuals, prior), ("x",))
        assert solve(both, {"x": start}).converged
