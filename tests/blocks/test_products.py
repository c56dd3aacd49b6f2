"""Products of constant matrices, taken out of graphs, interpreted and compiled."""

import casadi as cs
import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.compilers import NEEDS_A_COMPILER
from workbench.blocks.batched import Mapped
from workbench.blocks.columns import Columns
from workbench.blocks.products import (
    ENOUGH,
    LEAST,
    TOGETHER,
    AfterProduct,
    Before,
    blocks_of,
    rows_together,
    taken_out,
    without_repeats,
)
from workbench.blocks.simd import simd_function

RNG = np.random.default_rng(3)
A, B = RNG.standard_normal((30, 20)), RNG.standard_normal((20, 30))
SMALL = RNG.standard_normal((3, 20))


def sparse(m: int, n: int, share: float) -> np.ndarray:
    return np.where(RNG.random((m, n)) < share, RNG.standard_normal((m, n)), 0.0)


def evaluated(inputs: list[cs.MX], expression: cs.MX, at: list[np.ndarray]) -> np.ndarray:
    return np.asarray(cs.Function("f", inputs, [expression])(*at)).ravel()


def test_what_is_left_and_the_products_are_the_whole() -> None:
    x, shift = cs.MX.sym("x", 20), RNG.standard_normal(30)
    whole = cs.sin(cs.mac(cs.DM(A), cs.cos(x), cs.MX(cs.DM(shift)))) + cs.sum1(cs.DM(SMALL) @ x)
    products, left = taken_out(whole, [x])
    (one,) = products
    assert_array_equal(one.matrix, A)
    assert np.count_nonzero(SMALL) < LEAST <= np.count_nonzero(A)
    at = RNG.standard_normal(20)
    u = evaluated([x], one.operand, [at])
    assert_allclose(u, np.cos(at), atol=1e-15)
    assert_allclose(one.of(u[None])[0], A @ np.cos(at) + shift, atol=1e-13)
    told = evaluated([x, one.result], left, [at, one.of(u[None])[0]])
    assert_allclose(told, evaluated([x], whole, [at]), atol=1e-12)


def test_a_product_of_a_product_stays() -> None:
    x = cs.MX.sym("x", 20)
    inner = cs.DM(A) @ x
    products, left = taken_out(cs.DM(B) @ cs.tanh(inner), [x])
    (one,) = products
    assert_array_equal(one.matrix, A)
    at = RNG.standard_normal(20)
    told = evaluated([x, one.result], left, [at, A @ at])
    assert_allclose(told, B @ np.tanh(A @ at), atol=1e-12)


def test_operands_may_be_held_to_some_inputs() -> None:
    x, y = cs.MX.sym("x", 20), cs.MX.sym("y", 30)
    both = cs.sumsqr(cs.DM(A) @ x) + cs.sumsqr(cs.DM(B) @ y)
    assert len(taken_out(both, [x, y])[0]) == 2
    (one,), _ = taken_out(both, [x, y], operands_of=[y])
    assert_array_equal(one.matrix, B)
    assert taken_out(cs.sumsqr(x), [x])[0] == []


def test_every_row_that_is_not_zero_is_in_one_group() -> None:
    matrix = sparse(47, 60, 0.2)
    matrix[[5, 17]] = 0.0
    groups = rows_together(matrix)
    assert sorted(np.concatenate(groups)) == [k for k in range(47) if k not in (5, 17)]
    assert max(map(len, groups)) == ENOUGH
    blocks = np.kron(np.eye(5), np.ones((TOGETHER + 2, 7)))  # rows that share all of their columns
    mixed = blocks[RNG.permutation(len(blocks))]
    for group in rows_together(mixed):
        assert len(group) == (TOGETHER + 2) // 2
        assert (mixed[group] == mixed[group[0]]).all()


