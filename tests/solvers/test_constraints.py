"""Constraints, by every solver that takes them; the others say no."""

from dataclasses import replace
from typing import Any

import casadi as cs
import numpy as np
import pytest

from tests.bodies_made_up import random_body
from tests.solvers.problems import T, decay
from tests.tiers import few
from workbench import (
    SOLVERS,
    Block,
    Constraint,
    Nlopt,
    Problem,
    Residual,
    Solution,
    Status,
    residuals,
)
from workbench.errors import NotSupported
from workbench.solvers import Ipopt, exact_hessian
from workbench.solvers.nlopt import ALGORITHMS

X = Block("x", (2,)).symbol
SOLUTION = np.array([2.0, 1.0]) / np.sqrt(5)
BOUNDS = {"x": (-3.0, 3.0)}


def near(*constraints: Constraint) -> Problem:
    """The point nearest to (2, 1)."""
    residual = Residual("near", X - cs.DM([2.0, 1.0]), 1.0)
    return Problem((residual,), ("x",), BOUNDS, constraints=constraints)


INSIDE = Constraint("disc", cs.sumsqr(X), upper=1.0)
ON = Constraint("circle", cs.sumsqr(X), 1.0, 1.0)
OUTSIDE = Constraint("hole", cs.sumsqr(X), lower=9.0)
START = {"x": np.array([0.3, 0.4])}

LOCAL = {name: s for name, s in SOLVERS.items() if not s.abilities.is_global}
LOCAL |= {"nlopt-cobyla": Nlopt("LN_COBYLA")}
INEQUALITIES = [name for name, s in LOCAL.items() if s.abilities.inequalities]
TAKERS = ("ipopt", "sqp", "nlopt-slsqp")
EQUATIONS = [name for name, s in LOCAL.items() if s.abilities.equations]


def test_the_table_knows_who_takes_what() -> None:
    assert EQUATIONS == [
        "ipopt",
        "ipopt-exact",
        "ipopt-lbfgs",
        "sqp",
        "nlopt-slsqp",
        "nlopt-cobyla",
    ]
    assert set(INEQUALITIES) == {*EQUATIONS, "nlopt-mma", "nlopt-ccsaq"}


NEARLY = ("nlopt-ccsaq", "nlopt-cobyla")  # stop by themselves before the last digit


def assert_at_the_end(name: str, solution: Solution) -> None:
    assert solution.optimality <= (1e-5 if name in NEARLY else 1e-6)
    if name not in NEARLY:
        assert solution.status is Status.CONVERGED, (solution.status, solution.message)


@pytest.mark.parametrize("name", few(INEQUALITIES, TAKERS))
@pytest.mark.parametrize(
    ("constraint", "length"), [(INSIDE, 1.0), (OUTSIDE, 3.0)], ids=["inside", "outside"]
)
def test_inequalities_are_honoured(name: str, constraint: Constraint, length: float) -> None:
    problem = near(constraint)
    feasible = {"x": length * np.array([1.0, 0.1]) if constraint is OUTSIDE else START["x"]}
    solution = LOCAL[name].solve(problem, feasible)
    assert_at_the_end(name, solution)
    np.testing.assert_allclose(solution.values["x"], length * SOLUTION, atol=1e-5)
    assert solution.violation <= 1


@pytest.mark.parametrize("name", few(EQUATIONS, TAKERS))
def test_equations_are_honoured(name: str) -> None:
    solution = LOCAL[name].solve(near(ON), START)
    assert_at_the_end(name, solution)
    np.testing.assert_allclose(solution.values["x"], SOLUTION, atol=1e-5)
    assert solution.evaluations.constraint + solution.evaluations.jacobian > 0


@pytest.mark.parametrize("name", few(INEQUALITIES, TAKERS))
def test_a_constraint_that_is_not_in_the_way_changes_nothing(name: str) -> None:
    solution = LOCAL[name].solve(near(Constraint("disc", cs.sumsqr(X), upper=9.0)), START)
    np.testing.assert_allclose(solution.values["x"], [2.0, 1.0], atol=1e-5)
    assert solution.violation == 0


@pytest.mark.parametrize("name", few(INEQUALITIES, TAKERS))
def test_what_cannot_be_met_is_said(name: str) -> None:
    """A squared length below -1: the best point is the one that misses it least."""
    problem = near(Constraint("never", cs.sumsqr(X), upper=-1.0))
    limited: Any = replace(LOCAL[name], max_evaluations=500, max_seconds=30.0)  # type: ignore[type-var]
    solution = limited.solve(problem, START)
    assert solution.status is not Status.CONVERGED
    assert solution.violation > 1
    assert np.linalg.norm(solution.values["x"]) < np.linalg.norm(START["x"])
    if solution.status is Status.INFEASIBLE:
        assert "never" in solution.message or "constraints" in solution.message


def test_the_others_refuse() -> None:
    free = Problem(near(INSIDE).residuals, ("x",), constraints=(INSIDE,))
    for name in LOCAL.keys() - INEQUALITIES:
        with pytest.raises(NotSupported, match=r"takes no inequalities, .* has disc; use"):
            LOCAL[name].solve(free, START)


