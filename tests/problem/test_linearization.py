"""Steps, covariances and convergence: the textbook formulas on one linearization."""

import casadi as cs
import numpy as np
import pytest

from tests.bodies_made_up import random_body
from workbench import Block, Linearization, Problem, Residual, residuals
from workbench.problem.rounding import Rounding

RNG = np.random.default_rng(0)
A, B = RNG.normal(size=(10, 4)), RNG.normal(size=10)


def test_cost_gradient_and_predictions_are_the_textbooks() -> None:
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


@pytest.mark.parametrize("damping", [0.0, 1e-3, 10.0])
@pytest.mark.parametrize("scaling", [1.0, np.array([0.1, 1.0, 2.0, 30.0])])
def test_steps_solve_the_normal_equations(damping: float, scaling: np.ndarray) -> None:
    p = Linearization(B, A).step(damping, scaling)
    D = np.diag(np.broadcast_to(scaling, 4))
    np.testing.assert_allclose((A.T @ A + damping * D @ D) @ p, -A.T @ B, atol=1e-12)


def test_small_damping_is_gauss_newton_and_large_a_short_way_downhill() -> None:
    here = Linearization(B, A)
    np.testing.assert_allclose(here.step(1e-14), here.step(), rtol=1e-12)
    np.testing.assert_allclose(here.step(1e14), -here.gradient / 1e14, rtol=1e-12)
    lengths = [np.linalg.norm(here.step(damping)) for damping in (0, 0.1, 1, 10, 100)]
    assert (np.diff(lengths) < 0).all()


@pytest.mark.parametrize(
    "J",
    [
        np.column_stack([A, A[:, 0] + A[:, 1]]),  # one direction too many
        np.column_stack([A, np.zeros(10)]),  # an entry that nothing reads
        A[:3],  # fewer rows than columns
        np.zeros((10, 3)),
    ],
    ids=["dependent", "unseen", "wide", "zero"],
)
def test_without_full_rank_the_shortest_step_is_taken(J: np.ndarray) -> None:
    r = B[: len(J)]
    here = Linearization(r, J)
    p = here.step()
    np.testing.assert_allclose(p, np.linalg.lstsq(J, -r)[0], atol=1e-12)
    # damping picks the same one in the limit; Cholesky may lose eps (1e6)^2 of it on the way
    for damping in (1e-8, 1e-10, 1e-12, 1e-15, 1e-20):
        off = np.linalg.norm(here.step(damping) - p)
        assert off <= 1e-3 * np.linalg.norm(p)


@pytest.mark.parametrize("scaling", [1.0, np.array([1.0, 3.0, 0.5, 2.0])])
def test_a_scaled_step_is_one_in_other_units(scaling: np.ndarray) -> None:
    """Also where J is too ill conditioned for Cholesky: there damping meets singular values."""
    J = A @ np.diag([1.0, 1e-3, 1e-6, 1e-9])
    D = np.broadcast_to(scaling, 4)
    p = Linearization(B, J).step(1e-18, scaling)
    stacked = np.vstack([J, 1e-9 * np.diag(D)])
    expected = np.linalg.lstsq(stacked, np.concatenate([-B, np.zeros(4)]), rcond=1e-30)[0]
    np.testing.assert_allclose(p, expected, rtol=1e-5)  # 1e9 eps, and a little
    assert np.isfinite(Linearization(B, 1e-200 * A).step()).all()  # whose squares are zero


def test_an_ill_conditioned_step_is_not_left_to_the_normal_equations() -> None:
    """With condition c they lose eps c^2 of the step, an orthogonal factorisation eps c."""
    U, _ = np.linalg.qr(RNG.normal(size=(10, 4)))
    V, _ = np.linalg.qr(RNG.normal(size=(4, 4)))
    J = U @ np.diag([1, 1e-3, 1e-6, 1e-9]) @ V.T
    truth = RNG.normal(size=4)
    p = Linearization(-J @ truth, J).step()
    np.testing.assert_allclose(p, truth, atol=1e-5)  # 1e9 eps, and a little
    by_normal = np.linalg.solve(J.T @ J + 0 * np.eye(4), J.T @ J @ truth)
    assert np.linalg.norm(by_normal - truth) > 100 * np.linalg.norm(p - truth)


def test_rank_counts_what_the_residual_notices() -> None:
    dependent = np.column_stack([A, A @ RNG.normal(size=(4, 2))])
    assert Linearization(B, A).rank == 4
    assert Linearization(B, dependent).rank == 4
    assert Linearization(B, 1e-200 * A).rank == 4  # units do not matter
    assert Linearization(B, np.zeros((10, 4))).rank == 0
    assert Linearization(B, np.zeros((10, 0))).rank == 0


# Covariance.


def test_the_covariance_of_a_linear_problem_is_the_analytic_one() -> None:
    x, sigma = Block("x", (4,)).symbol, RNG.uniform(0.1, 2, 10)
    problem = Problem((Residual("fit", A @ x - B, sigma),), ("x",))
    found = problem.linearize({"x": np.zeros(4)}).covariance
    analytic = np.linalg.inv(A.T @ np.diag(sigma**-2) @ A)
    np.testing.assert_allclose(found, analytic, rtol=1e-11, atol=1e-14)