def of_a_product(share: float) -> tuple[cs.Function, Before]:
    """A function of z (25,), of two numbers that are shared, and of what is made of these."""
    matrix = sparse(33, 25, share)
    z, still, y = cs.SX.sym("z", 25), cs.SX.sym("still", 2), cs.SX.sym("y", 33)
    w = cs.SX.sym("w", 2)
    first = cs.Function("before", [z, still], [cs.sin(z) + still[0], cs.exp(z[1:3])])
    rest = cs.vertcat(cs.sumsqr(y) + still[1], y, z[3], w)
    then = cs.Function("cost", [z, still, w, y], [rest])
    return then, Before(first, matrix)


def one_by_one(then: cs.Function, before: Before) -> AfterProduct:
    last = Mapped(then, (False, True, False, False))
    return AfterProduct(last, before, Mapped(before.function, (False, True)))


@pytest.mark.parametrize("share", [0.0, 0.02, 0.1, 1.0])
def test_products_between_steps_of_numpy(share: float) -> None:
    """Also for other numbers of rows, and after other arguments."""
    then, before = of_a_product(share)
    fast, slow = Columns(then, (False, True), before), one_by_one(then, before)
    for rows in (5, 300, 5):
        Z, numbers = RNG.standard_normal((rows, 25)), RNG.standard_normal(2)
        assert_allclose(fast(Z, numbers)[0], slow(Z, numbers)[0], rtol=1e-13, atol=1e-13)


def test_blocks_hold_every_element_once() -> None:
    matrix = np.zeros((7, 9))
    matrix[np.ix_([0, 2], [1, 8])] = 1.0
    matrix[3, 4:6] = 2.0
    matrix[[4, 6], [4, 0]] = 3.0
    found = blocks_of(matrix)
    assert sorted((r.tolist(), c.tolist()) for r, c in found) == [
        ([0, 2], [1, 8]),
        ([3, 4], [4, 5]),
        ([6], [0]),
    ]


def test_rows_that_come_again_are_kept_once() -> None:
    """With the other sign, and with rounding errors; but not with another factor or more error."""
    a, b = RNG.standard_normal((2, 6))
    rounded = a * (1 + 1e-16 * np.arange(6))
    rows = np.array([a, b, -a, 2 * a, rounded, -b, a + 1e-13, np.zeros(6)])
    once, stands_for, sign = without_repeats(rows)
    assert once.tolist() == [0, 1, 3, 6, 7]
    assert stands_for.tolist() == [0, 1, 0, 2, 0, 1, 3, 4]
    assert sign.tolist() == [1, 1, -1, 1, 1, -1, 1, 1]
    assert_allclose(sign[:, None] * rows[once][stands_for], rows, rtol=1e-14)


@pytest.mark.parametrize("size", [1e-310, 1e-200, 1e300])
def test_rows_of_tiny_or_huge_numbers_are_kept_once(size: float) -> None:
    """Whose products would be zero or infinite."""
    a = size * np.array([0.5, -1.0, 0.25])
    once, stands_for, sign = without_repeats(np.array([a, -a, a]))
    assert (once.tolist(), stands_for.tolist(), sign.tolist()) == ([0], [0, 0, 0], [1, -1, 1])


def test_rows_without_columns_are_one() -> None:
    once, stands_for, sign = without_repeats(np.zeros((3, 0)))
    assert (once.tolist(), stands_for.tolist(), sign.tolist()) == ([0], [0, 0, 0], [1, 1, 1])


@NEEDS_A_COMPILER
@pytest.mark.parametrize("share", [0.0, 0.02, 0.1, 1.0])
def test_compiled_products_are_those_of_numpy(share: float) -> None:
    """Also with rows of zeros, and with groups of every number of rows."""
    then, before = of_a_product(share)
    fast, slow = simd_function(then, (False, True), before), one_by_one(then, before)
    Z, numbers = RNG.standard_normal((21, 25)), RNG.standard_normal(2)
    assert_allclose(fast(Z, numbers)[0], slow(Z, numbers)[0], rtol=1e-13, atol=1e-13)
    for rows in (slice(0, 1), slice(4, 9), slice(7, 21)):  # each row as it would be alone
        assert_array_equal(fast(Z[rows], numbers)[0], fast(Z, numbers)[0][rows])


@NEEDS_A_COMPILER
def test_sines_and_cosines_are_right_to_the_last_digits() -> None:
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
