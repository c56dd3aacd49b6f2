"""Normal equations of a sequence: a band with a border equals the dense matrix, and its inverse."""

import numpy as np
import pytest
from scipy.sparse import csc_array

import workbench as wb
from tests.problem.sequences import (
    SHARED,
    SMOOTH,
    assert_numbers,
    frame,
    in_blocks_of_frames,
    values,
)
from tests.tiers import few
from workbench.problem import storage
from workbench.problem.banded import BandedMatrix, BandOrder, BlockMatrix

Array = np.ndarray


def order_made_up(sizes: list[int], border: int, reach: int, seed: int = 0) -> BandOrder:
    """Frames of these sizes, and shared unknowns, shuffled among each other."""
    N = sum(sizes)
    places = np.random.default_rng(seed).permutation(N + border)
    edges = np.concatenate([[0], np.cumsum(sizes)])
    return BandOrder(places[:N], places[N:], reach, edges)


def banded(order: BandOrder, seed: int = 0) -> tuple[BandedMatrix, Array]:
    """A positive definite matrix of this order, stored in it and as an array."""
    rng = np.random.default_rng(seed)
    n, N = order.size, len(order.inner)
    A = np.zeros((n, n))
    i, j = np.indices((N, N))
    band = np.where(abs(i - j) <= order.reach, rng.standard_normal((N, N)), 0.0)
    A[np.ix_(order.inner, order.inner)] = band + band.T
    between = rng.standard_normal((N, len(order.border)))
    A[np.ix_(order.inner, order.border)] = between
    A[np.ix_(order.border, order.inner)] = between.T
    corner = rng.standard_normal((len(order.border), len(order.border)))
    A[np.ix_(order.border, order.border)] = corner + corner.T
    A += np.diag(np.abs(A).sum(axis=1) + rng.uniform(1, 2, n))
    matrix = BandedMatrix.zeros(order)
    matrix.add_sparse(csc_array(A))
    return matrix, A


ORDERS = {
    "frames alike": order_made_up([3, 3, 3, 3], 2, 5),
    "a wide band": order_made_up([3, 3, 3, 3], 2, 8),
    "frames apart": order_made_up([3, 3, 3], 2, 2),
    "no border": order_made_up([2, 2, 2], 0, 3),
    "frames of other sizes": order_made_up([4, 1, 0, 3], 1, 4),
    "one frame": order_made_up([5], 3, 4),
    "single numbers": order_made_up([1] * 6, 1, 1),
    "a border alone": order_made_up([0, 0], 3, 0),
    "a diagonal": order_made_up([1] * 4, 0, 0),
}
EACH = pytest.mark.parametrize(
    "order",
    few(
        [pytest.param(order, id=name) for name, order in ORDERS.items()],
        ("frames alike", "frames of other sizes", "no border"),
    ),
)


# Matrices.


@EACH
def test_factorizedmatrix_is_the_dense_matrix(order: BandOrder) -> None:
    matrix, A = banded(order)
    x = np.random.default_rng(1).standard_normal(order.size)
    np.testing.assert_allclose(storage.dense(matrix), A, atol=1e-14)
    np.testing.assert_allclose(matrix.sparse.toarray(), A, atol=1e-14)
    np.testing.assert_allclose(matrix @ x, A @ x, atol=1e-12)
    np.testing.assert_allclose(x @ matrix, A @ x, atol=1e-12)
    np.testing.assert_allclose(matrix.diagonal(), np.diag(A), atol=1e-14)


@EACH
def test_factorizedfactor_solves_as_the_dense_one(order: BandOrder) -> None:
    matrix, A = banded(order)
    rng = np.random.default_rng(1)
    b, B = rng.standard_normal(order.size), rng.standard_normal((order.size, 3))
    factor = matrix.factorized()
    assert factor is not None
    np.testing.assert_allclose(factor.solve(b), np.linalg.solve(A, b), atol=1e-12)
    np.testing.assert_allclose(factor.solve(B), np.linalg.solve(A, B), atol=1e-12)


