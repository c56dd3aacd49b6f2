"""Draws from posteriors that are known, and what becomes of the numbers that are not drawn."""

import casadi as cs
import numpy as np
import pytest
import scipy.stats

import workbench as wb
from tests.sampling.densities import conditioned, gaussian
from workbench.blocks.layout import entries
from workbench.sampling import (
    Improper,
    NotConverged,
    Posterior,
    Usability,
    fixed,
    integrated,
    laplace,
    sample,
    sampling_blocks,
)

COVARIANCE, MEAN = conditioned(4, 30.0, seed=3), np.array([1.0, -2.0, 0.5, 3.0])
TWO = ("x[1]", "x[3]")


def test_fixed_rest_gives_conditional_variance() -> None:
    posterior = laplace(gaussian(COVARIANCE, MEAN), {"x": MEAN}, TWO, rest=fixed, draws=40_000)
    precision = np.linalg.inv(COVARIANCE)[np.ix_([1, 3], [1, 3])]
    true = np.linalg.inv(precision)
    chance = np.max(true) * np.sqrt(2 / 40_000)  # the standard deviation of a variance
    np.testing.assert_allclose(posterior.covariance, true, atol=4 * chance)


def test_integrated_rest_gives_marginal_variance() -> None:
    problem = gaussian(COVARIANCE, MEAN)
    posterior = laplace(problem, {"x": MEAN}, TWO, rest=integrated, draws=40_000)
    scale = np.abs(COVARIANCE).max()
    np.testing.assert_allclose(
        posterior.covariance, COVARIANCE[np.ix_([1, 3], [1, 3])], atol=0.03 * scale
    )
    whole = posterior.points(40_000)
    np.testing.assert_allclose(np.cov(whole.T), COVARIANCE, atol=0.03 * scale)
    np.testing.assert_allclose(whole.mean(axis=0), MEAN, atol=0.03 * np.sqrt(scale))
    assert posterior.importance is not None
    assert posterior.importance.holds
    assert posterior.importance.effective == pytest.approx(4000)  # all weights are equal


def curved(scale: float) -> wb.Problem:
    """y given x is N(0, (1 + scale x^2)^-2): no Gaussian conditional serves all x."""
    x = wb.Block("x")
    y = wb.Block("y")
    wide = 1 + scale * x.symbol**2
    return wb.Problem(
        [wb.Residual("x", x.symbol, 1.0), wb.Residual("y", y.symbol * wide, 1.0)],
        ("x", "y"),
        blocks=[x, y],
    )


def test_wrong_conditionals_are_noticed() -> None:
    at = {"x": 0.0, "y": 0.0}
    fine = laplace(curved(0.0), at, "x", rest=integrated)
    assert fine.usable
    tail = wb.Block("tail", (8,))
    heavy = wb.Problem(
        [
            wb.Residual("tails", cs.sqrt(3 * cs.log(1 + tail.symbol**2 / 2) + 1e-12), 1.0),
            wb.Residual("pull", tail.symbol, 30.0),
        ],
        "tail",
        blocks=[tail],
    )
    found = laplace(heavy, {"tail": np.full(8, 1e-3)}, "tail[0]", rest=integrated)
    assert found.importance is not None
    assert not found.importance.holds, str(found.importance)
    assert "does not hold" in found.verdict
    with pytest.raises(NotConverged, match="k-hat"):
        found.interval()


def test_improper_posteriors_are_refused_by_name() -> None:
    x = wb.Block("x", (2,))
    problem = wb.Problem([wb.Residual("sum", cs.sum(x.symbol) - 1, 0.1)], "x", blocks=[x])
    with pytest.raises(Improper, match=r"x\[0\]|x\[1\]"):
        sample(problem, {"x": np.zeros(2)}, steps=100)
    bounds = {"x": (-1.0, 1.0)}
    held = wb.Problem(problem.residuals, "x", bounds, [x])
    posterior = sample(held, {"x": [0.5, 0.5]}, steps=4000, seed=1)
    assert posterior.usable, posterior.verdict
    assert np.abs(posterior.flat).max() <= 1.0
    # x0 + x1 = 1 and both below 1: nearly uniform on (0, 1)
    assert posterior.sd[0] == pytest.approx(np.sqrt(1 / 12), rel=0.1)


