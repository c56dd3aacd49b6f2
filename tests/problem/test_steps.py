"""Three factorizations of one least-squares problem, and which of them is believed."""

import numpy as np
import pytest

from workbench import Linearization
from workbench.problem import steps


def conditioned(condition: float, m: int = 40, n: int = 6, seed: int = 0) -> Linearization:
    """A Jacobian of given singular values, in columns of equal length as nearly as may be."""
    rng = np.random.default_rng(seed)
    U, V = (np.linalg.qr(rng.normal(size=shape))[0] for shape in ((m, n), (n, n)))
    s = np.geomspace(1, 1 / condition, n)
    return Linearization(rng.normal(size=m), U * s @ V.T)


def exact(here: Linearization, damping: float, D: np.ndarray) -> np.ndarray:
    """The same by stacking and LAPACK's least squares."""
    A = np.concatenate([here.jacobian, np.sqrt(damping) * np.diag(D)])
    b = np.concatenate([here.residual, np.zeros(len(D))])
    return -np.linalg.lstsq(A, b, rcond=None)[0]


@pytest.mark.parametrize("damping", [0.0, 1e-3, 10.0])
@pytest.mark.parametrize("factorize", [steps.cholesky, steps.qr, steps.svd, steps.automatic])
def test_they_agree_where_all_can(factorize, damping: float) -> None:
    here, D = conditioned(10.0), np.array([1.0, 2, 3, 4, 5, 6])
    step = factorize(here, damping, D)
    np.testing.assert_allclose(step.p, exact(here, damping, D), rtol=1e-11)


def test_cholesky_declines_what_it_would_spoil() -> None:
    D = np.ones(6)
    assert steps.cholesky(conditioned(1e3), 0.0, D) is not None
    assert steps.cholesky(conditioned(1e5), 0.0, D) is None
    assert steps.cholesky(conditioned(1e5), 1.0, D) is not None  # damping conditions it
    assert steps.cholesky(Linearization(np.ones(2), np.zeros((2, 1))), 0.0, np.ones(1)) is None


@pytest.mark.parametrize("condition", [1e6, 1e8, 1e10])
def test_qr_does_not_square_the_condition(condition: float) -> None:
    """The answer is as good as LAPACK's; the normal equations lose twice as many digits."""
    here = conditioned(condition)
    truth = np.arange(1.0, 7.0)
    here = Linearization(-here.jacobian @ truth, here.jacobian)
    step = steps.qr(here, 0.0, np.ones(6))
    assert np.linalg.norm(step.p - truth) < 1e-14 * condition * np.linalg.norm(truth)
    normal = np.linalg.solve(here.normal, -here.gradient)
    assert np.linalg.norm(normal - truth) > 1e3 * np.linalg.norm(step.p - truth)


def test_units_do_not_make_a_problem_ill_conditioned() -> None:
    here = conditioned(10.0)
    units = np.geomspace(1e-8, 1e8, 6)
    scaled = Linearization(here.residual, here.jacobian / units)
    step = steps.automatic(scaled, 0.0, np.ones(6))
    assert step.by == "cholesky"
    np.testing.assert_allclose(step.p / units, steps.svd(here, 0.0, np.ones(6)).p, rtol=1e-10)


@pytest.mark.parametrize(
    ("condition", "by"), [(10.0, "cholesky"), (1e6, "qr"), (1e10, "qr"), (1e18, "svd")]
)
def test_the_automatic_choice_is_reported(condition: float, by: str) -> None:
    assert steps.automatic(conditioned(condition), 0.0, np.ones(6)).by == by


@pytest.mark.parametrize("damping", [1e-14, 1e-8, 1e-2])
def test_dependent_columns_are_told_apart_by_damping_alone(damping: float) -> None:
    """Two equal columns share their step equally, at any damping."""
    rng = np.random.default_rng(1)
    A = rng.normal(size=(30, 3))
    here = Linearization(rng.normal(size=30), np.column_stack([A, A[:, 2]]))
    p = steps.automatic(here, damping, np.ones(4)).p
    assert p[2] == pytest.approx(p[3], rel=1e-6)


@pytest.mark.parametrize("shape", [(40, 6), (6, 6), (3, 6)])
def test_the_triangle_is_the_problem_in_small(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(2)
    here = Linearization(rng.normal(size=shape[0]), rng.normal(size=shape))
    d, R, b = here.triangle
    assert R.shape == (min(shape), shape[1])
    np.testing.assert_allclose(R.T @ R * np.outer(d, d), here.normal, atol=1e-12)
    np.testing.assert_allclose(d * (R.T @ b), here.gradient, atol=1e-12)


def test_held_entries_move_the_rest_of_the_problem() -> None:
    here, p = conditioned(10.0), np.array([0.3, 0.0, 0.0, -0.2, 0.0, 0.0])
    held = p != 0
    smaller = here.without(held, p)
    np.testing.assert_allclose(smaller.residual, here.residual + here.jacobian @ p)
    np.testing.assert_allclose(smaller.normal, smaller.jacobian.T @ smaller.jacobian, atol=1e-14)
    assert smaller.jacobian.shape == (40, 4)


def test_the_promise_is_the_fall_of_the_model() -> None:
    p = np.random.default_rng(3).normal(size=6)
    for known in (False, True):
        here = conditioned(10.0)
        if known:
            _ = here.normal
        assert here.predicted_decrease(p) == pytest.approx(
            here.cost - here.predicted_cost(p), rel=1e-12
        )
