"""Bounds and constraints end a posterior: no draw lies beyond them, or it is refused."""

import casadi as cs
import numpy as np
import pytest
import scipy.stats

import workbench as wb
from tests.sampling.densities import conditioned, gaussian
from workbench.sampling import conditional, laplace, sample

UNLIKELY = 1e-3  # of a test of draws that are right, the seeds being fixed


def pulled(away: float) -> wb.Problem:
    """x ~ N(-away, 1) with x >= 0."""
    x = wb.Block("x")
    return wb.Problem([wb.Residual("pull", x.symbol + away, 1.0)], "x", {"x": (0.0, np.inf)}, [x])


@pytest.mark.parametrize("away", [0.5, 3.0, 30.0])
def test_laplace_on_a_bound_is_the_truncated_gaussian(away: float) -> None:
    posterior = laplace(pulled(away), {"x": 0.0})
    assert posterior.flat.min() >= 0
    truth = scipy.stats.truncnorm(away, np.inf, loc=-away)
    found = posterior.interval(0.9)[0]
    # a quantile of 4000 draws is off by sqrt(q (1 - q) / 4000) of its level
    np.testing.assert_allclose(truth.cdf(found), [0.05, 0.95], atol=4 * np.sqrt(0.0475 / 4000))
    if away == 3.0:
        np.testing.assert_allclose(truth.ppf([0.05, 0.95]), [0.016, 0.817], atol=5e-4)


def test_laplace_within_two_bounds_is_uniform_where_nothing_else_is_known() -> None:
    x = wb.Block("x", (2,))
    one = wb.Residual("first", x.symbol[0], 1.0)
    problem = wb.Problem([one, wb.Residual("none", 0 * x.symbol[1], 1.0)], "x",
                         {"x": ([-np.inf, 2.0], [np.inf, 5.0])}, [x])  # fmt: skip
    posterior = laplace(problem, {"x": [0.0, 3.0]})
    assert posterior.usable, posterior.verdict
    second = scipy.stats.uniform(2, 3)
    assert scipy.stats.kstest(posterior.flat[:, 1], second.cdf).pvalue > UNLIKELY


def test_a_gaussian_cut_by_bounds_in_five_dimensions() -> None:
    """Against rejection, which is exact: means and spreads, corner included."""
    from workbench.sampling.truncated import truncated

    C = conditioned(5, 20.0, seed=2)
    half, mean, rng = np.linalg.cholesky(C), np.full(5, 0.5), np.random.default_rng(0)
    start = np.linalg.solve(half, -mean)  # in the corner of the orthant
    drawn = mean + truncated(half, mean, start, 20_000, rng) @ half.T
    assert drawn.min() > -1e-9
    proposed = mean + rng.standard_normal((2_000_000, 5)) @ half.T
    right = proposed[(proposed >= 0).all(axis=1)]
    assert len(right) > 20_000
    error = right.std(axis=0) * np.sqrt(1 / len(right) + 3 / len(drawn))  # draws are nearly free
    assert (abs(drawn.mean(axis=0) - right.mean(axis=0)) < 4 * error).all()
    np.testing.assert_allclose(drawn.std(axis=0), right.std(axis=0), rtol=0.06)


def ring(radius: float = 1.0) -> wb.Problem:
    """N(0.4, 1/4) of two, outside a circle."""
    y = wb.Block("y", (2,))
    hole = wb.Constraint("hole", cs.sumsqr(y.symbol), radius**2, np.inf)
    return wb.Problem([wb.Residual("r", y.symbol - 0.4, 0.5)], "y", blocks=[y], constraints=[hole])


def test_draws_meet_inequality_constraints() -> None:
    posterior = sample(ring(), {"y": [0.71, 0.71]}, steps=3000, walkers=16, seed=0)
    size = np.sum(posterior.flat**2, axis=1)
    assert size.min() >= 1 - 1e-6  # the constraint's tolerance
    grid = np.stack(np.meshgrid(*[np.linspace(-3, 4, 701)] * 2, indexing="ij"), -1).reshape(-1, 2)
    density = np.exp(-2 * np.sum((grid - 0.4) ** 2, axis=1)) * (np.sum(grid**2, axis=1) >= 1)
    mean = density @ grid / density.sum()
    sd = np.sqrt(density @ (grid - mean) ** 2 / density.sum())
    assert posterior.usable, posterior.verdict
    assert (abs(posterior.mean - mean) < 5 * sd / np.sqrt(posterior.mixing.effective)).all()


