"""Sparse constraints and Hessians: what solvers make of them, they make of dense ones too."""

import tracemalloc
from dataclasses import replace
from functools import cache

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csc_array

import workbench as wb
from tests.tiers import few
from workbench import Status
from workbench.errors import TooLarge
from workbench.problem import storage
from workbench.problem.bounds import Bounds
from workbench.solvers import Solver, exact_hessian
from workbench.solvers.newton import raised

FRAMES, SIZE = 8, 5
SOLVERS = {
    "ipopt": wb.Ipopt(),
    "exact": wb.Ipopt(hessian=exact_hessian),
    "lbfgs": wb.Ipopt(hessian=None),
    "sqp": wb.Sqp(),
    "sqp exact": wb.Sqp(hessian=exact_hessian),
    "slsqp": wb.Nlopt("LD_SLSQP"),
}


@cache
def unknowns(count: int) -> wb.Block:
    """All frames in one column."""
    return wb.Block("q", (count * SIZE,))


def frames(count: int = FRAMES, *more: wb.Constraint, bounds: Bounds | None = None):
    """Frames that resemble their neighbours: in each of them a ball, a product and a plane."""
    block = unknowns(count)
    q = cs.reshape(block.symbol, SIZE, count)
    seen = np.random.default_rng(0).uniform(-1.0, 1.0, (SIZE, count))
    terms = (
        wb.Residual("data", cs.vec(cs.sin(q) - cs.DM(np.sin(seen))), 0.1),
        wb.Residual("smooth", cs.vec(q[:, 1:] - q[:, :-1]), 0.3),
    )
    limits = (
        wb.Constraint("ball", cs.sum1(q[:3, :] ** 2).T, upper=0.3),
        wb.Constraint("product", (q[0, :] * q[3, :]).T, lower=-0.1),
        wb.Constraint("plane", (q[2, :] + q[4, :]).T, 0.2, 0.2),
        *more,
    )
    return wb.Problem(terms, ("q",), bounds, blocks=(block,), constraints=limits)


def start(count: int = FRAMES) -> dict[str, np.ndarray]:
    return {"q": 0.1 * np.random.default_rng(1).standard_normal(count * SIZE)}


