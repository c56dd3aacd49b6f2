"""Linearizations: predictions, steps by every factorization, covariances and optimality."""

import casadi as cs
import numpy as np
import pytest

from tests.bodies_made_up import random_body
from tests.compilers import NEEDS_A_COMPILER
from tests.tiers import few
from workbench import Block, Linearization, Problem, Residual, residuals
from workbench.problem import steps
from workbench.problem.optimality import Rounding
from workbench.problem.storage import normal_equations

RNG = np.random.default_rng(0)
A, B = RNG.normal(size=(10, 4)), RNG.normal(size=10)


def test_cost_gradient_and_predictions_match_formulas() -> None:
    here = Linearization(B, A)
    assert here.cost == pytest.approx(0.5 * np.sum(B**2))
    np.testing.assert_allclose(here.gradient, A.T @ B)
    np.testing.assert_allclose(here.normal, A.T @ A)
    np.testing.assert_allclose(here.column_norms, [np.linalg.norm(a) for a in A.T])
    p = RNG.normal(size=4)
    assert here.predicted_cost(p) == pytest.approx(0.5 * np.sum((B + A @ p) ** 2))
    assert here.predicted_cost(np.zeros(4)) == pytest.approx(here.cost)
    slope = (here.predicted_cost(1e-6 * p) - here.predicted_cost(-1e-6 * p)) / 2e-6
    assert slope == pytest.approx(here.gradient @ p, rel=1e-8)


# Steps.


def test_steps_solve_the_normal_equations() -> None:
    for damping in [0.0, 10.0]:
        scaling = np.array([0.1, 1.0, 2.0, 30.0])
        p = Linearization(B, A).step(damping, scaling)
        D = np.diag(scaling)
        np.testing.assert_allclose((A.T @ A + damping * D @ D) @ p, -A.T @ B, atol=1e-12)


def test_damping_goes_from_gauss_newton_to_gradient() -> None:
    here = Linearization(B, A)
    np.testing.assert_allclose(here.step(1e-14), here.step(), rtol=1e-12)
    np.testing.assert_allclose(here.step(1e14), -here.gradient / 1e14, rtol=1e-12)
    lengths = [np.linalg.norm(here.step(damping)) for damping in (0, 0.1, 1, 10, 100)]
    assert (np.diff(lengths) < 0).all()


def test_step_without_full_rank_is_the_shortest() -> None:
    for J in [
        np.column_stack([A, A[:, 0] + A[:, 1]]),  # one direction too many
        np.column_stack([A, np.zeros(10)]),  # an entry that nothing reads
        A[:3],  # fewer rows than columns
        np.zeros((10, 3)),
    ]:
        r = B[: len(J)]
        here = Linearization(r, J)
        p = here.step()
        np.testing.assert_allclose(p, np.linalg.lstsq(J, -r)[0], atol=1e-12)
        # damping picks the same one in the limit; Cholesky may lose eps (1e6)^2 of it on the way
        for damping in (1e-8, 1e-10, 1e-12, 1e-15, 1e-20):
            off = np.linalg.norm(here.step(damping) - p)
            assert off <= 1e-3 * np.linalg.norm(p)


def test_scaled_step_is_one_in_other_units() -> None:
    """Also where J is too ill conditioned for Cholesky: there damping meets singular values."""
    J = A @ np.diag([1.0, 1e-3, 1e-6, 1e-9])
    D = np.array([1.0, 3.0, 0.5, 2.0])
    p = Linearization(B, J).step(1e-18, D)
    stacked = np.vstack([J, 1e-9 * np.diag(D)])
    expected = np.linalg.lstsq(stacked, np.concatenate([-B, np.zeros(4)]), rcond=1e-30)[0]
    np.testing.assert_allclose(p, expected, rtol=1e-5)  # 1e9 eps, and a little
    assert np.isfinite(Linearization(B, 1e-200 * A).step()).all()  # whose squares are zero


def test_rank_is_scale_invariant() -> None:
    dependent = np.column_stack([A, A @ RNG.normal(size=(4, 2))])
    assert Linearization(B, A).rank == 4
    assert Linearization(B, dependent).rank == 4
    assert Linearization(B, 1e-200 * A).rank == 4  # units do not matter
    assert Linearization(B, np.zeros((10, 4))).rank == 0
    assert Linearization(B, np.zeros((10, 0))).rank == 0


# Covariance.


def test_covariance_of_a_linear_problem_is_analytic() -> None:
    x, sigma = Block("x", (4,)).symbol, RNG.uniform(0.1, 2, 10)
    problem = Problem((Residual("fit", A @ x - B, sigma),), ("x",))
    covariance = problem.linearize({"x": np.zeros(4)}).covariance
    analytic = np.linalg.inv(A.T @ np.diag(sigma**-2) @ A)
    np.testing.assert_allclose(covariance, analytic, rtol=1e-11, atol=1e-14)