def test_parts_of_a_body_cover_it() -> None:
    body = wb.load_body("small")
    layout = wb.Layout(body.blocks())
    tree = body.points(*(b.symbol for b in body.blocks())).source.tree
    assert tree is not None
    parts = sampling_blocks(layout, (tree,))
    assert parts["shape and place"] == ("betas", "trans", "pose[pelvis]")
    meant = np.concatenate([entries(layout, names) for names in parts.values()])
    assert sorted(meant) == list(range(layout.size))
    assert max(entries(layout, names).size for names in parts.values()) <= 21


BAD: list[tuple[dict[str, int], str]] = [
    ({"walkers": 3}, "3 walkers"),
    ({"walkers": 7}, "even"),
    ({"steps": 0}, "steps must be 1"),
    ({"ensembles": 0}, "ensembles must be 1"),
    ({"steps": 2, "thin": 5}, "cannot be kept"),
]


def test_bad_numbers_are_refused() -> None:
    for wrong, match in BAD:
        with pytest.raises(wb.WorkbenchError, match=match):
            sample(gaussian(np.eye(2)), {"x": np.zeros(2)}, **wrong)  # type: ignore[arg-type]


def test_starts_without_density_are_refused() -> None:
    x = wb.Block("x")
    problem = wb.Problem([wb.Residual("log", cs.log(x.symbol), 1.0)], "x", blocks=[x])
    with pytest.raises(wb.WorkbenchError, match="no density"):
        sample(problem, {"x": -1.0}, steps=100)
    positive = sample(
        problem, {"x": 1.0}, steps=400, walkers=16, seed=0
    )  # NaN below zero is no density
    assert positive.flat.min() > 0


def within_bands(posterior: Posterior, mean: np.ndarray, covariance: np.ndarray) -> None:
    """Mean and covariance within simultaneous 99.9 % bands, at the effective number of draws.

    In coordinates in which the truth is a standard normal: each entry of the mean has the error
    1 / sqrt(n), a variance sqrt(2 / n), a covariance 1 / sqrt(n) (Bonferroni over all of them).
    """
    k, n = posterior.size, posterior.mixing.effective.min()
    W = np.linalg.inv(np.linalg.cholesky(covariance))
    z = (posterior.flat - mean) @ W.T
    limit = scipy.stats.norm.isf(0.0005 / (k + k * (k + 1) / 2))
    assert np.abs(z.mean(axis=0)).max() < limit / np.sqrt(n)
    error = np.cov(z.T) - np.eye(k)
    assert np.abs(np.diag(error)).max() < limit * np.sqrt(2 / n)
    assert np.abs(error - np.diag(np.diag(error))).max() < limit / np.sqrt(n)


@pytest.mark.parametrize(
    ("k", "condition"),
    [
        (3, 1e6),
        pytest.param(10, 1e6, marks=pytest.mark.thorough),
        pytest.param(20, 1e6, marks=pytest.mark.thorough),
    ],
)
def test_gaussians_have_their_moments(k: int, condition: float) -> None:
    C, mean = conditioned(k, condition), np.arange(k) - 2.0
    problem = gaussian(C, mean)
    posterior = sample(problem, {"x": mean}, steps=3_000 if k == 3 else 10_000, seed=1)
    assert posterior.mixing.verdict is Usability.USABLE, posterior.verdict
    assert posterior.mixing.effective.min() > 1500
    within_bands(posterior, mean, C)


@pytest.mark.thorough
def test_inference_data_hold_the_draws_by_ensemble() -> None:
    pytest.importorskip("arviz")
    posterior = laplace(gaussian(COVARIANCE, MEAN), {"x": MEAN}, TWO, draws=40)
    z = posterior.inference_data()["posterior"]["z"]
    assert (z.dims, list(z.entry.values)) == (("chain", "draw", "entry"), list(TWO))
    np.testing.assert_array_equal(z.values, posterior.draws.reshape(4, 10, 2))
