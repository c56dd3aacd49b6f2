"""How much narrower a posterior is than its prior, and marginals of joint draws."""

import numpy as np
import pytest

import workbench as wb
from workbench.errors import BadArgument
from workbench.sampling.contraction import contraction, contraction_bar, prior_deviations

X = wb.Block("x", (2,))
PRIOR = wb.residuals.gaussian(X.symbol, covariance=np.array([4.0, 1.0]), name="prior")
DATA = wb.Residual("data", X.symbol[0] - 1.0, 0.5)
PROBLEM = wb.Problem((PRIOR, DATA), ["x"])
AT = {"x": np.zeros(2)}


def test_the_prior_alone_has_its_own_deviations() -> None:
    found = prior_deviations(PROBLEM, AT, "x", ["prior"])
    np.testing.assert_allclose(found, [2.0, 1.0])


def test_what_no_prior_reads_has_none() -> None:
    only = wb.Problem((DATA,), ["x"])
    assert np.isinf(prior_deviations(only, AT, "x", [])).all()
    assert np.isnan(contraction(np.ones(2), np.array([np.inf, np.inf]))).all()


def test_data_contract_what_they_read() -> None:
    """Variances 4 and 1/4 give 4/17; the second entry is known by its prior alone."""
    near = wb.laplace(PROBLEM, AT, draws=40_000)
    expected = [1 - np.sqrt(4 / 17) / 2, 0.0]
    np.testing.assert_allclose(near.contraction(["prior"]), expected, atol=0.02)


def test_a_bar_is_as_long_as_its_number() -> None:
    assert contraction_bar(0.72) == " 0.72 #######..."
    assert contraction_bar(-0.3) == "-0.30 .........."
    assert contraction_bar(float("nan")) == "no prior known"


def test_a_marginal_is_some_columns_of_the_draws() -> None:
    near = wb.laplace(PROBLEM, AT, draws=400)
    one = near.marginal("x[1]")
    assert one.labels == ("x[1]",)
    np.testing.assert_array_equal(one.flat[:, 0], near.flat[:, 1])
    np.testing.assert_allclose(abs(one.modes[0].half), [[1.0]], rtol=1e-6)
    assert one.judgement == near.judgement
    with pytest.raises(BadArgument, match="only what was sampled"):
        one.marginal("x[0]")