@pytest.mark.parametrize("name", ["nlopt-mma", "nlopt-ccsaq"])
def test_who_takes_inequalities_need_not_take_equations(name: str) -> None:
    with pytest.raises(NotSupported, match="takes no equations, but the problem has circle; use"):
        LOCAL[name].solve(near(ON), START)


def test_a_feasible_point_is_better_than_a_cheap_one() -> None:
    """The start costs nothing, but is not allowed."""
    start = {"x": np.array([2.0, 1.0])}
    solution = LOCAL["ipopt"].solve(near(INSIDE), start)
    assert solution.trace[0].cost == 0 < solution.cost
    assert solution.violation <= 1


def test_nan_in_a_constraint_is_survived_or_told() -> None:
    root = Constraint("root", cs.sqrt(X[0]), upper=1.0)
    for name in INEQUALITIES:
        solution = LOCAL[name].solve(near(root), START)
        if solution.converged:
            np.testing.assert_allclose(solution.values["x"], [1.0, 1.0], atol=1e-5)
        else:
            assert solution.status in (Status.NOT_FINITE, Status.STALLED)
        assert np.isfinite(solution.values["x"]).all()


def test_a_body_stays_above_the_floor() -> None:
    """Vertices are asked for that are below the floor; no joint must follow them."""
    body = random_body(3, n_vertices=15, n_joints=3, n_betas=2)
    symbols = [block.symbol for block in body.blocks()]
    joints = body.joint_points(*symbols)
    observed = Block("observed", (15, 3), "m").symbol
    problem = Problem(
        (
            residuals.vertices(body.points(*symbols), observed, sigma=0.02),
            residuals.gaussian(symbols[0], covariance=0.25),
        ),
        ("pose", "trans"),
        constraints=(Constraint("floor", joints.symbol[1, :].T, 0.0, unit="m", points=(joints,)),),
    )
    low = body.vertices(trans=np.array([0.0, -0.05 - body.joints()[:, 1].min(), 0.0]))
    start = body.start() | {"observed": low, "trans": np.array([0.0, 1.0, 0.0])}
    for name in ("ipopt", "sqp", "nlopt-slsqp"):
        solution = LOCAL[name].solve(problem, start)
        assert solution.converged, solution.message
        height = body.joints(**(solution.values | {"betas": start["betas"]}))[:, 1]
        assert height.min() == pytest.approx(0, abs=2e-6)


@pytest.mark.thorough
@pytest.mark.parametrize("name", [n for n, a in ALGORITHMS.items() if a.inequalities])
def test_nlopts_own_come_near(name: str) -> None:
    """The global ones too, as far as they come."""
    solution = Nlopt(name, max_evaluations=3000, max_seconds=5.0).solve(near(INSIDE), START)
    assert solution.violation <= 1
    np.testing.assert_allclose(solution.values["x"], SOLUTION, atol=0.1)


# What IPOPT says.


def test_more_equations_than_unknowns_are_said() -> None:
    three = Constraint("three", cs.vertcat(X[0] + X[1], X[0] - X[1], X[0] * X[1]), 1.0, 1.0)
    solution = LOCAL["ipopt"].solve(near(three), START)
    assert solution.status is Status.INFEASIBLE
    assert "more equations than unknowns; free more blocks" in solution.message


@pytest.mark.parametrize("name", ["ipopt", "ipopt-lbfgs", "sqp", "nlopt-slsqp"])
def test_constraints_that_contradict_each_other_are_said(name: str) -> None:
    problem = near(Constraint("a", X[0], upper=0.0), Constraint("b", X[0], lower=1.0, unit="m"))
    solution = LOCAL[name].solve(problem, START)
    assert solution.status is Status.INFEASIBLE
    assert "relax them" in solution.message


@pytest.mark.parametrize("wrong", [np.ones(2), np.ones((2, 1)), 1.0])
def test_a_hessian_of_the_users_has_to_be_square(wrong: np.ndarray | float) -> None:
    with pytest.raises(ValueError, match=r"hessian is \(2, 2\), not"):
        Ipopt(hessian=lambda run, x, here: wrong).solve(near(), START)


@pytest.mark.thorough
def test_ipopt_runs_are_as_with_a_solver_of_their_own() -> None:
    """IPOPT is made once for a problem; one run after the other is served by it."""
    other = {"y": 2.5 * np.exp(-0.8 * T) + 0.1, "x": np.array([0.5, 1.0, 0.2])}
    for hessian in (Ipopt().hessian, exact_hessian, None):
        problem, start = decay()
        for one in (start, start | other, start):
            found = Ipopt(hessian).solve(problem, one)
            alone = Ipopt(hessian).solve(decay()[0], one)
            assert [i.cost for i in found.trace] == [i.cost for i in alone.trace]
            assert (found.status, found.evaluations) == (alone.status, alone.evaluations)
