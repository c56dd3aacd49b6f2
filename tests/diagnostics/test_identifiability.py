"""What is known of each number, against closed forms; and what each residual adds."""

from collections.abc import Callable

import casadi as cs
import numpy as np
import pytest

from tests.diagnostics import cases
from tests.tiers import few
from workbench import Block, Diagnosis, Problem, Residual, diagnose, residuals
from workbench.diagnostics.identifiability import EntryIdentifiability
from workbench.errors import UnknownName


def gaussian_problem(
    A: np.ndarray, sigma: float, covariance: np.ndarray | None = None
) -> tuple[Problem, dict[str, np.ndarray]]:
    """Data A x with noise sigma, and a prior N(0, covariance) on x if there is one."""
    x = Block("x", (A.shape[1],))
    found = [Residual("data", cs.DM(A) @ x.symbol, sigma)]
    if covariance is not None:
        found.append(residuals.gaussian(x.symbol, covariance=covariance, name="prior"))
    return Problem(found, ("x",), blocks=(x,)), {"x": np.zeros(A.shape[1])}


def random_covariance(rng: np.random.Generator, n: int) -> np.ndarray:
    half = rng.normal(size=(n, n))
    return half @ half.T + 0.1 * np.eye(n)


@pytest.mark.parametrize("seed", few(range(6), 2))
def test_a_linear_problem_agrees_with_the_closed_forms(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    A = rng.normal(size=(int(rng.integers(1, 15)), n))  # sometimes fewer rows than unknowns
    sigma, C = float(rng.uniform(0.2, 3)), random_covariance(rng, n)
    known = diagnose(*gaussian_problem(A, sigma, C), priors=("prior",)).identifiability

    J = A / sigma
    posterior = np.linalg.inv(J.T @ J + np.linalg.inv(C))
    np.testing.assert_allclose(known.sigma, np.sqrt(np.diag(posterior)), rtol=1e-9)
    np.testing.assert_allclose(known.prior_sigma, np.sqrt(np.diag(C)), rtol=1e-9)
    np.testing.assert_allclose(known.shrinkage, known.sigma / known.prior_sigma, rtol=1e-12)
    hat = J @ posterior @ J.T
    assert known.effective == pytest.approx(np.trace(hat), rel=1e-9)
    share = np.sort(np.linalg.eigvals(posterior @ J.T @ J).real)[::-1]
    np.testing.assert_allclose(np.sort(known.data_share)[::-1], np.clip(share, 0, 1), atol=1e-9)
    assert known.better_from_data == np.sum(share > 0.5)
    expected = [
        EntryIdentifiability.IDENTIFIED if told < 0.9 else EntryIdentifiability.PRACTICAL
        for told in np.sqrt(np.diag(posterior) / np.diag(C))
    ]
    assert list(known.verdicts) == expected

    spread = np.sqrt(np.diag(posterior))
    correlation = posterior / np.outer(spread, spread)
    strong = {(i, j) for i in range(n) for j in range(i + 1, n) if abs(correlation[i, j]) > 0.5}
    assert {(i, j) for i, j, _ in known.correlations} == strong
    for i, j, c in known.correlations:
        assert c == pytest.approx(correlation[i, j], abs=1e-9)
    sizes = [abs(c) for _, _, c in known.correlations]
    assert sizes == sorted(sizes, reverse=True)


def test_without_priors_the_data_decide_everything() -> None:
    rng = np.random.default_rng(0)
    A = rng.normal(size=(9, 4))
    known = diagnose(*gaussian_problem(A, 0.1)).identifiability
    np.testing.assert_array_equal(known.prior_sigma, np.inf)
    np.testing.assert_array_equal(known.data_share, 1.0)
    np.testing.assert_array_equal(known.shrinkage, 0.0)
    assert known.effective == known.better_from_data == 4


def test_a_prior_on_some_says_nothing_of_the_others() -> None:
    """And one on a sum says nothing of its parts."""
    x, y, z = Block("x", ()), Block("y", ()), Block("z", (2,))
    found = (
        Residual("data", cs.vertcat(x.symbol, y.symbol, z.symbol), 0.1),
        residuals.gaussian(y.symbol, covariance=4.0, name="on y"),
        residuals.gaussian(cs.sum1(z.symbol), covariance=9.0, name="on the sum of z"),
    )
    problem = Problem(found, ("x", "y", "z"), blocks=(x, y, z))
    at = {"x": 0.0, "y": 0.0, "z": np.zeros(2)}
    known = diagnose(problem, at, priors=("on y", "on the sum of z")).identifiability
    np.testing.assert_allclose(known.prior_sigma, [np.inf, 2, np.inf, np.inf], rtol=1e-12)
    np.testing.assert_allclose(
        known.shrinkage, [0, 0.5 / np.sqrt(0.25 + 100), 0, 0], rtol=1e-12, atol=1e-15
    )
    share_of_sum = 100 / (100 + 2 / 9)
    np.testing.assert_allclose(
        np.sort(known.data_share), np.sort([1, 1, 100 / 100.25, share_of_sum]), rtol=1e-12
    )


def test_verdicts_tell_the_ways_of_not_being_known_apart() -> None:
    x = Block("x", (2, 3), "1", ("first", "second"))
    a, b, c, d, e, _ = cs.vertsplit(cs.vec(x.symbol))
    data = Residual("data", cs.vertcat(a, b + c, 2 * (b + c), 1e-4 * d, 100 * e), 1.0)
    problem = Problem((data, residuals.gaussian(a, covariance=1e-6, name="prior")), ("x",))
    found = diagnose(problem, {"x": np.zeros((2, 3))}, priors=("prior",))
    assert [v.name for v in found.identifiability.verdicts] == [
        "PRACTICAL",  # the data know it worse than the prior does
        "NUMERICAL",
        "NUMERICAL",  # only their sum is seen
        "PRACTICAL",  # seen by a ten thousandth of a sigma
        "IDENTIFIED",
        "STRUCTURAL",  # read by nobody
    ]
    np.testing.assert_allclose(
        found.identifiability.sigma[[0, 3, 4]], [1e-3 / np.sqrt(1 + 1e-6), 1e4, 0.01], rtol=1e-9
    )
    assert np.isinf(found.identifiability.sigma[[1, 2, 5]]).all()
    assert found.rank == 4


def rms(found: Diagnosis, block: str) -> float:
    at = found.free.slices[block]
    return float(np.sqrt(np.mean(found.identifiability.sigma[at] ** 2)))


@pytest.mark.parametrize(
    "case",
    few([cases.the_same_twice, cases.template_and_translation, cases.shape_without_effect], 1),
)
def test_what_a_residual_adds_is_what_is_lost_without_it(case: Callable[[], cases.Case]) -> None:
    problem, values = case()
    blocks = (*problem.free.blocks, *problem.fixed.blocks)
    extra = residuals.gaussian(problem.free.blocks[0].symbol, covariance=0.01, name="prior")
    problem = Problem((*problem.residuals, extra), problem.free.names, blocks=blocks)
    whole = diagnose(problem, values)
    assert [c.residual for c in whole.contributions] == list(problem.rows)
    for contribution in whole.contributions:
        less = problem.without(contribution.residual)
        without = diagnose(less, values)
        assert contribution.rank_with == whole.rank
        assert contribution.rank_without == without.rank
        seen = without.singular_values[: without.rank]
        np.testing.assert_allclose(
            contribution.singular_values_without[: without.rank], seen, rtol=1e-9
        )
        for name in problem.free.names:
            assert contribution.sigma_with[name] == pytest.approx(rms(whole, name))
            expected = rms(without, name) if name in less.free.names else np.inf
            assert contribution.sigma_without[name] == pytest.approx(expected)


def test_a_residual_that_is_no_residual_of_the_problem_is_no_prior() -> None:
    with pytest.raises(UnknownName, match="priro"):
        diagnose(*gaussian_problem(np.eye(2), 1.0, np.eye(2)), priors=("priro",))
