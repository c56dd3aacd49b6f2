"""What rounding may explain, row by row, and which rows a free number can change."""

import casadi as cs
import numpy as np
import pytest

from tests.bodies_made_up import random_body
from workbench import Block, Constraint, Problem, Residual, residuals, solve
from workbench.problem.graph import SUMS, size_of_terms
from workbench.problem.rounding import Rounding, fall

EPS = np.finfo(float).eps


def rounding(problem: Problem, **values: float) -> Rounding:
    x, fixed = problem.split(values)
    return problem.rounding(x, fixed, problem.residual(x, fixed))


def two(ratio: float) -> Problem:
    """x is noticed `ratio` times as strongly as y, each in a row of its own."""
    x, y = Block("x").symbol, Block("y").symbol
    return Problem((Residual("both", cs.vertcat(ratio * (x - 1), y - 2), 1.0),), ("x", "y"))


def test_it_is_measured_where_it_is_asked_for() -> None:
    """exp(x) - 1 is made of numbers of the size e^30 at 30, and of the size 1 at 0."""
    problem = Problem((Residual("fit", cs.exp(Block("x").symbol) - 1, 1.0),), "x")
    far, near = rounding(problem, x=30.0), rounding(problem, x=0.0)
    assert far.norm > 30 * np.exp(30) * EPS
    assert near.norm < 100 * EPS


def test_terms_are_as_large_as_weighed_sums_of_them() -> None:
    """Of rows that read one number each, in any order, of rows that read several, and of none."""
    x, h = Block("x", (4,)).symbol, Block("h", (3,)).symbol
    linear = cs.vertcat(3 * x[2], -2 * x[0] + h[1], cs.MX(5.0), 4 * x[3] - 0.5 * h[2])
    for rows in (linear, cs.vertcat(linear, x[0] - x[1]), cs.vertcat(linear, x[0] * h[0])):
        problem = Problem((Residual("r", rows, 1.0),), "x")
        at, fixed = np.array([1.0, -2.0, 3.0, 0.5]), np.array([2.0, 7.0, -1.0])
        J = cs.Function("J", [x, h], [cs.jacobian(rows, x), cs.jacobian(rows, h)])
        squares = np.zeros(rows.numel())
        for by, numbers in zip(J(at, fixed), (at, fixed), strict=True):
            weights = np.random.default_rng(0).standard_normal((len(numbers), SUMS))
            squares += ((np.array(by) @ (weights * numbers[:, None])) ** 2).sum(axis=1)
        found = problem._chain.made_of(at, problem.split({"x": at, "h": fixed})[1])
        np.testing.assert_allclose(found, np.sqrt(squares), rtol=1e-14)


def test_points_are_read_in_their_own_order() -> None:
    """Of (N, 3) points each row reads one entry; they have three columns for CasADi."""
    points = Block("points", (5, 3), "m")
    size = size_of_terms(cs.vec(points.symbol), [points.symbol])
    weights = np.random.default_rng(0).standard_normal(points.symbol.shape[:1] + (SUMS * 5,))
    weights = weights.reshape(3, SUMS, 5)
    at = np.arange(1.0, 16.0).reshape(3, 5)
    expected = np.sqrt(((weights * at[:, None]) ** 2).sum(axis=1)).ravel(order="F")
    found = cs.Function("size", [points.symbol], [size])(at)
    np.testing.assert_allclose(np.array(found).ravel(), expected, rtol=1e-14)


def test_extreme_factors_neither_overflow_nor_vanish() -> None:
    for factor, at in ((1e155, 1.0), (1e-200, 1e200), (1e200, 0.0)):
        x = Block("x").symbol
        size = cs.Function("size", [x], [size_of_terms(factor * x, [x])])(at)
        length = np.linalg.norm(np.random.default_rng(0).standard_normal(SUMS))
        assert float(size) == pytest.approx(factor * at * length)


