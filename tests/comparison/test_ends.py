"""Why runs end above the lowest cost: basins, slides, curvature and outcomes that are known."""

import casadi as cs
import numpy as np
import pytest

from tests.comparison.made_up import in_this_process
from tests.comparison.problems import SLIDE, STARTS, Liar, angle, lost_well, slide
from workbench import Block, LevenbergMarquardt, Problem, Residual, compare
from workbench.comparison import Budget, TargetOutcome
from workbench.comparison.advice import advice
from workbench.comparison.ends import (
    SADDLE,
    EndAnalysis,
    analyse_ends,
    basins,
    explain,
    least_curvature,
)
from workbench.experiments import Experiment, Setup, find
from workbench.problem import Constraint
from workbench.solvers import SOLVERS


def test_ends_go_to_the_wells_they_lead_to() -> None:
    setup = slide()
    fixed = setup.problem.split(setup.start)[1]
    ends = [np.array(x) for x in (*STARTS, (0.0, 1.0), (0.0, lost_well()), (0.1, -0.9))]
    found, where = basins(setup.problem, fixed, ends)
    assert where == (0, 1, 0, 0, 1, 1)
    np.testing.assert_allclose([b.x for b in found], [[0, 1], [0, lost_well()]], atol=1e-7)
    assert found[0].cost < 1e-20 < found[1].cost
    again, reverse = basins(setup.problem, fixed, ends[::-1])
    assert reverse == where[::-1]
    np.testing.assert_allclose([b.cost for b in again], [b.cost for b in found], atol=1e-20)


def test_full_turns_are_one_basin() -> None:
    setup = angle()
    fixed = setup.problem.split(setup.start)[1]
    turns = [np.array([0.2 + 2 * np.pi * k]) for k in (0, 1, -3)]
    found, where = basins(setup.problem, fixed, turns)
    assert where == (0, 0, 0)
    assert len(found) == 1
    other, _ = basins(setup.problem, fixed, [*turns, np.array([np.arctan2(0.5, 1) + np.pi])])
    assert len(other) == 2  # the top of the hill: stationary, and dearer


def test_slide_is_explained_by_its_direction() -> None:
    setup = slide()
    problem, fixed = setup.problem, setup.problem.split(setup.start)[1]
    found, _ = basins(problem, fixed, [np.array(x) for x in STARTS])
    told = explain(problem, fixed, found[1], found[0])
    assert told.length == pytest.approx(1 - lost_well())
    assert told.share == pytest.approx(1.0)
    (part,) = told.components
    assert "x[b]" in part.name
    assert part.length == pytest.approx(1 - lost_well())
    assert part.change == pytest.approx(0.2, rel=0.05)  # |d(hardly seen)/db|
    top = 0.5 * (0.1**2 + 0.02**2)  # near b = 0
    assert told.ridge == pytest.approx(top - found[1].cost, rel=0.05)
    assert "100% of the way" in str(told)
    assert "x[b]" in str(told)


def test_other_minima_are_no_slides() -> None:
    setup = angle()
    problem, fixed = setup.problem, setup.problem.split(setup.start)[1]
    top = np.arctan2(0.5, 1) + np.pi
    found, _ = basins(problem, fixed, [np.array([0.2]), np.array([top])])
    told = explain(problem, fixed, found[1], found[0])
    assert "not a slide" in str(told)
    assert told.ridge == 0  # it only falls from there


@pytest.mark.thorough
def test_body_in_one_image_slides_along_turns() -> None:
    setup = find("balance", {"held_out": ["cam02", "cam03", "cam04"]}).setup()
    solutions = [
        SOLVERS[name].solve(setup.problem, setup.start)
        for name in ("levenberg-marquardt", "gauss-newton")
    ]
    found = analyse_ends(setup, tuple(setup.problem.free.pack(s.values) for s in solutions))
    assert found.where == (1, 0)
    told = found.explanations[1]
    assert told.cost - told.best == pytest.approx(solutions[0].cost - solutions[1].cost, rel=1e-3)
    assert 0.5 < told.share <= 1
    assert all(part.change < 2 for part in told.components)  # sigmas for a radian
    assert "turn" in told.components[0].name.partition(":")[0]


def test_ends_that_are_not_finite_have_no_basin() -> None:
    setup = slide()
    found = analyse_ends(setup, (np.array([np.inf, 0.0]), np.array([0.0, 1.0])))
    assert found.where[1] == 0
    assert not found.explanations


def _least(problem: Problem, *x: float) -> float:
    return least_curvature(problem, np.array(x), np.zeros(0))


def test_curvature_is_the_least_whitened_eigenvalue() -> None:
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


@pytest.mark.thorough
def test_curvature_of_many_unknowns_agrees_with_eigenvalues() -> None:
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


def test_curvature_reads_only_free_directions() -> None:
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


def test_saddles_are_told_from_other_wells() -> None:
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


def test_ends_of_a_comparison_have_outcomes() -> None:
    solvers = {"levenberg-marquardt": LevenbergMarquardt(), "stays": Liar()}
    with in_this_process():
        found = compare([SLIDE], solvers, seeds=3)
        short = compare([SLIDE], solvers, budget=Budget(max_evaluations=3))
    outcomes = [found.outcomes[f"slide, start {k}", "levenberg-marquardt"] for k in (0, 1)]
    assert outcomes == [TargetOutcome.REACHED, TargetOutcome.OTHER_BASIN]
    assert found.outcome_counts("stays") == {TargetOutcome.FALSE_CLAIM: 3}
    ended = short.outcomes["slide, start 0", "levenberg-marquardt"]
    assert ended is TargetOutcome.OUT_OF_BUDGET


def test_stops_at_saddles_are_counted() -> None:
    """Both wells of the slide are known from other starts; the top between them is a saddle."""
    ridge = Experiment("ridge", _ridge, "", {})
    with in_this_process():
        found = compare([ridge], {"lm": LevenbergMarquardt(), "stays": Liar()}, seeds=2)
    assert {run: record.claim for run, record in found.records.items() if run[1] == "lm"} == {
        ("ridge, start 0", "lm"): "SADDLE",
        ("ridge, start 1", "lm"): "CONVERGED",
    }
    for solver in ("lm", "stays"):  # one says so, and the other does not
        assert found.outcomes["ridge, start 0", solver] is TargetOutcome.SADDLE
        assert not found.returned_within("ridge, start 0", solver, 0.9)
    assert found.outcome_counts("lm")[TargetOutcome.REACHED] == 1
    assert any("ends at a saddle point" in said for said in advice(found))


def _ridge(start: int = 0) -> Setup:
    """A start on the ridge between two minima, and one beside it."""
    x = Block("x", (2,))
    rows = cs.vertcat(x.symbol[0] ** 2 - 1, x.symbol[1], 1)
    problem = Problem([Residual("r", rows, 1.0)], ["x"])
    return Setup(problem, {"x": np.array([0.5 * start, 0.0])}, "is the ridge left?")
