"""Sparse constraints and Hessians: what solvers make of them, they make of dense ones too."""

import tracemalloc
from dataclasses import replace
from functools import cache

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csc_array

import workbench as wb
from workbench import Status
from workbench.errors import TooLarge
from workbench.problem import storage
from workbench.problem.bounds import Bounds
from workbench.problem.nonzeros import entries_at
from workbench.solvers import Solver, exact_hessian, gauss_newton_hessian
from workbench.solvers.convexity import raised
from workbench.solvers.oracle import Oracle
from workbench.solvers.run import Run

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


@pytest.mark.parametrize("name", SOLVERS)
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


@pytest.mark.parametrize("name", ["ipopt", "exact"])
def test_the_iterates_are_the_same(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """The same linear systems, solved by the same library: steps differ by rounding alone."""
    expected = SOLVERS[name].solve(frames(), start())
    always_sparse(monkeypatch)
    found = SOLVERS[name].solve(frames(), start())
    for here, there in zip(found.trace[:6], expected.trace[:6], strict=True):
        # systems of condition below 1e6 or so, in double precision, six times
        np.testing.assert_allclose(here.values["q"], there.values["q"], rtol=0, atol=1e-8)
        assert here.optimality == pytest.approx(there.optimality, rel=1e-5)


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


def test_questions_are_answered_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    at = frames().split(start())
    dense = frames().stacked_constraints.linearize(*at)
    always_sparse(monkeypatch)
    sparse = frames().stacked_constraints.linearize(*at)
    directions, lengths = rng.standard_normal((len(at[0]), 3)), rng.uniform(1, 2, len(at[0]))
    some = rng.random(len(dense.values)) < 0.5
    assert isinstance(sparse.jacobian, csc_array)
    np.testing.assert_array_equal(sparse.rows(some), dense.rows(some))
    np.testing.assert_array_equal(sparse.usable, dense.usable)
    for ask in ("along", "magnitudes_along"):
        np.testing.assert_allclose(
            getattr(sparse, ask)(directions), getattr(dense, ask)(directions), atol=1e-14
        )
    np.testing.assert_allclose(storage.dense(sparse.per(lengths)), dense.per(lengths), atol=1e-15)
    assert sparse.finite
    assert dense.finite
    for one in (sparse, dense):
        storage.entries(one.jacobian).flat[0] = np.nan
        assert not one.finite
        assert one.usable.sum() == len(some) - 1


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


def test_the_places_given_to_casadi_hold_every_nonzero(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = frames()
    x, fixed = problem.split(start())
    y = np.random.default_rng(5).standard_normal(problem.stacked_constraints.size)
    J = problem.linearize_at(x, fixed)
    bend = problem.stacked_constraints.hessian(x, fixed, y)
    expected = {gauss_newton_hessian: J.normal, exact_hessian: problem.hessian_at(x, fixed)}
    always_sparse(monkeypatch)
    problem = frames()
    for hessian, H in expected.items():
        run = Run("test", wb.Ipopt(), problem, start(), None)
        oracle = Oracle(run, hessian)
        for external, value, given in (
            (oracle.constraint_jacobian, J.constraints.jacobian, cs.DM(0, 1)),
            (oracle.hessian, H, cs.DM(0, 1)),
            (oracle.constraint_hessian, bend, y),
        ):
            found = external(x, given)
            assert found.nnz() < 0.4 * value.size
            np.testing.assert_allclose(np.array(found), value, rtol=1e-12, atol=1e-11)
        convex = np.array(oracle.convex_hessian(x, y))
        assert np.linalg.eigvalsh(convex).min() > 0
        assert oracle.error is None


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


def test_what_cannot_be_met_is_still_said(monkeypatch: pytest.MonkeyPatch) -> None:
    always_sparse(monkeypatch)
    q = unknowns(FRAMES).symbol
    against = (wb.Constraint("a", q[0], upper=-1.0), wb.Constraint("b", q[0], lower=1.0))
    for name in ("ipopt", "exact", "sqp", "slsqp"):
        found = SOLVERS[name].solve(frames(FRAMES, *against), start())
        assert found.status is Status.INFEASIBLE, (name, found.status, found.message)
        assert "relax them" in found.message
    found = SOLVERS["lbfgs"].solve(frames(FRAMES, *against), start())
    assert found.status is not Status.CONVERGED  # when it gives up is a matter of rounding
    assert found.violation > 1
    many = wb.Constraint("many", cs.repmat(q, 2) * cs.DM(np.arange(1.0, 81)), 1.0, 1.0)
    found = wb.Ipopt().solve(frames(FRAMES, many), start())
    assert found.status is Status.INFEASIBLE
    assert "more equations than unknowns" in found.message


def test_a_hessian_of_the_users_may_be_sparse_and_has_to_be_square(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    expected = wb.Ipopt().solve(frames(), start())
    always_sparse(monkeypatch)
    own = wb.Ipopt(hessian=lambda run, x, here: csc_array(here.normal))
    found = own.solve(frames(), start())
    np.testing.assert_allclose(found.values["q"], expected.values["q"], atol=1e-5)
    for wrong in (np.ones(2), csc_array(np.ones((2, 1)))):
        with pytest.raises(ValueError, match=r"hessian is \(40, 40\), not"):
            wb.Ipopt(hessian=lambda run, x, here, bad=wrong: bad).solve(frames(), start())


# Making a sparse Hessian positive definite.


def convex_parts(seed: int, bend: float) -> tuple[np.ndarray, np.ndarray]:
    """J'J and J'J + N, with an indefinite N that has entries of about this size."""
    rng = np.random.default_rng(seed)
    J = rng.standard_normal((30, 12)) * (rng.random((30, 12)) < 0.3)
    N = rng.standard_normal((12, 12)) * (rng.random((12, 12)) < 0.2)
    return J.T @ J, J.T @ J + bend * (N + N.T)


def test_what_is_definite_keeps_its_curvature() -> None:
    normal, _ = convex_parts(0, 0.0)
    normal += np.eye(12)
    H = normal + 0.1 * np.diag(np.linspace(-1.0, 1.0, 12))
    for given in (normal, H):
        found = raised(csc_array(normal), csc_array(given))
        assert found.share == 0
        change = found.matrix.toarray() - given
        # 1e-8 of the largest diagonal entry, and rounding errors of a few eps of that
        np.testing.assert_allclose(change, 1e-8 * normal.diagonal().max() * np.eye(12), atol=1e-13)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("bend", [0.01, 1.0, 100.0])
def test_what_is_not_is_raised_until_it_is(seed: int, bend: float) -> None:
    normal, H = convex_parts(seed, bend)
    assert bend < 10 or np.linalg.eigvalsh(H).min() < 0
    found = raised(csc_array(normal), csc_array(H))
    change = found.matrix.toarray() - H
    assert np.linalg.eigvalsh(found.matrix.toarray()).min() > 0
    np.testing.assert_array_equal(change[~np.eye(12, dtype=bool)], 0)
    assert (change.diagonal() > 0).all()
    assert (found.share > 0) == (np.linalg.eigvalsh(H).min() < 0)


def test_a_saddle_without_any_curvature_of_the_cost_is_raised_as_far_as_is_certain() -> None:
    H = np.array([[0.0, 2.0], [2.0, 0.0]])
    found = raised(csc_array((2, 2)), csc_array(H))
    assert found.share == 1.0
    assert np.linalg.eigvalsh(found.matrix.toarray()).min() > 0
    np.testing.assert_allclose(found.matrix.toarray(), H + 2 * np.eye(2), atol=1e-7)


@pytest.mark.parametrize("seed", range(3))
def test_entries_at_the_places_of_a_pattern(seed: int) -> None:
    """Of an array and of a sparse matrix with fewer entries, column by column."""
    rng = np.random.default_rng(seed)
    pattern = csc_array(rng.random((7, 9)) < 0.4, dtype=float)
    A = pattern.toarray() * rng.integers(-1, 2, (7, 9))
    rows, columns = pattern.tocoo().row, pattern.tocoo().col
    for given in (A, csc_array(A)):
        np.testing.assert_array_equal(entries_at(given, pattern), A[rows, columns])


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