def test_a_single_number_may_be_read_by_several_rows() -> None:
    x = Block("x").symbol
    problem = Problem((Residual("r", cs.vertcat(2 + x, 2 - 3 * x), 1.0),), "x")
    size = 5.0 * np.linalg.norm(np.random.default_rng(0).standard_normal(SUMS))
    found = problem._chain.made_of(np.array([5.0]), np.zeros(0))
    np.testing.assert_allclose(found, [size, 3 * size], rtol=1e-14)


def test_a_large_row_is_no_excuse_for_another() -> None:
    problem = two(1e15)
    x, fixed = problem.split({"x": 1.0, "y": 1.9})
    rows = rounding(problem, x=1.0, y=1.9).rows
    assert rows[0] > 0.3  # the last bit of x changes this row by 0.2
    assert rows[1] < 1e-13
    here = problem.linearize_at(x, fixed)
    # y is off by a tenth of a sigma, and the whole of its own row is its fault
    assert problem.optimality(x, here, rounding(problem, x=1.0, y=1.9)) == pytest.approx(1.0)


def test_rounding_that_hides_an_unknown_excuses_nothing() -> None:
    """In one row with terms of 1e15, y is known to about a sigma, and that is not converged."""
    x, y = Block("x").symbol, Block("y").symbol
    rows = cs.vertcat(1e15 * (x - 1) + y - 2, 1e15 * (x - 1) - y + 2)
    problem = Problem((Residual("both", rows, 1.0),), ("x", "y"))
    at, fixed = problem.split({"x": 1.0, "y": 1.5})
    here = problem.linearize_at(at, fixed)
    assert problem.optimality(at, here, rounding(problem, x=1.0, y=1.5)) > 0.1
    at, fixed = problem.split({"x": 1.0, "y": 2.0})
    assert problem.optimality(at, problem.linearize_at(at, fixed)) == 0


def test_one_who_takes_the_rounding_errors_of_a_hidden_one_has_not_converged_either() -> None:
    """x is off by its last bit, and y at its best for that x: 0.1 from where it belongs."""
    x, y = Block("x").symbol, Block("y").symbol
    A = np.array([[1.0, 0.5], [0.0, 1.0], [1.0, -2.0]])
    problem = Problem((Residual("r", A @ cs.vertcat(1e15 * (x - 1), y - 2), 1.0),), ("x", "y"))
    off = 1e15 * (np.nextafter(1.0, 2.0) - 1.0)
    best = 2.0 - off * float(A[:, 0] @ A[:, 1] / (A[:, 1] @ A[:, 1]))
    values = {"x": np.nextafter(1.0, 2.0), "y": best}
    at, fixed = problem.split(values)
    assert abs(best - 2.0) > 0.05
    here = problem.linearize_at(at, fixed)
    assert problem.optimality(at, here, rounding(problem, **values)) > 0.1


@pytest.mark.parametrize("constant", [1.0, 1e6, 1e12])
def test_a_constant_row_says_nothing_about_how_near_a_minimum_is(constant: float) -> None:
    x = Block("x").symbol
    alone = Problem((Residual("fit", x - 1, 1.0),), "x")
    beside = Problem((Residual("fit", x - 1, 1.0), Residual("c", cs.MX(constant), 1.0)), "x")
    for value in (0.0, 0.5, 1.0):
        both = [
            p.optimality(p.split({"x": value})[0], p.linearize({"x": value}))
            for p in (alone, beside)
        ]
        assert both[0] == both[1] == (value != 1.0)


def test_the_rows_of_others_make_nobody_converge() -> None:
    """A large residual that y cannot get rid of does not hide how far x is from its minimum."""
    x, y = Block("x").symbol, Block("y").symbol
    rows = cs.vertcat(x - 1, 1e6 + y, 1e6 - y)
    problem = Problem((Residual("fit", rows, 1.0),), ("x", "y"))
    at = {"x": 0.0, "y": 0.0}
    assert problem.optimality(problem.split(at)[0], problem.linearize(at)) == pytest.approx(1.0)


