"""Sparse Jacobians: how they are put together, and that their steps are those of the dense ones."""

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csc_array, random_array

import workbench as wb
from tests.tiers import few
from workbench import Linearization, residuals
from workbench.problem import steps
from workbench.problem.sparsity import DenseTerm, SparseSum, columns_of_nonzeros
from workbench.problem.steps import ConjugateGradients, cholesky, factorized


def sparse_matrix(seed: int, m: int = 60, n: int = 25, crowded: int = 0) -> np.ndarray:
    """Full column rank; the columns named by `crowded` (so many) hold no zeros."""
    rng = np.random.default_rng(seed)
    A = random_array((m, n), density=0.1, rng=rng, data_sampler=rng.standard_normal).toarray()
    A[:n] += np.diag(rng.uniform(1, 2, n))
    A[:, rng.permutation(n)[:crowded]] = rng.standard_normal((m, crowded))
    return A


def both(A: np.ndarray, seed: int = 0) -> tuple[Linearization, Linearization]:
    r = np.random.default_rng(seed).standard_normal(len(A))
    return Linearization(r, A), Linearization(r, csc_array(A))


# How they are put together.


def test_sum_of_sparse_parts_is_the_dense_sum() -> None:
    for seed in range(2):
        rng = np.random.default_rng(seed)
        m, n = 40, 12
        single = random_array((m, n), density=0.2, rng=rng, format="csc")
        expected = single.toarray()
        parts, numbers = [(single.indices, columns_of_nonzeros(single))], [single.data]
        for columns in (slice(0, 4), slice(3, 9), slice(9, 12), slice(5, 5)):
            rows = np.sort(rng.permutation(m)[: int(rng.integers(1, m))])
            entries = rng.standard_normal((columns.stop - columns.start, len(rows)))
            expected[rows[:, None], np.arange(columns.start, columns.stop)] += entries.T
            parts.append(DenseTerm(rows, columns).places)
            numbers.append(entries)
        total = SparseSum(parts, (m, n)).matrix(numbers)
        np.testing.assert_allclose(total.toarray(), expected, atol=1e-15)
        there = SparseSum(parts, (m, n)).pattern
        np.testing.assert_array_equal(there.indices, total.indices)
        np.testing.assert_array_equal(there.indptr, total.indptr)


# Steps.


def test_sparse_step_is_the_dense_one() -> None:
    for crowded, damping in [(0, 1e-3), (1, 0.0), (5, 0.0), (25, 10.0)]:
        dense, sparse = both(sparse_matrix(2, crowded=crowded))
        D = np.linspace(0.5, 3, 25)
        step = steps.automatic(sparse, damping, D)
        assert step.by == "sparse cholesky"
        np.testing.assert_allclose(step.p, dense.step(damping, D), rtol=0, atol=1e-11)


def test_sparse_factors_solve_and_refuse_indefinite_matrices() -> None:
    for crowded in [0, 3]:
        A = sparse_matrix(3, crowded=crowded)
        factor = factorized(csc_array(A.T @ A))
        assert factor is not None
        B = np.random.default_rng(0).standard_normal((25, 4))
        np.testing.assert_allclose(factor.solve(B), np.linalg.solve(A.T @ A, B), atol=1e-11)
        np.testing.assert_allclose(factor.solve(B[:, 0]), factor.solve(B)[:, 0], atol=1e-14)
        for spoiled in (2, 7, 24):
            N = A.T @ A
            N[:, spoiled] = N[spoiled] = 0.0
            assert factorized(csc_array(N)) is None
        C = A.copy()
        C[:, 4] = C[:, 9]  # dependent columns
        assert factorized(csc_array(C.T @ C)) is None
        assert factorized(csc_array(A.T @ A - 1e3 * np.eye(25))) is None
        assert factorized(csc_array(np.where(np.eye(25) > 0, np.nan, A.T @ A))) is None


# The same questions.