@EACH
def test_indefinite_matrices_have_no_factor(order: BandOrder) -> None:
    _, A = banded(order)

    def factor(matrix: Array) -> object:
        stored = BandedMatrix.zeros(order)
        stored.add_sparse(csc_array(matrix))
        return stored.factorized()

    assert factor(A) is not None
    for i in range(order.size):
        wrong = A.copy()
        wrong[i, i] = -1.0
        assert factor(wrong) is None
        wrong[i, i] = np.nan
        assert factor(wrong) is None
        wrong[i] = wrong[:, i] = 0.0
        assert factor(wrong) is None
    if order.size > 1 and (order.reach or len(order.border) > 1):
        some = order.inner if order.reach else order.border
        i, j = some[:2]
        J = np.linalg.cholesky(A).T
        J[:, j] = J[:, i]  # two columns that are the same
        N = J.T @ J * (A != 0)
        assert factor(N) is None


# Jacobians of sequences.


@pytest.fixture
def blocked(monkeypatch: pytest.MonkeyPatch) -> wb.Linearization:
    in_blocks_of_frames(monkeypatch)
    whole = wb.sequence([frame()] * 5, shared=SHARED, between=SMOOTH)
    here = whole.linearize(values(5))
    assert isinstance(here.jacobian, BlockMatrix)
    return here


def as_array(here: wb.Linearization) -> wb.Linearization:
    return wb.Linearization(here.residual, here.dense)


def test_blocks_of_frames_answer_as_the_dense_jacobian(blocked: wb.Linearization) -> None:
    dense = as_array(blocked)
    J, n = dense.jacobian, blocked.shape[1]
    rng = np.random.default_rng(0)
    p, r = rng.standard_normal(n), rng.standard_normal(len(J))
    near = 1e-12 * np.abs(J).max()
    assert blocked.estimated
    assert isinstance(blocked.normal, BandedMatrix)
    np.testing.assert_allclose(storage.dense(blocked.normal), J.T @ J, rtol=0, atol=near**2 + 1e-9)
    np.testing.assert_allclose(blocked.jacobian @ p, J @ p, rtol=0, atol=10 * near)
    np.testing.assert_allclose(blocked.jacobian.T @ r, J.T @ r, rtol=0, atol=10 * near)
    np.testing.assert_allclose(blocked.gradient, dense.gradient, rtol=1e-9, atol=100 * near)
    np.testing.assert_allclose(blocked.column_norms, dense.column_norms, rtol=1e-12)
    assert blocked.norm == pytest.approx(dense.norm, rel=1e-12)
    assert blocked.predicted_decrease(p) == pytest.approx(dense.predicted_decrease(p), rel=1e-11)
    assert blocked.predicted_cost(p) == pytest.approx(dense.predicted_cost(p), rel=1e-11)
    assert blocked.rank == dense.rank == n
    assert blocked.finite
    np.testing.assert_allclose(blocked.singular_values, dense.singular_values, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(blocked.covariance, dense.covariance, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(blocked.spectrum.s, dense.spectrum.s, rtol=1e-5)
    part = np.array([3, 1, 7])
    mask = np.isin(np.arange(n), part)
    for one, other in (
        (blocked.rows(part), dense.rows(part)),
        (blocked.columns(part), dense.columns(part)),
        (blocked.block(slice(2, 90), slice(1, 40)), dense.block(slice(2, 90), slice(1, 40))),
        (blocked.scaled(np.linspace(0.1, 3, n)), dense.scaled(np.linspace(0.1, 3, n))),
        (blocked.along_columns(np.eye(n)[:, :3]), dense.along_columns(np.eye(n)[:, :3])),
        (blocked.without(mask, p), dense.without(mask, p)),
    ):
        np.testing.assert_allclose(one.dense, other.dense, rtol=0, atol=near)
        np.testing.assert_allclose(one.residual, other.residual, rtol=0, atol=10 * near)
    for i in (0, n // 2, n - 1):
        np.testing.assert_allclose(blocked.column(i), J[:, i], rtol=0, atol=near)
        np.testing.assert_array_equal(blocked.column(i) != 0, J[:, i] != 0)


def test_held_frames_leave_a_band(monkeypatch: pytest.MonkeyPatch) -> None:
    in_blocks_of_frames(monkeypatch)
    whole = wb.sequence([frame()] * 4, shared=SHARED, between=SMOOTH)
    for free in (
        ("pose[0]", "pose[2:4]", "betas"),
        ("trans", "pose[:, joint1]"),
        ("betas",),
        ("pose[2, joint1, x]",),
    ):
        part = whole.freeing(*free)
        here = assert_numbers(part, values(4))
        step, expected = here.step(1e-2), as_array(here).step(1e-2)
        np.testing.assert_allclose(step, expected, rtol=0, atol=1e-10 * np.abs(expected).max())
