"""Functions of many rows: NumPy, several cores and compiled code give what CasADi gives."""

import casadi as cs
import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.sparse import csr_array

from tests.blocks.operations import every_operation
from tests.compilers import NEEDS_A_COMPILER
from workbench.blocks import threaded
from workbench.blocks.batched import Buffered, Mapped, OneByOne
from workbench.blocks.columns import OF, WIDE, Columns
from workbench.blocks.elementwise import Elementwise
from workbench.blocks.products import AfterProduct, Before, taken_out
from workbench.blocks.simd import simd_function
from workbench.blocks.threaded import Threaded
from workbench.residuals.sparse_products import write_product

pytestmark = pytest.mark.thorough

RNG = np.random.default_rng(3)


def test_columns_have_every_operation_of_casadi() -> None:
    function, shared = every_operation(), (False, True)
    used = {function.instruction_id(i) for i in range(function.n_instructions())}
    assert len(used & set(OF)) >= 38
    X, Y = RNG.standard_normal((WIDE + 70, 3)), RNG.standard_normal(2)
    for rows in (slice(None), slice(3, 50)):
        fast, slow = Columns(function, shared)(X[rows], Y), Mapped(function, shared)(X[rows], Y)
        for one, other in zip(fast, slow, strict=True):
            assert_allclose(one, other, rtol=1e-13, atol=1e-15)


def test_columns_choose_without_warnings() -> None:
    a = cs.SX.sym("a")
    f = cs.Function("f", [a], [cs.if_else(a > 0, cs.log(a), 0), 1 / a])
    assert [out.shape for out in Columns(f, (False,))(np.empty((0, 1)))] == [(0, 1), (0, 1)]
    logs, inverse = Columns(f, (False,))(np.array([[-1.0], [0.0], [np.e]]))
    assert_array_equal(logs.ravel(), [0.0, 0.0, 1.0])  # the logarithm of -1 is not chosen
    assert_array_equal(inverse.ravel(), [-1.0, np.inf, 1 / np.e])


def test_elementwise_gives_the_bits_of_casadi() -> None:
    points, seen, x = cs.MX.sym("points", 3, 7), cs.MX.sym("seen", 21), cs.MX.sym("x", 4)
    apart = cs.vec(points - cs.reshape(seen, 3, 7))
    for residual in (apart / 0.01, 3 * apart + seen, apart / seen):
        function = cs.Function("residual", [x, seen, points], [cs.densify(residual)])
        fast = Elementwise.of(function)
        assert fast is not None
        arguments = [RNG.standard_normal(shape) for shape in (4, 21, (7, 3))]
        arguments[1][5] = 0.0  # what is divided by it is infinite, and no warning
        assert_array_equal(fast(*arguments)[0], Buffered(function)(*arguments)[0])


def test_threads_give_the_bits_of_one_core(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threaded, "available_cores", lambda: 2)
    x, p = cs.MX.sym("x", 2), cs.MX.sym("p", 2)
    function = cs.Function("f", [p, x], [cs.sin(x[0] * p) + cs.exp(x[1] - p)])
    shared = (False, True)
    for plain in (OneByOne(Buffered(function), shared), Mapped(function, shared)):
        run = Threaded(lambda plain=plain: plain, shared)
        run._seconds = {False: [1e-3] * 3, True: [1e-4] * 3}  # the clock says that threads pay
        for rows in (7, 32, 33, 3, 1):
            given = RNG.uniform(0.5, 1.0, (rows, 2)), np.array([1.0, 0.0])
            assert_array_equal(run(*given)[0], plain(*given)[0])


def test_sparse_products_are_those_of_arrays() -> None:

    dense = sparse(40, 60, 0.1)
    rows, into = RNG.standard_normal((21, 60)), np.full((21, 50), 7.0)
    write_product(csr_array(dense), rows, into[:, 5:45])
    assert_allclose(into[:, 5:45], rows @ dense.T, rtol=0, atol=1e-13)
    assert (into[:, [0, 4, 45, 49]] == 7).all()
    with pytest.raises(ValueError, match=r"broadcast|mismatch|dimension"):
        write_product(csr_array(dense), rows, into[:, :30])


# Products with constant matrices.


def sparse(m: int, n: int, share: float) -> np.ndarray:
    return np.where(RNG.random((m, n)) < share, RNG.standard_normal((m, n)), 0.0)


def evaluated(inputs: list[cs.MX], expression: cs.MX, at: list[np.ndarray]) -> np.ndarray:
    return np.asarray(cs.Function("f", inputs, [expression])(*at)).ravel()


def test_products_and_what_is_left_are_the_whole() -> None:
    A, small = RNG.standard_normal((30, 20)), RNG.standard_normal((3, 20))
    x, shift = cs.MX.sym("x", 20), RNG.standard_normal(30)
    whole = cs.sin(cs.mac(cs.DM(A), cs.cos(x), cs.MX(cs.DM(shift)))) + cs.sum1(cs.DM(small) @ x)
    products, left = taken_out(whole, [x])
    (one,) = products
    assert_array_equal(one.matrix, A)
    at = RNG.standard_normal(20)
    u = evaluated([x], one.operand, [at])
    assert_allclose(u, np.cos(at), atol=1e-15)
    assert_allclose(one.of(u[None])[0], A @ np.cos(at) + shift, atol=1e-13)
    told = evaluated([x, one.result], left, [at, one.of(u[None])[0]])
    assert_allclose(told, evaluated([x], whole, [at]), atol=1e-12)


def of_a_product(share: float) -> tuple[cs.Function, Before]:
    """A function of z (25,), of two numbers that are shared, and of what is made of these."""
    matrix = sparse(33, 25, share)
    z, still, y = cs.SX.sym("z", 25), cs.SX.sym("still", 2), cs.SX.sym("y", 33)
    w = cs.SX.sym("w", 2)
    first = cs.Function("before", [z, still], [cs.sin(z) + still[0], cs.exp(z[1:3])])
    rest = cs.vertcat(cs.sumsqr(y) + still[1], y, z[3], w)
    then = cs.Function("cost", [z, still, w, y], [rest])
    return then, Before(first, matrix)


@pytest.mark.parametrize("share", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("way", [Columns, pytest.param(simd_function, marks=NEEDS_A_COMPILER)])
def test_functions_after_products_are_casadis(way, share: float) -> None:
    then, before = of_a_product(share)
    fast = way(then, (False, True), before)
    last = Mapped(then, (False, True, False, False))
    slow = AfterProduct(last, before, Mapped(before.function, (False, True)))
    for rows in (5, 21, 300):
        Z, numbers = RNG.standard_normal((rows, 25)), RNG.standard_normal(2)
        assert_allclose(fast(Z, numbers)[0], slow(Z, numbers)[0], rtol=1e-13, atol=1e-13)


# Compiled code.


@NEEDS_A_COMPILER
def test_compiled_code_has_every_operation_of_casadi() -> None:
    function, shared = every_operation(), (False, True)
    X, Y = RNG.standard_normal((37, 3)), RNG.standard_normal(2)
    for rows in (slice(0, 1), slice(0, 37)):
        fast = simd_function(function, shared)(X[rows], Y)
        for one, other in zip(fast, Mapped(function, shared)(X[rows], Y), strict=True):
            assert_allclose(one, other, rtol=1e-13, atol=1e-15)


@NEEDS_A_COMPILER
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
