"""CasADi functions of many arguments at once, compiled and with products: CasADi's numbers."""

import casadi as cs
import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import coo_array, csc_array

from tests.compilers import NEEDS_A_COMPILER
from workbench.blocks.functions import Mapped, sparse_constant
from workbench.blocks.simd import ConstantProduct, simd_function

RNG = np.random.default_rng(3)


@pytest.mark.browser
@pytest.mark.parametrize("kind", [csc_array, coo_array])
def test_sparse_constant_is_the_same_matrix(kind) -> None:
    given = kind(([1.0, 2.0, 0.0, 4.0], ([2, 0, 1, 0], [0, 1, 1, 0])), shape=(3, 4))
    found = sparse_constant(given)
    np.testing.assert_array_equal(np.asarray(cs.densify(found)), given.toarray())
    assert found.nnz() == 4  # a stored zero is an entry


@pytest.mark.browser
def test_sparse_constant_sorts_and_sums_entries_in_a_copy() -> None:
    given = csc_array(([1.0, 2.0, 3.0], [2, 0, 2], [0, 3]), shape=(3, 1))
    np.testing.assert_array_equal(np.asarray(sparse_constant(given)).ravel(), [2, 0, 4])
    assert given.indices.tolist() == [2, 0, 2]


@pytest.mark.browser
def test_mapped_functions_give_one_row_for_each_call() -> None:
    x, p = cs.MX.sym("x", 2), cs.MX.sym("p", 2)
    function = cs.Function("f", [p, x], [cs.sin(x[0] * p) + cs.exp(x[1] - p)])
    at = np.array([1.0, 0.0])
    for rows in (0, 1, 31, 32, 33):
        P = RNG.uniform(0.5, 1.0, (rows, 2))
        (found,) = Mapped(function, (False, True))(P, at)
        assert_allclose(found, np.sin(P) + np.exp(-P), rtol=1e-14)


# Compiled code.


@NEEDS_A_COMPILER
@pytest.mark.thorough
@pytest.mark.parametrize("share", [0.0, 0.1, 1.0])
def test_compiled_functions_after_products_are_casadis(share: float) -> None:
    matrix = np.where(RNG.random((33, 25)) < share, RNG.standard_normal((33, 25)), 0.0)
    z, still, y = cs.SX.sym("z", 25), cs.SX.sym("still", 2), cs.SX.sym("y", 33)
    w = cs.SX.sym("w", 2)
    first = cs.Function("before", [z, still], [cs.sin(z) + still[0], cs.exp(z[1:3])])
    then = cs.Function("cost", [z, still, w, y], [cs.vertcat(cs.sumsqr(y) + still[1], y, z[3], w)])
    fast = simd_function(then, (False, True), ConstantProduct(first, matrix))
    for rows in (5, 21, 300):
        Z, numbers = RNG.standard_normal((rows, 25)), RNG.standard_normal(2)
        Y = (np.sin(Z) + numbers[0]) @ matrix.T
        right = np.column_stack([(Y**2).sum(axis=1) + numbers[1], Y, Z[:, 3], np.exp(Z[:, 1:3])])
        assert_allclose(fast(Z, numbers)[0], right, rtol=1e-12, atol=1e-13)


@NEEDS_A_COMPILER
@pytest.mark.thorough
def test_compiled_sines_are_right_to_two_units() -> None:
    x = cs.SX.sym("x")
    f = simd_function(cs.Function("turn", [x], [cs.vertcat(cs.sin(x), cs.cos(x))]), (False,))
    quarters = np.pi / 2 * np.arange(-40, 41)
    near = (quarters[:, None] + np.array([-1e-9, 0.0, 1e-9, 0.3, np.pi / 4])).ravel()
    at = np.concatenate(
        [near, np.random.default_rng(0).uniform(-1e5, 1e5, 200), [0.0, 1e-300, 99999.9]]
    )
    found = f(at[:, None])[0]
    with mpmath.workprec(200):
        right = [[float(mpmath.sin(a)), float(mpmath.cos(a))] for a in map(mpmath.mpf, at)]
    ulps = np.abs(found - right) / np.spacing(np.abs(right))
    assert ulps.max() <= 2
    special = np.array([-0.0, 3e7, -1e300, np.nan, np.inf, 0.5])
    found = f(special[:, None])[0]
    with np.errstate(invalid="ignore"):
        assert_allclose(found, np.stack([np.sin(special), np.cos(special)], axis=1), rtol=1e-15)
    assert np.signbit(found[0, 0])