def test_the_support_is_that_of_the_jacobian() -> None:
    """Through points and beside them: no row is missing, and of direct ones none is too many."""
    body = random_body(3, n_vertices=15, n_joints=3, n_betas=2)
    pose, betas, trans = (block.symbol for block in body.blocks())
    observed = Block("observed", (15, 3), "m").symbol
    data = residuals.vertices(body.points(pose, betas, trans), observed, sigma=0.02)
    own = Residual("own", cs.vertcat(betas[0] - 1, trans[1] * trans[2], 3.0), 1.0)
    problem = Problem((data, own), ("pose", "betas", "trans"))
    values = body.start() | {"observed": body.vertices()}
    values["pose"] = np.random.default_rng(0).normal(size=(3, 3))
    values["trans"] = np.array([0.1, 0.2, 0.3])
    J = problem.linearize(values).jacobian
    for k in range(problem.size):
        row = np.zeros(problem.size)
        row[k] = 1.0
        can = problem.support.norms(row) > 0
        assert can[J[k] != 0].all()
        if k >= data.size:
            np.testing.assert_array_equal(can, J[k] != 0)
    np.testing.assert_array_equal(problem.support.changing, [True] * (data.size + 2) + [False])


def test_a_fall_of_the_cost_keeps_its_digits_beside_a_constant() -> None:
    r, s = np.array([1e8, 1e-3]), np.array([1e8, 0.5e-3])
    exact = 0.5 * (1e-6 - 0.25e-6)
    assert fall(r, s) == pytest.approx(exact, rel=1e-12)
    assert 0.5 * (r @ r) - 0.5 * (s @ s) != pytest.approx(exact, rel=0.1)  # as a difference
    explained = Rounding(1e-15 * np.abs(r))
    moved = r != s
    assert explained.of_fall(r, moved) < 1e-20 < explained.of_cost(r)


def test_what_rounding_does_to_a_cost_is_not_lost_where_the_residual_vanishes() -> None:
    """1/2 |e|^2 is left when r is zero; |r|'e alone would be zero."""
    assert Rounding(np.array([3e-15, 4e-15])).of_cost(np.zeros(2)) == pytest.approx(12.5e-30)


def test_a_constraint_where_nothing_is_left_of_the_residual_is_still_missed() -> None:
    x = Block("x").symbol
    problem = Problem((Residual("fit", x - 1, 1.0),), "x", constraints=(Constraint("c", x, 2.0),))
    at, fixed = problem.split({"x": 1.0})
    here = problem.linearize_at(at, fixed)
    assert problem.optimality(at, here, rounding(problem, x=1.0)) == np.inf


def test_terms_that_cancel_each_other_have_rounding_errors_all_the_same() -> None:
    z = Block("z", (2,)).symbol
    problem = Problem((Residual("r", (0.1 * z[0] - 0.3 * z[1]) / 1e-9, 1.0),), "z")
    x, fixed = problem.split({"z": [3e9, 1e9]})
    (found,) = problem.rounding(x, fixed, problem.residual(x, fixed)).rows
    terms = EPS * np.hypot(0.3, 0.3) * 1e18
    assert 0.3 * terms < found < 30 * terms  # ten times what is estimated


@pytest.mark.parametrize("seed", range(10))
def test_a_noiseless_problem_in_differences_of_large_numbers_converges(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((6, 2))
    truth = 1e9 + rng.standard_normal(2)
    x = Block("x", (2,)).symbol
    rows = A @ cs.vertcat(x[0] - x[1], x[0] + x[1] - 2e9)
    there = A @ np.array([truth[0] - truth[1], truth[0] + truth[1] - 2e9])
    problem = Problem((Residual("r", 1e3 * (rows - there), 1.0),), "x")
    solution = solve(problem, {"x": truth + rng.standard_normal(2)})
    assert solution.converged