def test_sparse_linearization_answers_as_the_dense_one() -> None:
    dense, sparse = both(sparse_matrix(6, crowded=2))
    p = np.random.default_rng(1).standard_normal(25)
    assert sparse.estimated
    assert not dense.estimated
    assert sparse.rank == dense.rank == 25
    assert sparse.spectrum.rank == dense.spectrum.rank
    np.testing.assert_allclose(sparse.spectrum.s, dense.spectrum.s, rtol=1e-9)
    np.testing.assert_allclose(sparse.covariance, dense.covariance, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(sparse.svd[1], dense.svd[1], rtol=1e-12)
    assert sparse.predicted_decrease(p) == pytest.approx(dense.predicted_decrease(p), rel=1e-12)
    assert sparse.predicted_cost(p) == pytest.approx(dense.predicted_cost(p), rel=1e-12)
    part = np.array([3, 1, 7])
    for one, other in (
        (sparse.rows(part), dense.rows(part)),
        (sparse.columns(part), dense.columns(part)),
        (sparse.block(slice(2, 9), slice(1, 4)), dense.block(slice(2, 9), slice(1, 4))),
        (sparse.scaled(np.arange(1.0, 26)), dense.scaled(np.arange(1.0, 26))),
        (sparse.along_columns(np.eye(25)[:, :3]), dense.along_columns(np.eye(25)[:, :3])),
    ):
        np.testing.assert_allclose(one.dense, other.dense, atol=1e-15)
        np.testing.assert_array_equal(one.residual, other.residual)


# A mesh whose vertices are free, tied to a body.


def registration(free: tuple[str, ...]) -> tuple[wb.Problem, dict[str, np.ndarray]]:
    """Synthetic: the small body's own vertices, moved a little, as data."""
    body = wb.load_body("small")
    rng = np.random.default_rng(0)
    mesh = wb.Block("vertices", (body.n_vertices, 3), "m")
    model = body.points(*(block.symbol for block in body.blocks()))
    seen = body.template + rng.normal(scale=0.01, size=body.template.shape)
    ends = np.unique(np.sort(body.faces[:, :2], axis=1), axis=0)
    away = mesh.symbol - model.symbol
    bent = away[:, ends[:, 0].tolist()] - away[:, ends[:, 1].tolist()]
    terms = (
        residuals.vertices(mesh.symbol, seen, sigma=0.005, name="data"),
        wb.Residual("coupling", cs.vec(away), 0.02, "m", points=(model,)),
        wb.Residual("edges", cs.vec(bent), 0.005, "m", points=(model,)),
    )
    values = body.start() | {"vertices": body.template}
    return wb.Problem(terms, free, blocks=(mesh,)), values


@pytest.mark.parametrize("free", few([("vertices",), ("trans", "vertices", "pose", "betas")], 1))
def test_jacobian_of_free_vertices_matches_the_graph(free: tuple[str, ...]) -> None:
    problem, values = registration(free)
    here = problem.linearize(values)
    assert here.estimated == problem.sparse
    assert problem.sparse
    x, fixed = problem.split(values)
    r, J = problem.derivative(x, fixed)
    np.testing.assert_allclose(here.residual, np.asarray(r).ravel(), atol=1e-10)
    np.testing.assert_allclose(here.dense, np.asarray(J), atol=1e-9)
    assert here.jacobian.nnz <= problem.pattern.nnz
    solution = wb.solve(problem, values, wb.LevenbergMarquardt())
    assert solution.status is wb.Status.CONVERGED
    assert solution.trace[-1].linear_algebra == "sparse cholesky"
    by_gradient = problem.cost_and_gradient(problem.split(values | solution.values)[0], fixed)[1]
    assert np.linalg.norm(by_gradient) < 1e-5 * np.linalg.norm(here.gradient)


# Steps of the default.


def dependent() -> tuple[Linearization, Linearization]:
    """Dense and sparse: the last column is the sum of the two before."""
    A = sparse_matrix(7)
    A[:, -1] = A[:, -2] + A[:, -3]
    return both(A)


def test_dependent_sparse_columns_are_damped_slightly() -> None:
    """What the data determine is found to seven digits: the decrease is that of the best step."""
    dense, sparse = dependent()
    D = np.ones(25)
    assert steps.cholesky(sparse, 0.0, D) is None
    assert steps.automatic(sparse, 0.0, D).by == "lsmr"
    step, best = steps.sparing(sparse, 0.0, D), steps.svd(dense, 0.0, D)
    assert step.by == "sparse cholesky"
    fall, most = sparse.predicted_decrease(step.p), dense.predicted_decrease(best.p)
    assert fall == pytest.approx(most, rel=1e-6)
    least = steps.SLIGHT_DAMPING * float(np.max(sparse.column_norms)) ** 2
    np.testing.assert_allclose(step.p, steps.svd(dense, least, D).p, rtol=0, atol=1e-6)


EXACT = ConjugateGradients(tolerance=1e-13)


UNKNOWNS = 240


def model(n: int = UNKNOWNS, seed: int = 0, dense_columns: int = 0) -> Linearization:
    """Rows that read three unknowns or fewer, and the first `dense_columns`."""
    rng = np.random.default_rng(seed)
    rows = random_array((n, n), density=2 / n, rng=rng, data_sampler=rng.standard_normal)
    J = np.vstack([rows.toarray(), np.eye(n) * rng.uniform(0.5, 50, n)])
    J[:, :dense_columns] += rng.standard_normal((2 * n, dense_columns))
    return Linearization(rng.standard_normal(2 * n), csc_array(J))


def test_conjugate_gradients_take_the_cholesky_step() -> None:
    for block, damping, dense_columns in [(1, 0.0, 0), (3, 3.0, 5), (7, 0.0, 5)]:
        here, D = model(dense_columns=dense_columns), np.linspace(0.5, 2, UNKNOWNS)
        expected = cholesky(here, damping, D)
        assert expected is not None
        step = ConjugateGradients(block, 1e-13)(here, damping, D)
        np.testing.assert_allclose(step.p, expected.p, rtol=0, atol=1e-10)


def test_conjugate_gradients_leave_undetermined_unknowns() -> None:
    here = model()
    J = here.jacobian.toarray()
    J[:, 30:33] = 0.0
    p = EXACT(Linearization(here.residual, csc_array(J)), 0.0, np.ones(UNKNOWNS)).p
    assert (p[30:33] == 0).all()
    expected = -np.linalg.lstsq(J, here.residual)[0]
    np.testing.assert_allclose(p, expected, atol=1e-10)