def test_what_is_unseen_has_infinite_variance_and_the_rest_keeps_its_own() -> None:
    J = np.column_stack([A[:, 0], A[:, 1], A[:, 1], A[:, 2], np.zeros(10)])
    C = Linearization(B, J).covariance
    blind, seen = [1, 2, 4], np.ix_([0, 3], [0, 3])
    assert (C[blind, blind] == np.inf).all()
    assert np.isnan(C[0, blind]).all()
    assert np.isnan(C[blind, 3]).all()
    without = np.linalg.inv(A[:, [0, 2, 1]].T @ A[:, [0, 2, 1]])[:2, :2]
    np.testing.assert_allclose(C[seen], without, rtol=1e-12)


@pytest.mark.parametrize("units", [1e-12, 1.0, 1e9])
def test_the_covariance_knows_no_units(units: float) -> None:
    """A parameter of size 1e-12 is no unseen one: columns count by their angles alone."""
    D = np.array([units, 1.0, 1.0 / units, 1.0])
    found = Linearization(B, A * D).covariance
    np.testing.assert_allclose(found, np.linalg.inv(A.T @ A) / np.outer(D, D), rtol=1e-10)
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


def test_optimality_is_the_largest_cosine_with_a_column() -> None:
    problem = curve()
    here = problem.linearize({"x": [0.3, -0.2]})
    cosines = [
        abs(column @ here.residual) / np.linalg.norm(column) / np.linalg.norm(here.residual)
        for column in here.jacobian.T
    ]
    assert optimality(problem, {"x": [0.3, -0.2]}) == pytest.approx(max(cosines), rel=1e-14)


def test_optimality_vanishes_at_the_minimum_and_never_exceeds_one() -> None:
    x = Block("x", (4,)).symbol
    problem = Problem((Residual("fit", A @ x - B, 1.0),), ("x",))
    least = np.linalg.lstsq(A, B)[0]
    assert optimality(problem, {"x": least}) < 1e-14
    for point in least + 10.0 ** RNG.uniform(-3, 8, (50, 1)) * RNG.normal(size=(50, 4)):
        assert 0 < optimality(problem, {"x": point}) <= 1 + 1e-15
    single = Problem((residuals.gaussian(Block("s").symbol),), ("s",))
    assert optimality(single, {"s": 3.0}) == 1
    assert optimality(single, {"s": 0.0}) == 0


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("sigma", [1e-6, 0.1, 1e6])
def test_optimality_knows_no_units(scale: float, sigma: float) -> None:
    here = optimality(curve(), {"x": np.array([0.3, -0.2])})
    there = optimality(curve(scale, sigma), {"x": scale * np.array([0.3, -0.2])})
    assert there == pytest.approx(here, rel=1e-12)


def test_an_entry_at_a_bound_that_holds_it_back_is_stationary() -> None:
    x = Block("x", (2,)).symbol
    residual = residuals.gaussian(x, mean=[3.0, 0.5])
    problem = Problem((residual,), ("x",), {"x": (0.0, 1.0)})
    assert optimality(problem, {"x": [1.0, 0.5]}) == 0
    assert optimality(problem, {"x": [1.0, 0.6]}) > 0.04
    assert optimality(problem, {"x": [0.0, 0.5]}) > 0.3  # a bound, but the other one
    # an interior point method only comes near the bound: the way left counts, in sigmas
    near = optimality(problem, {"x": [1.0 - 1e-9, 0.5]})
    assert near == pytest.approx(1e-9 / 2, rel=1e-6)
    free = Problem((residual,), ("x",))
    assert optimality(free, {"x": [1.0, 0.5]}) == pytest.approx(1.0)


def test_an_entry_that_nothing_reads_does_not_matter() -> None:
    x = Block("x", (3,)).symbol
    bounded = {"x": (0.0, np.inf)}
    problem = Problem((residuals.gaussian(x[:2], mean=1.0),), ("x",), bounded)
    assert optimality(problem, {"x": [1.0, 1.0, 7.0]}) == 0
    assert optimality(problem, {"x": [1.0, 2.0, 7.0]}) == pytest.approx(1.0)


def test_an_entry_whose_column_is_too_short_for_its_square_does_not_matter() -> None:
    z = Block("z", (2,)).symbol
    noticed = 1 + cs.exp(-(z[1] ** 2))  # at 20, its slope is 1e-172: squared, that is zero
    problem = Problem((Residual("fit", cs.vertcat(z[0] - 1, noticed), 1.0),), ("z",))
    assert optimality(problem, {"z": [1.0, 20.0]}) < 1e-15
    # the second row is no part of the cosine: z[0] cannot change it
    assert optimality(problem, {"z": [2.0, 20.0]}) == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(10))
def test_rounding_explains_what_is_left_without_noise_and_nothing_more(seed: int) -> None:
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


def test_at_another_residual_only_what_depends_on_it_changes() -> None:
    here = Linearization(B, A)
    other = here.with_residual(2 * B)
    assert other.normal is here.normal
    assert other.cost == pytest.approx(4 * here.cost)
    np.testing.assert_allclose(other.gradient, 2 * here.gradient)
    np.testing.assert_allclose(other.step(), 2 * here.step())
