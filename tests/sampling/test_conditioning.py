"""What is held fixed narrows intervals, and data contract the prior: both are told."""

import numpy as np
import pytest

import workbench as wb
from tests.sampling.densities import conditioned, gaussian
from workbench.errors import BadArgument
from workbench.residuals import huber, quadratic
from workbench.sampling import NotConverged, Usability, fixed, integrated, laplace, sample
from workbench.sampling.conditioning import contraction, prior_deviations

C, MEAN = conditioned(4, 30.0, seed=3), np.array([1.0, -2.0, 0.5, 3.0])
TWO = [1, 3]
RATIO = 1.2
NAMES = ("x[1]", "x[3]")


def exact() -> np.ndarray:
    """Marginal over conditional standard deviations of the two."""
    alone = np.linalg.inv(np.linalg.inv(C)[np.ix_(TWO, TWO)])
    return np.asarray(np.sqrt(np.diag(C)[TWO] / np.diag(alone)))


@pytest.mark.thorough
def test_ratio_is_the_gaussians_and_limits_usability() -> None:
    assert exact().max() > RATIO
    problem = gaussian(C, MEAN)
    drawn = sample(problem, {"x": MEAN}, NAMES, rest=fixed, steps=2000, walkers=16, seed=1)
    for posterior in (laplace(problem, {"x": MEAN}, NAMES, rest=fixed), drawn):
        assert posterior.mixing.usable
        assert not posterior.usable
        np.testing.assert_allclose(posterior.conditioning.ratios, exact(), rtol=1e-9)
        np.testing.assert_allclose(
            posterior.conditioning.marginal, np.sqrt(np.diag(C)[TWO]), rtol=1e-9
        )
        assert posterior.judgement[0] is Usability.CONDITIONAL
        said = str(posterior)
        assert not said.startswith("usable")
        assert "Held fixed: 2 of the 4 numbers of x (2 numbers)" in said
        assert f"{exact().max():.3g} times as large" in posterior.verdict
        assert "--conditional" in posterior.verdict
        with pytest.raises(NotConverged, match="hold 2 of the 4 numbers of x fixed"):
            posterior.interval()
        assert posterior.conditional_interval().shape == (2, 2)


def test_hardly_narrower_intervals_are_usable() -> None:
    nearly = np.eye(4) + 0.1
    posterior = laplace(gaussian(nearly), {"x": np.zeros(4)}, NAMES, rest=fixed)
    assert 1 < posterior.conditioning.ratios.max() < RATIO
    assert posterior.usable, posterior.verdict
    table = next(line for line in str(posterior).splitlines() if line.startswith("entry"))
    assert table.endswith("marginal   ratio  interval")
    assert "Held fixed: 2 of the 4 numbers of x" in str(posterior)


def test_integrated_numbers_are_not_held() -> None:
    problem = gaussian(C, MEAN)
    for posterior in (
        laplace(problem, {"x": MEAN}),
        laplace(problem, {"x": MEAN}, NAMES, rest=integrated),
    ):
        assert posterior.conditioning.count == 0
        assert (posterior.conditioning.ratios == 1).all()
        assert "Held fixed: nothing" in str(posterior)
        assert posterior.usable, posterior.verdict
        assert "ratio" not in str(posterior)


def test_undetermined_directions_have_infinite_ratio() -> None:
    x, y = wb.Block("x"), wb.Block("y")
    problem = wb.Problem([wb.Residual("sum", x.symbol + y.symbol, 0.1)], ("x", "y"), blocks=[x, y])
    posterior = laplace(problem, {"x": 0.0, "y": 0.0}, "x", rest=fixed)
    assert np.isinf(posterior.conditioning.ratios).all()
    assert "do not determine x at all" in posterior.verdict
    assert not posterior.usable


def test_bounds_and_equations_hold_the_rest() -> None:
    x, y, z = (wb.Block(name) for name in "xyz")
    total = wb.Residual("sum", x.symbol + y.symbol + z.symbol, 0.1)
    tie = wb.Constraint("tie", y.symbol - z.symbol, 0.0, 0.0)
    problem = wb.Problem([total], ("x", "y", "z"), {"y": (-1.0, 1.0)}, [x, y, z], [tie])
    posterior = laplace(problem, {"x": 0.0, "y": 0.0, "z": 0.0}, "x", rest=fixed)
    # y = z, uniform on (-1, 1) at the most: x has the variance 0.1^2 + 4 / 3
    assert posterior.conditioning.marginal[0] == pytest.approx(np.sqrt(0.01 + 4 / 3), rel=1e-9)


X = wb.Block("x", (2,))
PRIOR = wb.residuals.gaussian(X.symbol, covariance=np.array([4.0, 1.0]), name="prior")
DATA = wb.Residual("data", X.symbol[0] - 1.0, 0.5)
PROBLEM = wb.Problem((PRIOR, DATA), ["x"])
AT = {"x": np.zeros(2)}


def test_prior_alone_has_its_own_deviations() -> None:
    found = prior_deviations(PROBLEM, AT, "x", ["prior"])
    np.testing.assert_allclose(found, [2.0, 1.0])


def test_unread_numbers_have_no_prior() -> None:
    only = wb.Problem((DATA,), ["x"])
    assert np.isinf(prior_deviations(only, AT, "x", [])).all()
    assert np.isnan(contraction(np.ones(2), np.array([np.inf, np.inf]))).all()


def test_data_contract_what_they_read() -> None:
    """Variances 4 and 1/4 give 4/17; the second entry is known by its prior alone."""
    near = wb.laplace(PROBLEM, AT, draws=40_000)
    expected = [1 - np.sqrt(4 / 17) / 2, 0.0]
    np.testing.assert_allclose(near.contraction(["prior"]), expected, atol=0.02)


def test_marginal_is_some_columns_of_the_draws() -> None:
    near = wb.laplace(PROBLEM, AT, draws=400)
    one = near.marginal("x[1]")
    assert one.labels == ("x[1]",)
    np.testing.assert_array_equal(one.flat[:, 0], near.flat[:, 1])
    np.testing.assert_allclose(abs(one.modes[0].half), [[1.0]], rtol=1e-6)
    assert one.judgement == near.judgement
    with pytest.raises(BadArgument, match="only what was sampled"):
        one.marginal("x[0]")


def test_data_that_contradict_the_prior_are_doubted() -> None:
    """x ~ N(0, 1) seen at 10 with a sigma of 0.1: 10^2 / 1.01 = 99 in place of one square."""
    for seen, kernel, doubted in (
        (10.0, None, True),
        (3.0, None, False),
        (10.0, huber(1.3), False),
    ):
        data = wb.Residual("data", X.symbol - seen, 0.1, kernel=kernel or quadratic)
        problem = wb.Problem((wb.residuals.gaussian(X.symbol), data), ["x"])
        drawn = wb.laplace(problem, wb.solve(problem, AT).values)
        assert bool(drawn.doubt) == doubted
        assert ("least sum of squares is 198, where 2 are expected" in str(drawn)) == doubted
        assert drawn.marginal("x[0]").doubt == drawn.doubt
