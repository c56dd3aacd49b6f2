"""Normal equations by compiled code are those of BLAS, zeros left out or not."""

import numpy as np
import pytest

from tests.compilers import NEEDS_A_COMPILER
from workbench.problem import Linearization, gram
from workbench.problem.gram import MANY, WIDEST, normal_equations

M, N = 6007, 61  # rows, not a whole number of blocks, and columns; enough of them


def random_jacobian(m: int = M, n: int = N) -> np.ndarray:
    """(m, n), stored column by column; half of it is zero in pieces of many rows."""
    rng = np.random.default_rng(0)
    J = rng.standard_normal((n, m)).T
    for j in range(0, n, 2):
        first = int(rng.integers(m // 2))
        J[first : first + m // 2, j] = 0.0
    J[:, 3] = 0.0
    return J


@NEEDS_A_COMPILER
@pytest.mark.parametrize(("m", "n"), [(M, N), (2**15, 25), (2**13, 85), (1000, 169)])
def test_products_are_those_of_blas(m: int, n: int) -> None:
    J, r = random_jacobian(m, n), np.random.default_rng(1).standard_normal(m)
    found = normal_equations(J, r)
    assert found is not None
    lengths = np.linalg.norm(J, axis=0)
    error = np.abs(found[0] - J.T @ J) / np.maximum(np.outer(lengths, lengths), 1e-300)
    assert error.max() < 1e-14
    np.testing.assert_array_equal(found[0], found[0].T)
    assert (np.abs(found[1] - J.T @ r) <= 1e-14 * lengths * np.linalg.norm(r)).all()
    again = normal_equations(J, r)
    assert again is not None
    np.testing.assert_array_equal(again[0], found[0])  # memory that is used again was cleared


@NEEDS_A_COMPILER
def test_numbers_that_are_not_finite_are_seen() -> None:
    J, r = random_jacobian(), np.zeros(M)
    J[4000, 5], J[17, 4] = np.nan, np.inf
    J[100:, 6], J[M - 1, 6] = 0.0, -0.0
    found = normal_equations(J, r)
    assert found is not None
    assert np.isnan(found[0][5]).any()
    assert np.isnan(found[1][5])  # beside a residual of zero
    assert found[0][4, 4] == np.inf
    assert np.isfinite(found[0][7, 7])


@NEEDS_A_COMPILER
def test_a_step_is_the_same_with_and_without_compiled_products(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    J = random_jacobian()
    J[5, 3] = 1.0  # no column without a number
    r = np.random.default_rng(2).standard_normal(M)
    compiled = Linearization(r, J)
    p = compiled.step(0.1)
    assert "gradient" in vars(compiled)  # from the same pass
    monkeypatch.setattr(gram, "compiled", lambda: None)
    plain = Linearization(r, J)
    np.testing.assert_allclose(p, plain.step(0.1), rtol=0, atol=1e-13 * np.abs(p).max())


def test_blas_is_asked_where_that_is_as_fast_or_rows_are_stored() -> None:
    J, r = random_jacobian(), np.zeros(M)
    assert normal_equations(J[:1000], r[:1000]) is None
    assert 1000 * N * N < MANY
    assert normal_equations(np.ascontiguousarray(J), r) is None
    assert normal_equations(random_jacobian(1000, WIDEST + 1), np.zeros(1000)) is None
    assert normal_equations(J[::2], r[::2]) is None