def test_laplace_meets_constraints_or_says_how_many_draws_do_not() -> None:
    posterior = laplace(ring(), {"y": [0.71, 0.71]})
    beyond = float(np.mean(np.sum(posterior.flat**2, axis=1) < 1 - 1e-6))
    assert beyond == posterior.importance.outside == 0  # a circle is outside of its tangent
    assert posterior.importance.cut_away > 0.2  # which leaves out what the circle allows
    assert not posterior.usable
    assert "of what they allow" in posterior.verdict
    within = wb.Block("y", (2,))
    disc = wb.Constraint("disc", cs.sumsqr(within.symbol), -np.inf, 1.0)
    problem = wb.Problem([wb.Residual("r", within.symbol - 0.9, 0.5)], "y",
                         blocks=[within], constraints=[disc])  # fmt: skip
    posterior = laplace(problem, {"y": [0.7, 0.7]})
    beyond = float(np.mean(np.sum(posterior.flat**2, axis=1) > 1 + 1e-6))
    assert posterior.importance.outside == pytest.approx(beyond)
    assert beyond > 0.1
    assert not posterior.usable
    assert f"{beyond:.1%} of the draws outside" in posterior.verdict


def test_linear_constraints_cut_laplaces_gaussian_exactly() -> None:
    y = wb.Block("y", (2,))
    half_plane = wb.Constraint("half plane", y.symbol[0] + y.symbol[1], 2.0, np.inf)
    problem = wb.Problem(
        [wb.Residual("r", y.symbol, 1.0)], "y", blocks=[y], constraints=[half_plane]
    )
    posterior = laplace(problem, {"y": [1.0, 1.0]})
    assert posterior.usable, posterior.verdict
    along = posterior.flat.sum(axis=1) / np.sqrt(2)
    assert along.min() >= np.sqrt(2) - 1e-6
    truth = scipy.stats.truncnorm(np.sqrt(2), np.inf)
    found = truth.cdf(np.quantile(along, [0.05, 0.5, 0.95]))
    np.testing.assert_allclose(found, [0.05, 0.5, 0.95], atol=4 * 0.5 / np.sqrt(4000))


@pytest.mark.parametrize("way", [sample, laplace])
def test_an_equation_is_refused_where_it_reads_what_is_drawn(way: object) -> None:
    y = wb.Block("y", (3,))
    tie = wb.Constraint("tie", y.symbol[0] - y.symbol[1] ** 2, 0.0, 0.0)
    problem = wb.Problem([wb.Residual("r", y.symbol, 0.5)], "y", blocks=[y], constraints=[tie])
    at = {"y": np.zeros(3)}  # where the derivative by y[1] vanishes
    for names in ("y", "y[0]", "y[1]"):
        with pytest.raises(wb.WorkbenchError, match=r"tie is an equation .* residual"):
            way(problem, at, names)  # type: ignore[operator]
    alone = laplace(problem, at, "y[2]")
    assert alone.usable, alone.verdict


def test_an_entry_with_equal_bounds_is_refused() -> None:
    problem = gaussian(np.eye(2))
    pinned = wb.Problem(problem.residuals, "x", {"x": ([0.0, -1.0], [0.0, 1.0])},
                        problem.free.blocks)  # fmt: skip
    for way in (sample, laplace):
        with pytest.raises(wb.WorkbenchError, match=r"x\[0\] has equal bounds"):
            way(pinned, {"x": np.zeros(2)})
    assert laplace(pinned, {"x": np.zeros(2)}, "x[1]").usable


def test_what_is_integrated_out_beyond_a_bound_is_told() -> None:
    """y is half a Gaussian; its Gaussian conditional has the other half too."""
    x, y = wb.Block("x"), wb.Block("y")
    terms = [wb.Residual("x", x.symbol, 1.0), wb.Residual("y", y.symbol, 1.0)]
    problem = wb.Problem(terms, ("x", "y"), {"y": (0.0, np.inf)}, [x, y])
    for posterior in (
        laplace(problem, {"x": 0.0, "y": 0.0}, "x", rest=conditional),
        sample(problem, {"x": 0.0, "y": 0.0}, "x", rest=conditional, steps=1000, walkers=16),
    ):
        assert posterior.importance is not None
        assert posterior.importance.outside == pytest.approx(0.5, abs=0.04)
        assert not posterior.usable
        assert "% of the draws outside bounds or constraints" in posterior.verdict


def test_a_start_beyond_a_limit_is_said_by_name() -> None:
    with pytest.raises(wb.WorkbenchError, match=r"hole is 0\.18, below its limit 1"):
        sample(ring(), {"y": [0.3, 0.3]}, steps=100)
    with pytest.raises(wb.WorkbenchError, match="x is -1, outside its bounds of 0 to inf"):
        sample(pulled(1.0), {"x": -1.0}, steps=100)
