"""Where a minimum is: rounding errors, supports of rows, projections on linear limits."""

import casadi as cs
import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize
from scipy.sparse import csc_array, random_array

from tests.bodies_made_up import random_body
from tests.tiers import few
from workbench import Block, Constraint, Problem, Residual, residuals, solve
from workbench.problem import storage
from workbench.problem.graph import RANDOM_SUMS, term_sizes
from workbench.problem.optimality import (
    LinearLimits,
    Rounding,
    decrease,
    projected,
    projected_dense,
    projected_sparse,
)


def rounding(problem: Problem, **values: float) -> Rounding:
    x, fixed = problem.split(values)
    return problem.rounding(x, fixed, problem.residual(x, fixed))


def two(ratio: float) -> Problem:
    """x is noticed `ratio` times as strongly as y, each in a row of its own."""
    x, y = Block("x").symbol, Block("y").symbol
    return Problem((Residual("both", cs.vertcat(ratio * (x - 1), y - 2), 1.0),), ("x", "y"))


def test_sizes_of_terms_are_those_that_cancel() -> None:
    """Of rows that read one number each, in any order, of rows that read several, and of none."""
    x, h = Block("x", (4,)).symbol, Block("h", (3,)).symbol
    rows = cs.vertcat(3 * x[2], -2 * x[0] + h[1], cs.MX(5.0), x[0] + h[0], x[1] * h[0])
    problem = Problem((Residual("r", rows, 1.0),), "x")
    at, fixed = np.array([1.0, -2.0, 3.0, 0.5]), np.array([-1.0, 7.0, -1.0])
    J = cs.Function("J", [x, h], [cs.jacobian(rows, x), cs.jacobian(rows, h)])
    parts = zip(J(at, fixed), (at, fixed), strict=True)
    sizes = np.sqrt(sum(((np.array(by) * numbers) ** 2).sum(axis=1) for by, numbers in parts))
    estimates = problem._chain.term_sizes(at, problem.split({"x": at, "h": fixed})[1])
    assert estimates[2] == sizes[2] == 0.0
    ratios = np.delete(estimates, 2) / np.delete(sizes, 2)
    assert (ratios > 0.3).all()
    assert (ratios < 3.0).all()


def test_sizes_of_terms_neither_overflow_nor_vanish() -> None:
    for factor, at in ((1e155, 1.0), (1e-200, 1e200), (1e200, 0.0)):
        x = Block("x").symbol
        size = cs.Function("size", [x], [term_sizes(factor * x, [x])])(at)
        weights = np.random.default_rng(0).standard_normal(RANDOM_SUMS)
        mean = abs(weights).sum() / np.sqrt(RANDOM_SUMS)
        assert float(size) == pytest.approx(factor * at * mean)


def test_large_row_does_not_excuse_another() -> None:
    problem = two(1e15)
    x, fixed = problem.split({"x": 1.0, "y": 1.9})
    rows = rounding(problem, x=1.0, y=1.9).rows
    assert rows[0] > 0.3  # the last bit of x changes this row by 0.2
    assert rows[1] < 1e-13
    here = problem.linearize_at(x, fixed)
    # y is off by a tenth of a sigma, and the whole of its own row is its fault
    assert problem.optimality(x, here, rounding(problem, x=1.0, y=1.9)) == pytest.approx(1.0)


def test_rounding_does_not_excuse_a_hidden_unknown() -> None:
    """In one row with terms of 1e15, y is known to about a sigma, and that is not converged."""
    x, y = Block("x").symbol, Block("y").symbol
    rows = cs.vertcat(1e15 * (x - 1) + y - 2, 1e15 * (x - 1) - y + 2)
    problem = Problem((Residual("both", rows, 1.0),), ("x", "y"))
    at, fixed = problem.split({"x": 1.0, "y": 1.5})
    here = problem.linearize_at(at, fixed)
    assert problem.optimality(at, here, rounding(problem, x=1.0, y=1.5)) > 0.1
    at, fixed = problem.split({"x": 1.0, "y": 2.0})
    assert problem.optimality(at, problem.linearize_at(at, fixed)) == 0


def test_undetermined_column_does_not_excuse_coupled_unknown() -> None:
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


def test_constant_rows_do_not_change_optimality() -> None:
    for constant in [1.0, 1e12]:
        x = Block("x").symbol
        alone = Problem((Residual("fit", x - 1, 1.0),), "x")
        beside = Problem((Residual("fit", x - 1, 1.0), Residual("c", cs.MX(constant), 1.0)), "x")
        for value in (0.0, 0.5, 1.0):
            both = [
                p.optimality(p.split({"x": value})[0], p.linearize({"x": value}))
                for p in (alone, beside)
            ]
            assert both[0] == both[1] == (value != 1.0)


def test_support_covers_the_jacobian() -> None:
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


