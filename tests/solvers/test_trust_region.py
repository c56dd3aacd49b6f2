"""The default solver: steps as long as the trust region, and a region that follows the gain."""

import itertools

import casadi as cs
import numpy as np
import pytest
from scipy.stats import ortho_group

import workbench.solvers.trust_region as module
from tests.solvers.problems import decay, line, rosenbrock
from tests.tiers import few
from workbench import (
    Block,
    LevenbergMarquardt,
    Linearization,
    Newton,
    Problem,
    Residual,
    TrustRegion,
)
from workbench.arrays import Array
from workbench.errors import BadArgument
from workbench.problem.steps import Step, automatic
from workbench.solvers.trust_region import LONGEST_STEP, SHORTEST_STEP, box_step, step_within


def graded(seed: int, n: int, weakest: float) -> Linearization:
    """A linear model whose singular values fall from 1 to `weakest`."""
    rng = np.random.default_rng(seed)
    U = ortho_group.rvs(n + 3, random_state=rng)[:, :n]
    V = ortho_group.rvs(n, random_state=rng)
    return Linearization(rng.normal(size=n + 3), U * np.geomspace(1, weakest, n) @ V.T)


def damped_in(here: Linearization, counted: list[float]):
    n = here.shape[1]

    def damped(damping: float) -> Step | None:
        counted.append(damping)
        far = np.full(n, np.inf)
        return box_step(here, damping, np.ones(n), -far, far, automatic)

    return damped


@pytest.mark.parametrize("weakest", [0.5, 1e-5])
@pytest.mark.parametrize("share", [0.9, 0.3, 1e-5])
@pytest.mark.parametrize("first", few([0.0, 1e-8, 1e6], 1))
def test_a_step_is_the_best_of_its_length(weakest: float, share: float, first: float) -> None:
    """By the conditions of the constrained minimum: (J'J + damping I) p = -J'r, and the length."""
    here = graded(0, 6, weakest)
    radius = share * float(np.linalg.norm(here.step()))
    counted: list[float] = []
    steepness = float(np.linalg.norm(here.gradient))
    step, damping = step_within(radius, damped_in(here, counted), steepness, first)
    assert step is not None
    assert damping > 0
    assert SHORTEST_STEP * radius <= np.linalg.norm(step.p) <= LONGEST_STEP * radius
    np.testing.assert_allclose(here.normal @ step.p + damping * step.p, -here.gradient, atol=1e-10)
    assert len(counted) <= 12


@pytest.mark.parametrize("start", [[-1.2, 1.0], [5.0, -7.0], [-30.0, 20.0]])
def test_the_cost_falls_within_the_region(start: list[float]) -> None:
    problem, _ = rosenbrock()
    solution = TrustRegion().solve(problem, {"x": np.array(start)})
    assert solution.converged
    np.testing.assert_allclose(solution.values["x"], [1, 1], atol=1e-5)
    assert (np.diff([one.cost for one in solution.trace]) < 0).all()
    lengths = [one.step_norm for one in solution.trace[1:]]
    assert lengths[0] <= LONGEST_STEP * np.linalg.norm(start)
    bent = 1 + module.LARGEST_ACCELERATION / 2
    for before, after in itertools.pairwise(lengths):
        assert after <= 2 * LONGEST_STEP * bent * before


@pytest.mark.parametrize("radius", [1e-3, 0.1, 1.0])
def test_the_first_step_has_the_first_radius(radius: float) -> None:
    solution = TrustRegion(first_radius=radius, max_iterations=1).solve(*line())
    assert SHORTEST_STEP * radius <= solution.trace[1].step_norm <= LONGEST_STEP * radius


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.inf, np.nan])
def test_options_out_of_their_range_are_refused(wrong: float) -> None:
    with pytest.raises(BadArgument, match="first_radius of TrustRegion must be finite and above 0"):
        TrustRegion(first_radius=wrong)
    with pytest.raises(BadArgument, match="first_damping of LevenbergMarquardt must be finite"):
        LevenbergMarquardt(first_damping=wrong)
    for name in ("max_iterations", "max_evaluations", "max_seconds", "gradient_tolerance"):
        with pytest.raises(BadArgument, match=f"{name} .*must be .* above"):
            Newton(**{name: wrong or -1e-9 if name != "max_seconds" else -1.0})


