"""Unknowns whose units differ by many powers of ten: a unit does not make an unknown unseen."""

import casadi as cs
import mpmath as mp
import numpy as np
import pytest

from workbench import Block, Problem, Residual, diagnose
from workbench.problem import Linearization

M, N = 30, 8


def scales(rng: np.random.Generator, spread: float) -> np.ndarray:
    """Units that differ by up to 10^(2 spread), and by at least 10^(2 spread - 1)."""
    exponents = rng.uniform(-spread, spread, N)
    exponents[:2] = -spread + 0.5, spread - 0.5
    return 10.0 ** rng.permutation(exponents)


def linear(A: np.ndarray) -> tuple[Problem, dict]:
    x = Block("x", (N,)).symbol
    return Problem((Residual("fit", A @ x - 1, 1.0),), "x"), {"x": np.zeros(N)}


@pytest.mark.parametrize("spread", [4.0, 8.0, 12.0])
@pytest.mark.parametrize("seed", range(20))
def test_the_rank_knows_no_units(seed: int, spread: float) -> None:
    """Full; with a column that two others add up to; and with a column of zeros besides."""
    rng = np.random.default_rng(seed)
    A, D = rng.standard_normal((M, N)), scales(rng, spread)
    for rank in (8, 7, 6):
        problem, at = linear(A * D)
        found = diagnose(problem, at)
        assert found.rank == rank
        assert problem.linearize(at).rank == rank
        assert len(found.null_directions) == N - rank
        if rank == 8:
            A[:, 3] = A[:, 1] + A[:, 2]
        else:
            A[:, 5] = 0.0


def test_small_singular_values_have_as_many_digits_as_large_ones() -> None:
    rng = np.random.default_rng(3)
    A = rng.standard_normal((M, N)) * scales(rng, 12.0)
    with mp.workdps(60):
        exact = [float(s) for s in mp.svd_r(mp.matrix(A.tolist()), compute_uv=False)]
    found = Linearization(np.zeros(M), A).spectrum
    s, Vt = found.s, found.Vt
    # the columns are well-conditioned but for their lengths (about 5): eps times that, and more
    np.testing.assert_allclose(s, exact, rtol=1e-12)
    np.testing.assert_allclose(Vt @ Vt.T, np.eye(N), atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(A @ Vt.T, axis=0), exact, rtol=1e-10)


@pytest.mark.parametrize("shape", [(3, 8), (8, 8), (20, 8), (1, 1), (5, 1)])
def test_any_shape_has_all_its_right_singular_vectors(shape: tuple[int, int]) -> None:
    m, n = shape
    rng = np.random.default_rng(1)
    A = rng.standard_normal(shape) * 10.0 ** np.linspace(-9, 9, n)
    A[:, n // 2] = 0.0 if n > 1 else 1.0
    here = Linearization(np.zeros(m), A)
    s, Vt = here.spectrum.s, here.spectrum.Vt
    assert s.shape == (min(m, n),)
    np.testing.assert_allclose(Vt @ Vt.T, np.eye(n), atol=1e-13)
    assert here.rank == here.spectrum.rank == min(m, n - (n > 1))


@pytest.mark.parametrize("long", [1e8, 1e10, 1e12])
@pytest.mark.parametrize("short", [1e-12, 1e-4, 1.0])
@pytest.mark.parametrize("seed", range(5))
def test_what_long_columns_leave_unseen_is_not_blamed_on_a_short_one(
    seed: int, short: float, long: float
) -> None:
    """The rounding errors of dependent long columns are larger than a short one that is seen."""
    a, b, d = np.random.default_rng(seed).standard_normal((3, M))
    J = np.column_stack([a * long, b * long, (a + b) * long / 1.7, d * short])
    here = Linearization(np.zeros(M), J)
    assert here.rank == here.spectrum.rank == 3
    unseen = here.spectrum.Vt[-1]
    assert unseen[3] == 0
    assert np.linalg.norm(J @ unseen) < 1e-13 * long


def test_every_direction_that_is_called_unseen_changes_nothing() -> None:
    a, b = Block("a", (1,)).symbol, Block("b", (1,)).symbol
    problem = Problem((Residual("r", 1e8 * a + b, 1.0),), ("a", "b"))
    (found,) = diagnose(problem, {"a": [0.0], "b": [0.0]}).null_directions
    np.testing.assert_allclose(found.vector, [-1e-8, 1.0], rtol=1e-12)
    assert found.change < 1e-15


def test_an_unknown_of_its_own_large_size_is_no_rounding_error() -> None:
    """A change of x by its own size, 1e16, changes the residual by one sigma."""
    x, y = Block("x").symbol, Block("y").symbol
    problem = Problem((Residual("r", cs.vertcat(1e-16 * x - 1, 10 * (y - 1)), 1.0),), ("x", "y"))
    assert diagnose(problem, {"x": 1e16, "y": 1.0}).rank == 2
    assert diagnose(problem, {"x": 1.0, "y": 1.0}).rank == 1