def always_sparse(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on what a new problem has is sparse, however small it is."""
    monkeypatch.setattr(storage, "DENSE_FROM", 0)
    monkeypatch.setattr(storage, "SPARSE_UP_TO", 0.99)


@pytest.mark.parametrize("name", few(SOLVERS, ("ipopt", "sqp")))
@pytest.mark.parametrize("bounds", [None, {"q": (-0.4, 0.5)}], ids=["free", "bounded"])
def test_the_sparse_way_ends_where_the_dense_one_does(
    monkeypatch: pytest.MonkeyPatch, name: str, bounds: Bounds | None
) -> None:
    solver: Solver = SOLVERS[name]
    expected = solver.solve(frames(bounds=bounds), start())
    always_sparse(monkeypatch)
    found = solver.solve(frames(bounds=bounds), start())
    assert found.status is Status.CONVERGED is expected.status, (found.message, expected.message)
    assert found.violation <= 1
    # the gradient is zero to 1e-6 of the residual in both, and the cost is quadratic there
    np.testing.assert_allclose(found.values["q"], expected.values["q"], rtol=0, atol=1e-5)
    assert found.cost == pytest.approx(expected.cost, rel=1e-6)


def test_derivatives_are_those_of_the_dense_way(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = frames()
    x, fixed = problem.split(start())
    y = np.random.default_rng(2).standard_normal(problem.stacked_constraints.size)
    dense = problem.stacked_constraints.linearize(x, fixed)
    H, bend = problem.hessian_at(x, fixed), problem.stacked_constraints.hessian(x, fixed, y)
    always_sparse(monkeypatch)
    problem = frames()
    there = problem.stacked_constraints
    sparse = there.linearize(x, fixed)
    assert isinstance(dense.jacobian, np.ndarray)
    assert there.sparse
    assert problem.sparse
    for found, expected, pattern in (
        (sparse.jacobian, dense.jacobian, there.pattern),
        (there.hessian(x, fixed, y), bend, there.hessian_pattern),
        (problem.hessian_at(x, fixed), H, None),
    ):
        assert isinstance(found, csc_array)
        assert found.nnz < expected.size / 2
        np.testing.assert_allclose(found.toarray(), expected, rtol=1e-13, atol=1e-13)
        if pattern is not None:
            outside = pattern.toarray() == 0
            assert outside.any()
            assert not expected[outside].any()


@pytest.mark.parametrize("bounds", [None, {"q": (-0.4, 0.5)}], ids=["free", "bounded"])
def test_the_measure_of_optimality_is_the_same(
    monkeypatch: pytest.MonkeyPatch, bounds: Bounds | None
) -> None:
    rng, problem = np.random.default_rng(4), frames(bounds=bounds)
    points = [problem.split({"q": q}) for q in rng.uniform(-0.3, 0.4, (20, FRAMES * SIZE))]
    solved = problem.split(wb.Ipopt().solve(problem, start()).values)
    expected = [problem.optimality(at[0], problem.linearize_at(*at)) for at in (*points, solved)]
    always_sparse(monkeypatch)
    problem = frames(bounds=bounds)
    found = [problem.optimality(at[0], problem.linearize_at(*at)) for at in (*points, solved)]
    # least-squares problems of condition below a hundred or so, in double precision
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11)
    assert expected[-1] < 1e-6 < min(expected[:-1])


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["ipopt", "exact", "lbfgs", "sqp"])
def test_nothing_dense_is_made_of_a_long_sequence(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """3,000 unknowns are sparse by themselves; a dense Jacobian or Hessian is refused here."""

    def never(rows: int, columns: int, *_: object) -> None:
        if rows * columns > 10**6:
            raise TooLarge(f"an array of {rows} x {columns}")

    monkeypatch.setattr(storage, "check_fits", never)
    monkeypatch.setattr("workbench.problem.chain.check_fits", never)
    problem = frames(600)
    assert problem.sparse
    assert problem.stacked_constraints.hessian_pattern.nnz < 10**4
    tracemalloc.start()
    found = replace(SOLVERS[name], max_iterations=3).solve(problem, start(600))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found.status is Status.MAX_ITERATIONS, found.message
    assert most < 8 * 3000**2 / 2  # bytes that NumPy took, where one array of n x n takes twice it


# Making a sparse Hessian positive definite.


def convex_parts(seed: int, bend: float) -> tuple[np.ndarray, np.ndarray]:
    """J'J and J'J + N, with an indefinite N that has entries of about this size."""
    rng = np.random.default_rng(seed)
    J = rng.standard_normal((30, 12)) * (rng.random((30, 12)) < 0.3)
    N = rng.standard_normal((12, 12)) * (rng.random((12, 12)) < 0.2)
    return J.T @ J, J.T @ J + bend * (N + N.T)


@pytest.mark.parametrize("seed", few(range(4), 1))
@pytest.mark.parametrize("bend", [0.01, 100.0])
def test_what_is_not_is_raised_until_it_is(seed: int, bend: float) -> None:
    normal, H = convex_parts(seed, bend)
    assert bend < 10 or np.linalg.eigvalsh(H).min() < 0
    matrix, share = raised(csc_array(normal), csc_array(H))
    change = matrix.toarray() - H
    assert np.linalg.eigvalsh(matrix.toarray()).min() > 0
    np.testing.assert_array_equal(change[~np.eye(12, dtype=bool)], 0)
    assert (change.diagonal() > 0).all()
    assert (share > 0) == (np.linalg.eigvalsh(H).min() < 0)


def test_newton_takes_a_sparse_hessian(monkeypatch: pytest.MonkeyPatch) -> None:
    def free() -> wb.Problem:
        whole = frames()
        return wb.Problem(whole.residuals, ("q",), blocks=(unknowns(FRAMES),))

    expected = wb.Newton().solve(free(), start())
    always_sparse(monkeypatch)
    found = wb.Newton().solve(free(), start())
    assert found.status is Status.CONVERGED is expected.status
    np.testing.assert_allclose(found.values["q"], expected.values["q"], rtol=0, atol=1e-6)
    assert len(found.trace) == len(expected.trace)
