"""The table of NLopt's algorithms, held against what they do."""

import casadi as cs
import nlopt
import numpy as np
import pytest

from tests.solvers.problems import rosenbrock
from tests.tiers import few
from workbench import Block, Nlopt, Problem, Residual, Status
from workbench.errors import NotSupported
from workbench.solvers import Boxes, Derivative
from workbench.solvers.nlopt import ALGORITHMS, NloptObjective
from workbench.solvers.run import Run

EACH = pytest.mark.parametrize("name", few(ALGORITHMS, ("LD_LBFGS", "LN_BOBYQA", "LD_MMA")))
BOX = {"x": (np.array([-2.0, -1.0]), np.array([0.7, 3.0]))}  # the minimum of the valley is outside
START = {"x": np.array([-1.2, 1.0])}
COST = 0.5 * 0.3**2  # at (0.7, 0.49)


def boxed() -> Problem:
    return Problem(rosenbrock()[0].residuals, ("x",), BOX)


def test_table_holds_the_algorithms_of_nlopt() -> None:
    """But for what is no algorithm of its own (AUGLAG) and what is not implemented."""
    there = {name for name in dir(nlopt) if name.startswith(("GN_", "GD_", "LN_", "LD_", "G_"))}
    left_out = {name for name in there if "AUGLAG" in name or name == "LD_LBFGS_NOCEDAL"}
    aliases = {"GN_MLSL", "GN_MLSL_LDS", "GD_MLSL", "GD_MLSL_LDS"}  # G_MLSL with a fixed `local`
    assert set(ALGORITHMS) == there - left_out - aliases


@EACH
def test_derivatives_are_asked_for_by_those_who_need_them(name: str) -> None:
    problem = rosenbrock()[0] if ALGORITHMS[name].bounds is Boxes.REFUSED else boxed()
    counts = Nlopt(name, max_evaluations=150).solve(problem, START).evaluations
    assert (counts.gradient > 0) is (ALGORITHMS[name].derivative is Derivative.GRADIENT)
    assert counts.hessian == 0
    assert counts.total <= 150


def test_bounds_may_be_nearer_than_the_usual_first_step() -> None:
    problem = Problem(boxed().residuals, ("x",), {"x": ([0.0, 0.0], [0.05, 1.0])})
    solution = Nlopt("LN_BOBYQA").solve(problem, {"x": np.array([0.01, 0.5])})
    np.testing.assert_allclose(solution.values["x"], [0.05, 0.0025], atol=1e-4)


@EACH
def test_bounds_are_taken_refused_or_needed(name: str) -> None:
    abilities = ALGORITHMS[name]
    half = Problem(boxed().residuals, ("x",), {"x": ([-2.0, -1.0], [0.7, np.inf])})
    if abilities.bounds is Boxes.REFUSED:
        with pytest.raises(NotSupported, match="takes no bounds"):
            Nlopt(name).solve(boxed(), START)
        return
    if abilities.bounds is Boxes.NEEDED:
        with pytest.raises(NotSupported, match=r"between bounds, but x\[1\] does not have two"):
            Nlopt(name).solve(half, START)
    solution = Nlopt(name, max_evaluations=3000, max_seconds=5.0).solve(boxed(), START)
    for iterate in (*solution.trace, solution):
        assert (iterate.values["x"] >= BOX["x"][0]).all()
        assert (iterate.values["x"] <= BOX["x"][1]).all()
    assert solution.cost <= solution.trace[0].cost
    if name != "LN_PRAXIS":  # takes bounds, and does badly with them, as its manual says
        assert solution.cost < COST + (0.1 if abilities.is_global else 1e-4)


def test_mlsl_searches_several_minima() -> None:
    """1/2 (x^2 - 1)^2 and a slope: the start is in the wrong valley."""
    x = Block("x").symbol
    tilted = Residual("tilted", cs.vertcat(x**2 - 1, 0.3 * (x - 1)), 1.0)
    problem = Problem((tilted,), ("x",), {"x": (-2.0, 2.0)})
    start = {"x": np.array(-1.0)}
    assert Nlopt("LD_LBFGS").solve(problem, start).values["x"] < 0
    solution = Nlopt("G_MLSL_LDS", max_evaluations=500).solve(problem, start)
    assert solution.values["x"] == pytest.approx(1.0, abs=1e-3)
    assert solution.status in (Status.MAX_EVALUATIONS, Status.CONVERGED)


def test_nlopt_asking_at_nan_ends_the_run() -> None:
    """MMA asks for one after some nine thousand evaluations of the experiment `landmarks`."""
    solver = Nlopt("LD_MMA")
    with Run("nlopt LD_MMA", solver, rosenbrock()[0], START, None) as run:
        optimizer = nlopt.opt(nlopt.LD_MMA, 2)
        objective = NloptObjective(run, run.begin(), np.ones(2), optimizer, solver.abilities)
        assert np.isfinite(objective.cost(np.full(2, np.nan), np.zeros(2)))
        assert objective.error is not None
        raise objective.error
    solution = run.solution()
    assert solution.status is Status.STALLED
    assert (
        "broke down, for it asks for the cost at a point that is not a number" in solution.message
    )
    assert solution.evaluations.gradient == 0
    np.testing.assert_array_equal(solution.values["x"], START["x"])