def test_undetermined_unknowns_have_infinite_variance() -> None:
    J = np.column_stack([A[:, 0], A[:, 1], A[:, 1], A[:, 2], np.zeros(10)])
    C = Linearization(B, J).covariance
    blind, seen = [1, 2, 4], np.ix_([0, 3], [0, 3])
    assert (C[blind, blind] == np.inf).all()
    assert np.isnan(C[0, blind]).all()
    assert np.isnan(C[blind, 3]).all()
    without = np.linalg.inv(A[:, [0, 2, 1]].T @ A[:, [0, 2, 1]])[:2, :2]
    np.testing.assert_allclose(C[seen], without, rtol=1e-12)


def test_covariance_is_equivariant_under_units() -> None:
    """A parameter of size 1e-12 is no unseen one: columns count by their angles alone."""
    for units in [1e-12, 1e9]:
        D = np.array([units, 1.0, 1.0 / units, 1.0])
        covariance = Linearization(B, A * D).covariance
        np.testing.assert_allclose(covariance, np.linalg.inv(A.T @ A) / np.outer(D, D), rtol=1e-10)
        dependent = np.column_stack([A * D, A[:, 0] + A[:, 1]])
        C = Linearization(B, dependent).covariance
        assert (np.diag(C)[[0, 1, 4]] == np.inf).all()
        without = np.linalg.inv(A.T @ A)[2:, 2:] / np.outer(D, D)[2:, 2:]
        np.testing.assert_allclose(C[2:4, 2:4], without, rtol=1e-10)


# What converged means.


def optimality(problem: Problem, values: dict, rounding: Rounding | None = None) -> float:
    return problem.optimality(problem.split(values)[0], problem.linearize(values), rounding)


def curve(scale: float = 1.0, sigma: float = 0.1) -> Problem:
    """A small nonlinear regression in an unknown whose unit is `scale` times smaller."""
    x, t = Block("x", (2,)).symbol / scale, np.linspace(0, 1, 7)
    model = x[0] * np.exp(t) + cs.sin(x[1] * t)
    return Problem((Residual("fit", model - B[:7], sigma),), ("x",))


def test_optimality_is_the_largest_cosine() -> None:
    problem = curve()
    here = problem.linearize({"x": [0.3, -0.2]})
    cosines = [
        abs(column @ here.residual) / np.linalg.norm(column) / np.linalg.norm(here.residual)
        for column in here.jacobian.T
    ]
    assert optimality(problem, {"x": [0.3, -0.2]}) == pytest.approx(max(cosines), rel=1e-14)


def test_optimality_is_zero_at_minima_and_at_most_one() -> None:
    x = Block("x", (4,)).symbol
    problem = Problem((Residual("fit", A @ x - B, 1.0),), ("x",))
    least = np.linalg.lstsq(A, B)[0]
    assert optimality(problem, {"x": least}) < 1e-14
    for point in least + 10.0 ** RNG.uniform(-3, 8, (50, 1)) * RNG.normal(size=(50, 4)):
        assert 0 < optimality(problem, {"x": point}) <= 1 + 1e-15
    single = Problem((residuals.gaussian(Block("s").symbol),), ("s",))
    assert optimality(single, {"s": 3.0}) == 1
    assert optimality(single, {"s": 0.0}) == 0


def test_optimality_is_invariant_under_units() -> None:
    for scale, sigma in [(1e-6, 0.1), (1e6, 1e-6)]:
        here = optimality(curve(), {"x": np.array([0.3, -0.2])})
        there = optimality(curve(scale, sigma), {"x": scale * np.array([0.3, -0.2])})
        assert there == pytest.approx(here, rel=1e-12)


def test_entry_held_by_a_bound_is_stationary() -> None:
    x = Block("x", (2,)).symbol
    residual = residuals.gaussian(x, mean=[3.0, 0.5], covariance=0.1**2)
    problem = Problem((residual,), ("x",), {"x": (0.0, 1.0)})
    assert optimality(problem, {"x": [1.0, 0.5]}) == 0
    assert optimality(problem, {"x": [1.0, 0.6]}) > 0.04
    assert optimality(problem, {"x": [0.0, 0.5]}) > 0.3  # a bound, but the other one
    # an interior point method only comes near the bound: the way left counts, in sigmas
    near = optimality(problem, {"x": [1.0 - 1e-9, 0.5]})
    assert near == pytest.approx(1e-9 / 2, rel=1e-6)
    free = Problem((residual,), ("x",))
    assert optimality(free, {"x": [1.0, 0.5]}) == pytest.approx(1.0)


