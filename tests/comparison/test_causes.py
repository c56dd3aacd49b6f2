"""Why a run ended above the lowest cost: curvature and causes where both are known."""

import casadi as cs
import numpy as np
import pytest

from tests.comparison.problems import SLIDE, Liar, lost_well, slide
from workbench import Block, LevenbergMarquardt, Problem, Residual, compare
from workbench.comparison import Budget, Cause, TargetOutcome
from workbench.comparison.curvature import SADDLE, least_curvature
from workbench.comparison.end_analysis import EndAnalysis, analyse_ends
from workbench.comparison.words import advice
from workbench.experiments import Experiment, Setup, find
from workbench.problem import Constraint


def _least(problem: Problem, *x: float) -> float:
    return least_curvature(problem, np.array(x), np.zeros(0))


def test_curvature_is_the_least_eigenvalue_of_the_whitened_hessian_by_the_largest() -> None:
    x = Block("x", (2,))
    bowl = Problem([Residual("r", cs.vertcat(x.symbol[0], 3 * x.symbol[1]), 1.0)], ["x"])
    assert _least(bowl, 0.0, 0.0) == pytest.approx(1.0)  # whitened, all directions curve alike
    a, b = x.symbol[0], x.symbol[1]
    product = Problem([Residual("r", cs.vertcat(a * b - 1), 1.0)], ["x"])
    assert _least(product, 0.0, 0.0) == pytest.approx(-1.0)  # H = [[0, -1], [-1, 0]]
    assert _least(product, 2.0, 0.5) == pytest.approx(0.0, abs=1e-8)  # a b = 1 is a curve
    wells = slide().problem
    low, top = _least(wells, 0.0, lost_well()), _least(wells, 0.0, 0.0)
    assert low > 0.01
    assert top < SADDLE  # between two wells


def test_curvature_of_many_unknowns_is_that_of_few() -> None:
    """More unknowns than all eigenvalues are computed of: Lanczos' method finds the same."""
    rng = np.random.default_rng(0)
    x = Block("x", (250,))
    weights = np.concatenate([[0.3], rng.uniform(0.5, 1.0, 249)])
    s = x.symbol
    for turned, expected in ((0.0, None), (1.0, -1.0)):
        rest = cs.vertcat(*(float(w) * (s[i] + s[i + 1]) for i, w in enumerate(weights[:-1])))
        first = cs.vertcat(s[0] * s[249] - turned)
        problem = Problem([Residual("r", cs.vertcat(rest, 20 * first), 1.0)], ["x"])
        H = np.array(problem.hessian(np.zeros(250), np.zeros(0)))
        scale = problem.linearize_at(np.zeros(250), np.zeros(0)).column_norms
        scale = np.where(scale > 0, scale, 1.0)
        values = np.linalg.eigvalsh(H / scale[:, None] / scale)
        found = _least(problem, *np.zeros(250))
        assert found == pytest.approx(values.min() / abs(values).max(), abs=2e-5)
        assert (found < SADDLE) == (expected is not None)


def test_bounds_and_constraints_leave_only_the_free_directions() -> None:
    x = Block("x", (2,))
    a, b = x.symbol[0], x.symbol[1]
    hill = cs.vertcat(b, a**2 - 4)  # along a, zero is the top of a hill
    free = Problem([Residual("r", hill, 1.0)], ["x"])
    assert _least(free, 0.0, 0.0) < SADDLE
    bounded = Problem([Residual("r", hill, 1.0)], ["x"], bounds={"x": ([0.0, -1], [1.0, 1])})
    assert _least(bounded, 0.0, 0.0) == pytest.approx(1.0)
    held = Problem(
        [Residual("r", hill, 1.0)], ["x"], constraints=[Constraint("a = 0", a, lower=0, upper=0)]
    )
    assert _least(held, 0.0, 0.0) == pytest.approx(1.0)
    # the nearest and the farthest point of a circle: its curvature decides
    point = Residual("r", cs.vertcat(a - 2, b), 1.0)
    circle = Constraint("circle", a**2 + b**2, lower=1, upper=1)
    round_it = Problem([point], ["x"], constraints=[circle])
    assert _least(round_it, 1.0, 0.0) > 0
    assert _least(round_it, -1.0, 0.0) < SADDLE


def saddle(start: int = 0) -> Setup:
    """The shape space of triangles from zero, a saddle, or from a random point."""
    return find("triangles-shapes", {"start": start}).setup()


def test_an_end_at_a_saddle_and_one_in_another_well_are_told_apart() -> None:
    stuck = saddle()
    solution = LevenbergMarquardt().solve(stuck.problem, stuck.start)
    end = stuck.problem.free.pack(solution.values)
    found = analyse_ends(stuck, (end,))
    assert found.curvatures[0] < SADDLE
    wells = slide()
    found = analyse_ends(wells, (np.array([0.0, 1.0]), np.array([0.0, lost_well()])))
    assert all(curvature > 0 for curvature in found.curvatures)
    again = EndAnalysis.of(found.stored())
    assert again.curvatures == found.curvatures
    assert again.lost_ranks == found.lost_ranks == (0, 0)
    assert again.hidden == found.hidden == (0, 0)


def test_each_end_of_a_comparison_has_its_cause() -> None:
    solvers = {"levenberg-marquardt": LevenbergMarquardt(), "stays": Liar()}
    found = compare([SLIDE], solvers, seeds=3)
    assert found.causes["slide, start 1", "levenberg-marquardt"] is Cause.SECOND_BASIN
    assert ("slide, start 0", "levenberg-marquardt") not in found.causes
    stayed = {why for (_, solver), why in found.causes.items() if solver == "stays"}
    assert stayed == {Cause.STOPPED_EARLY}
    short = compare([SLIDE], solvers, budget=Budget(max_evaluations=3))
    assert short.causes["slide, start 0", "levenberg-marquardt"] is Cause.LIMIT


def test_a_stop_at_a_saddle_is_counted_as_one() -> None:
    """Both wells of the slide are known from other starts; the top between them is a saddle."""
    ridge = Experiment("ridge", _ridge, "", {})
    found = compare([ridge], {"lm": LevenbergMarquardt(), "stays": Liar()}, seeds=2)
    assert {run: record.claim for run, record in found.records.items() if run[1] == "lm"} == {
        ("ridge, start 0", "lm"): "SADDLE",
        ("ridge, start 1", "lm"): "CONVERGED",
    }
    for solver in ("lm", "stays"):  # one says so, and the other does not
        assert found.outcomes["ridge, start 0", solver] is TargetOutcome.SADDLE
        assert found.causes["ridge, start 0", solver] is Cause.SADDLE
        assert not found.delivered("ridge, start 0", solver, 0.9)
    assert found.counted("lm")[TargetOutcome.REACHED] == 1
    assert any("ends at a saddle point" in said for said in advice(found))


def _ridge(start: int = 0) -> Setup:
    """A start on the ridge between two minima, and one beside it."""
    x = Block("x", (2,))
    rows = cs.vertcat(x.symbol[0] ** 2 - 1, x.symbol[1], 1)
    problem = Problem([Residual("r", rows, 1.0)], ["x"])
    return Setup(problem, {"x": np.array([0.5 * start, 0.0])}, "is the ridge left?")
