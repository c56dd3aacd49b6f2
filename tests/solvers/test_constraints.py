"""Constraints, by every solver that takes them, dense and sparse; the others say no."""

from dataclasses import replace
from functools import cache
from typing import Any

import casadi as cs
import numpy as np
import pytest

from tests.bodies_made_up import random_body
from tests.tiers import few
from workbench import (
    SOLVERS,
    Block,
    Constraint,
    Nlopt,
    Problem,
    Residual,
    Solution,
    Sqp,
    Status,
    residuals,
)
from workbench.errors import NotSupported
from workbench.problem import storage
from workbench.problem.naming import Bounds
from workbench.solvers import Ipopt, Solver, exact_hessian

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


def test_abilities_tell_which_solvers_take_constraints() -> None:
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
def test_constraints_that_cannot_be_met_are_told(name: str) -> None:
    """A squared length below -1: the best point is the one that misses it least."""
    problem = near(Constraint("never", cs.sumsqr(X), upper=-1.0))
    limited: Any = replace(LOCAL[name], max_evaluations=500, max_seconds=30.0)  # type: ignore[type-var]
    solution = limited.solve(problem, START)
    assert solution.status is not Status.CONVERGED
    assert solution.violation > 1
    assert np.linalg.norm(solution.values["x"]) < np.linalg.norm(START["x"])
    if solution.status is Status.INFEASIBLE:
        assert "never" in solution.message or "constraints" in solution.message


def test_solvers_without_constraints_refuse_them() -> None:
    free = Problem(near(INSIDE).residuals, ("x",), constraints=(INSIDE,))
    for name in LOCAL.keys() - INEQUALITIES:
        with pytest.raises(NotSupported, match=r"takes no inequalities, .* has disc; use"):
            LOCAL[name].solve(free, START)


def test_a_feasible_point_is_better_than_a_cheap_one() -> None:
    """The start costs nothing, but is not allowed."""
    start = {"x": np.array([2.0, 1.0])}
    solution = LOCAL["ipopt"].solve(near(INSIDE), start)
    assert solution.trace[0].cost == 0 < solution.cost
    assert solution.violation <= 1


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


# What IPOPT says.


def test_more_equations_than_unknowns_are_told() -> None:
    three = Constraint("three", cs.vertcat(X[0] + X[1], X[0] - X[1], X[0] * X[1]), 1.0, 1.0)
    solution = LOCAL["ipopt"].solve(near(three), START)
    assert solution.status is Status.INFEASIBLE
    assert "more equations than unknowns; free more blocks" in solution.message


@pytest.mark.parametrize("name", ["ipopt", "ipopt-lbfgs", "sqp", "nlopt-slsqp"])
def test_constraints_that_contradict_each_other_are_told(name: str) -> None:
    problem = near(Constraint("a", X[0], upper=0.0), Constraint("b", X[0], lower=1.0, unit="m"))
    solution = LOCAL[name].solve(problem, START)
    assert solution.status is Status.INFEASIBLE
    assert "relax them" in solution.message


# Sparse constraints and Hessians: what solvers make of them, they make of dense ones too.

FRAMES, SIZE = 8, 5
SPARSE = {
    "ipopt": Ipopt(),
    "exact": Ipopt(hessian=exact_hessian),
    "lbfgs": Ipopt(hessian=None),
    "sqp": Sqp(),
    "sqp exact": Sqp(hessian=exact_hessian),
    "slsqp": Nlopt("LD_SLSQP"),
}


@cache
def unknowns(count: int) -> Block:
    """All frames in one column."""
    return Block("q", (count * SIZE,))


def frames(count: int = FRAMES, bounds: Bounds | None = None) -> Problem:
    """Frames that resemble their neighbours: in each of them a ball, a product and a plane."""
    block = unknowns(count)
    q = cs.reshape(block.symbol, SIZE, count)
    seen = np.random.default_rng(0).uniform(-1.0, 1.0, (SIZE, count))
    terms = (
        Residual("data", cs.vec(cs.sin(q) - cs.DM(np.sin(seen))), 0.1),
        Residual("smooth", cs.vec(q[:, 1:] - q[:, :-1]), 0.3),
    )
    limits = (
        Constraint("ball", cs.sum1(q[:3, :] ** 2).T, upper=0.3),
        Constraint("product", (q[0, :] * q[3, :]).T, lower=-0.1),
        Constraint("plane", (q[2, :] + q[4, :]).T, 0.2, 0.2),
    )
    return Problem(terms, ("q",), bounds, blocks=(block,), constraints=limits)


def start(count: int = FRAMES) -> dict[str, np.ndarray]:
    return {"q": 0.1 * np.random.default_rng(1).standard_normal(count * SIZE)}


def always_sparse(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on what a new problem has is sparse, however small it is."""
    monkeypatch.setattr(storage, "DENSE_FROM", 0)
    monkeypatch.setattr(storage, "SPARSE_UP_TO", 0.99)


@pytest.mark.parametrize("name", few(SPARSE, ("ipopt", "sqp")))
@pytest.mark.parametrize("bounds", [None, {"q": (-0.4, 0.5)}], ids=["free", "bounded"])
def test_sparse_problems_end_where_dense_ones_do(
    monkeypatch: pytest.MonkeyPatch, name: str, bounds: Bounds | None
) -> None:
    solver: Solver = SPARSE[name]
    expected = solver.solve(frames(bounds=bounds), start())
    always_sparse(monkeypatch)
    solution = solver.solve(frames(bounds=bounds), start())
    messages = solution.message, expected.message
    assert solution.status is Status.CONVERGED is expected.status, messages
    assert solution.violation <= 1
    # the gradient is zero to 1e-6 of the residual in both, and the cost is quadratic there
    np.testing.assert_allclose(solution.values["q"], expected.values["q"], rtol=0, atol=1e-5)
    assert solution.cost == pytest.approx(expected.cost, rel=1e-6)