def test_a_linear_problem_takes_one_step_within_the_radius() -> None:
    problem, start = line()
    solution = TrustRegion(first_radius=1e3).solve(problem, start)
    assert solution.iterations == 1
    assert solution.trace[1].damping == 0


def test_convergence_is_quadratic_where_the_residual_vanishes() -> None:
    problem, start = decay(noise=0.0)
    solution = TrustRegion(gradient_tolerance=1e-14).solve(problem, start)
    lengths = [one.step_norm for one in solution.trace[-4:]]
    orders = [np.log(b) / np.log(a) for a, b in itertools.pairwise(lengths) if a < 0.1]
    assert orders
    assert min(orders) > 1.5


def test_the_first_step_does_not_leap_into_a_desert() -> None:
    """The Gauss-Newton step makes the peak so narrow that it falls between the data."""
    t = np.linspace(-1, 1, 21)
    x = Block("x", (2,)).symbol
    peak = cs.exp(-(((t - x[0]) / x[1]) ** 2)) - np.exp(-((t / 0.2) ** 2))
    problem = Problem((Residual("peak", peak, 1.0),), ("x",))
    start = {"x": np.array([-0.1, 1.0])}
    leap = {"x": start["x"] + problem.linearize(start).step()}
    assert problem.linearize(leap).column_norms.max() < 1e-60
    solution = TrustRegion().solve(problem, start)
    assert solution.converged
    np.testing.assert_allclose(np.abs(solution.values["x"]), [0, 0.2], atol=1e-6)


def banana(n: int) -> tuple[Problem, dict[str, Array]]:
    """The cube function in n unknowns (Moré and Wild 2009): a long curved valley."""
    x = Block("x", (n,)).symbol
    rows = [x[0] - 1, *(10 * (x[i] - x[i - 1] ** 3) for i in range(1, n))]
    problem = Problem((Residual("cube", cs.vertcat(*rows), 1.0),), ("x",))
    return problem, {"x": np.full(n, 0.5)}


def test_geodesic_acceleration_shortens_the_way_along_a_curved_valley(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem, start = banana(6)
    bent = TrustRegion().solve(problem, start)
    monkeypatch.setattr(
        module, "geodesic_acceleration", lambda run, x, here, p, *_: np.zeros_like(p)
    )
    straight = TrustRegion().solve(problem, start)
    assert bent.converged
    assert bent.evaluations.total < straight.evaluations.total
    np.testing.assert_allclose(bent.values["x"], 1, atol=1e-4)


def test_dependent_columns_do_no_harm() -> None:
    x = Block("x", (3,)).symbol
    blind = Problem((Residual("sum", cs.exp(x[0] + x[1]) - 2.0, 1.0),), ("x",))
    solution = TrustRegion().solve(blind, {"x": np.zeros(3)})
    assert solution.converged
    half = np.log(2) / 2
    np.testing.assert_allclose(solution.values["x"], [half, half, 0], atol=1e-6)


@pytest.mark.parametrize("start", [1e-300, 8e-17, -1e-12, 1e-9, 0.0])
def test_a_start_that_is_nearly_zero_is_left(start: float) -> None:
    x = Block("x", (1,))
    problem = Problem([Residual("r", x.symbol + 1, 1.0)], ["x"])
    solution = TrustRegion().solve(problem, {"x": np.array([start])})
    assert solution.status.name == "CONVERGED"
    assert solution.values["x"] == pytest.approx(-1)
    assert solution.iterations <= 2