def test_optimality_ignores_what_nothing_reads() -> None:
    x = Block("x", (3,)).symbol
    bounded = {"x": (0.0, np.inf)}
    problem = Problem((residuals.gaussian(x[:2], mean=1.0),), ("x",), bounded)
    assert optimality(problem, {"x": [1.0, 1.0, 7.0]}) == 0
    assert optimality(problem, {"x": [1.0, 2.0, 7.0]}) == pytest.approx(1.0)


@pytest.mark.parametrize("seed", few(range(2), 1))
def test_rounding_explains_noiseless_residuals_alone(seed: int) -> None:
    body = random_body(seed, n_vertices=50)
    symbols = [block.symbol for block in body.blocks()]
    observed = Block("observed", (50, 3), "m").symbol
    problem = Problem(
        (residuals.vertices(body.points(*symbols), observed, sigma=0.002),),
        ("pose", "betas", "trans"),
    )
    rng = np.random.default_rng(seed)
    truth = {
        "pose": rng.normal(size=(5, 3)),
        "betas": rng.normal(size=3),
        "trans": rng.normal(size=3),
    }
    values = truth | {"observed": body.vertices(*truth.values())}
    x, fixed = problem.split(values)
    rounding = problem.rounding(x, fixed, problem.residual(x, fixed))
    assert optimality(problem, values, rounding) == 0
    # a thousandth of a micrometre is no rounding error
    off = values | {"trans": truth["trans"] + [1e-9, 0, 0]}
    assert optimality(problem, off, rounding) > 1e-3
    assert 0 < rounding.norm < 1e-9 / 0.002


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


@pytest.mark.parametrize("damping", [1e-3])
@pytest.mark.parametrize("factorize", [steps.cholesky, steps.qr, steps.svd, steps.automatic])
def test_factorizations_agree_when_well_conditioned(factorize, damping: float) -> None:
    here, D = conditioned(10.0), np.array([1.0, 2, 3, 4, 5, 6])
    step = factorize(here, damping, D)
    np.testing.assert_allclose(step.p, exact(here, damping, D), rtol=1e-11)


def test_cholesky_declines_ill_conditioned_matrices() -> None:
    D = np.ones(6)
    assert steps.cholesky(conditioned(1e3), 0.0, D) is not None
    assert steps.cholesky(conditioned(1e5), 0.0, D) is None
    assert steps.cholesky(conditioned(1e5), 1.0, D) is not None  # damping conditions it
    assert steps.cholesky(Linearization(np.ones(2), np.zeros((2, 1))), 0.0, np.ones(1)) is None


@pytest.mark.parametrize("condition", [1e8])
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


def test_automatic_choice_is_reported() -> None:
    for condition, by in ((10.0, "cholesky"), (1e6, "qr"), (1e10, "qr"), (1e18, "svd")):
        assert steps.automatic(conditioned(condition), 0.0, np.ones(6)).by == by


ROWS, COLUMNS = 6007, 61  # rows, not a whole number of blocks, and columns; enough of them


def random_jacobian(m: int = ROWS, n: int = COLUMNS) -> np.ndarray:
    """(m, n), stored column by column; half of it is zero in pieces of many rows."""
    rng = np.random.default_rng(0)
    J = rng.standard_normal((n, m)).T
    for j in range(0, n, 2):
        first = int(rng.integers(m // 2))
        J[first : first + m // 2, j] = 0.0
    J[:, 3] = 0.0
    return J


@NEEDS_A_COMPILER
def test_compiled_normal_equations_match_blas() -> None:
    for m, n in [(ROWS, COLUMNS), (1000, 169)]:
        J, r = random_jacobian(m, n), np.random.default_rng(1).standard_normal(m)
        products = normal_equations(J, r)
        assert products is not None
        lengths = np.linalg.norm(J, axis=0)
        error = np.abs(products[0] - J.T @ J) / np.maximum(np.outer(lengths, lengths), 1e-300)
        assert error.max() < 1e-14
        np.testing.assert_array_equal(products[0], products[0].T)
        assert (np.abs(products[1] - J.T @ r) <= 1e-14 * lengths * np.linalg.norm(r)).all()
        again = normal_equations(J, r)
        assert again is not None
        np.testing.assert_array_equal(again[0], products[0])  # memory is used again


@NEEDS_A_COMPILER
def test_compiled_normal_equations_keep_nonfinite_numbers() -> None:
    J, r = random_jacobian(), np.zeros(ROWS)
    J[4000, 5], J[17, 4] = np.nan, np.inf
    J[100:, 6], J[ROWS - 1, 6] = 0.0, -0.0
    products = normal_equations(J, r)
    assert products is not None
    assert np.isnan(products[0][5]).any()
    assert np.isnan(products[1][5])  # beside a residual of zero
    assert products[0][4, 4] == np.inf
    assert np.isfinite(products[0][7, 7])