def test_decrease_keeps_its_digits_beside_a_constant() -> None:
    r, s = np.array([1e8, 1e-3]), np.array([1e8, 0.5e-3])
    exact = 0.5 * (1e-6 - 0.25e-6)
    assert decrease(r, s) == pytest.approx(exact, rel=1e-12)
    assert 0.5 * (r @ r) - 0.5 * (s @ s) != pytest.approx(exact, rel=0.1)  # as a difference
    explained = Rounding(1e-15 * np.abs(r))
    moved = r != s
    assert explained.of_decrease(r, moved) < 1e-20 < explained.of_cost(r)


def test_violated_constraint_is_never_optimal() -> None:
    x = Block("x").symbol
    problem = Problem((Residual("fit", x - 1, 1.0),), "x", constraints=(Constraint("c", x, 2.0),))
    at, fixed = problem.split({"x": 1.0})
    here = problem.linearize_at(at, fixed)
    assert problem.optimality(at, here, rounding(problem, x=1.0)) == np.inf


@pytest.mark.parametrize("seed", range(2))
def test_noiseless_differences_of_large_numbers_converge(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((6, 2))
    truth = 1e9 + rng.standard_normal(2)
    x = Block("x", (2,)).symbol
    rows = A @ cs.vertcat(x[0] - x[1], x[0] + x[1] - 2e9)
    there = A @ np.array([truth[0] - truth[1], truth[0] + truth[1] - 2e9])
    problem = Problem((Residual("r", 1e3 * (rows - there), 1.0),), "x")
    solution = solve(problem, {"x": truth + rng.standard_normal(2)})
    assert solution.converged


def limits(seed: int, n: int = 30, k: int = 12, equations: bool = True) -> tuple:
    """A target, and limits that a known point meets: equations, one side, two sides, and bounds."""
    rng = np.random.default_rng(seed)
    A = random_array((k, n), density=0.08, rng=rng, data_sampler=rng.standard_normal).toarray()
    A[np.arange(k), rng.permutation(n)[:k]] += 1.0  # no row is empty
    A /= np.linalg.norm(A, axis=1)[:, None]
    inside = rng.standard_normal(n)
    room = rng.uniform(0.1, 1.0, (2, k))
    kind = np.arange(k) % 3
    down = A @ inside - np.where(kind == 0, 0.0 if equations else room[0], room[0])
    up = A @ inside + np.where(kind == 0, 0.0 if equations else room[1], room[1])
    up[kind == 1] = np.inf
    left, right = np.full(n, -np.inf), np.full(n, np.inf)
    left[::4], right[1::5] = inside[::4] - 0.2, inside[1::5] + 0.3
    return 3 * rng.standard_normal(n), LinearLimits(left, right, A, down, up)


@pytest.mark.parametrize("seed", range(3))
def test_projection_by_parts_is_that_at_once(seed: int) -> None:
    target, limited = limits(seed)
    expected = projected_dense(target, limited)
    by_parts = projected_sparse(target, limited._replace(A=csc_array(limited.A)))
    # both solve least-squares problems of condition below a hundred or so in double precision
    np.testing.assert_allclose(by_parts, expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize("seed", few(range(3), 1))
def test_projection_solves_a_quadratic_program(seed: int) -> None:
    target, limited = limits(seed, n=12, k=5)
    ended = minimize(
        lambda d: 0.5 * np.sum((d - target) ** 2),
        np.zeros(12),
        jac=lambda d: d - target,
        hess=lambda d: np.eye(12),
        method="trust-constr",
        options={"gtol": 1e-12, "xtol": 1e-14, "maxiter": 5000},
        constraints=[
            LinearConstraint(limited.A, limited.down, limited.up),
            LinearConstraint(np.eye(12), limited.left, limited.right),
        ],
    )
    np.testing.assert_allclose(projected_dense(target, limited), ended.x, atol=1e-4)
    np.testing.assert_allclose(
        projected_sparse(target, limited._replace(A=csc_array(limited.A))), ended.x, atol=1e-4
    )


@pytest.mark.parametrize("large", [False, True])
@pytest.mark.parametrize(
    ("rows", "down", "up"),
    [
        ([[1.0, 1.0], [2.0, 2.0]], [1.0, -9.0], [9.0, 1.0]),  # x + y >= 1 and <= 1/2
        ([[1.0, 0.0]], [5.0], [6.0]),  # beyond the bound of 4
    ],
)
def test_projection_on_contradictory_limits_is_infinite(
    monkeypatch: pytest.MonkeyPatch, large: bool, rows, down, up
) -> None:
    if large:
        monkeypatch.setattr(storage, "DENSE_FROM", 0)
    bound = np.full(2, 4.0)
    A = csc_array(np.array(rows)) if large else np.array(rows)
    nearest = projected(np.zeros(2), LinearLimits(-bound, bound, A, np.array(down), np.array(up)))
    assert np.isinf(nearest).all()
