"""Functions of many rows, by NumPy and by CasADi's machine."""

import casadi as cs
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.blocks.operations import every_operation
from workbench.blocks.batched import Mapped
from workbench.blocks.columns import KEPT, MANY, OF, WIDE, Columns, FewOrMany
from workbench.errors import NotSupported

SHARED = False, True
RNG = np.random.default_rng(1)
F = every_operation()
X, Y = RNG.standard_normal((WIDE + 70, 3)), RNG.standard_normal(2)


def test_every_instruction_is_casadis() -> None:
    used = {F.instruction_id(i) for i in range(F.n_instructions())}
    assert len(used & set(OF)) >= 38
    for fast, slow in zip(Columns(F, SHARED)(X, Y), Mapped(F, SHARED)(X, Y), strict=True):
        assert_allclose(fast, slow, rtol=1e-13, atol=1e-15)


def test_a_row_is_the_same_among_many_and_alone() -> None:
    columns = Columns(F, SHARED)
    whole = columns(X, Y)
    for some in (slice(0, 1), slice(3, 50), slice(WIDE - 2, WIDE + 9), slice(0, WIDE), slice(7, 9)):
        for one, all_of in zip(columns(X[some], Y), whole, strict=True):
            assert_allclose(one, all_of[some], rtol=1e-15, atol=0)
    assert len(columns._made) == KEPT


def test_no_rows_and_numbers_that_are_none() -> None:
    a = cs.SX.sym("a")
    f = cs.Function("f", [a], [cs.if_else(a > 0, cs.log(a), 0), 1 / a])
    assert [out.shape for out in Columns(f, (False,))(np.empty((0, 1)))] == [(0, 1), (0, 1)]
    logs, inverse = Columns(f, (False,))(np.array([[-1.0], [0.0], [np.e]]))
    assert_array_equal(logs.ravel(), [0.0, 0.0, 1.0])  # the logarithm of -1 is not chosen
    assert_array_equal(inverse.ravel(), [-1.0, np.inf, 1 / np.e])


def test_few_rows_are_casadis_and_many_are_numpys(monkeypatch: pytest.MonkeyPatch) -> None:
    both = FewOrMany(F, SHARED)
    assert_array_equal(both(X[: MANY - 1], Y)[0], Mapped(F, SHARED)(X[: MANY - 1], Y)[0])
    assert_array_equal(both(X[:MANY], Y)[0], Columns(F, SHARED)(X[:MANY], Y)[0])
    monkeypatch.delitem(OF, cs.OP_SIN)  # type: ignore[arg-type]
    with pytest.raises(NotSupported, match="in 'all' has no NumPy here"):
        Columns(F, SHARED)
    assert_array_equal(FewOrMany(F, SHARED)(X, Y)[0], Mapped(F, SHARED)(X, Y)[0])
