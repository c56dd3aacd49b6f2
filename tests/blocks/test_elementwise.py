"""NumPy finds the bits that CasADi finds, of graphs of a few operations on whole arrays."""

import casadi as cs
import numpy as np
import pytest

from workbench.blocks.batched import Buffered
from workbench.blocks.elementwise import Elementwise

POINTS, SEEN, X = cs.MX.sym("points", 3, 7), cs.MX.sym("seen", 21), cs.MX.sym("x", 4)
SIGMA = cs.MX(cs.DM(np.linspace(0.1, 0.9, 21)))
APART = cs.vec(POINTS - cs.reshape(SEEN, 3, 7))
LONGER = POINTS * 2.5
READ_AGAIN = cs.vec(LONGER - cs.reshape(cs.vec(LONGER) * SEEN, 3, 7))  # after a change of its copy


def function_of(residual: cs.MX) -> cs.Function:
    return cs.Function("residual", [X, SEEN, POINTS], [cs.densify(residual)])


@pytest.mark.parametrize(
    "residual", [APART / 0.01, 3 * APART + SEEN, (APART + SEEN) * APART, APART / SEEN, READ_AGAIN]
)
def test_the_same_bits_as_by_casadi(residual: cs.MX) -> None:
    function = function_of(residual)
    found = Elementwise.of(function)
    assert found is not None
    rng = np.random.default_rng(0)
    given = [rng.standard_normal(shape) for shape in (4, 21, (7, 3))]
    given[1][5] = 0.0  # what is divided by it is infinite, and no warning
    kept = [array.copy() for array in given]
    np.testing.assert_array_equal(found(*given)[0], Buffered(function)(*given)[0])
    for array, before in zip(given, kept, strict=True):
        np.testing.assert_array_equal(array, before)


@pytest.mark.parametrize(
    "residual", [APART * X[0], cs.sin(APART), APART / SIGMA, cs.vec(POINTS), 0.5 - APART]
)
def test_other_graphs_are_left_to_casadi(residual: cs.MX) -> None:
    assert Elementwise.of(function_of(residual)) is None


def test_a_residual_without_rows_is_left_to_casadi() -> None:
    function = function_of(cs.MX(0, 1))
    assert Elementwise.of(function) is None
    assert Buffered(function)(np.ones(4), np.ones(21), np.ones((7, 3)))[0].shape == (0,)
