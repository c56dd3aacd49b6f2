"""Posteriors whose moments are known."""

import casadi as cs
import numpy as np

import workbench as wb
from workbench.arrays import Array


def gaussian(covariance: Array, mean: Array | float = 0.0) -> wb.Problem:
    x = wb.Block("x", (len(covariance),))
    term = wb.residuals.gaussian(x.symbol, mean=mean, covariance=covariance)
    return wb.Problem([term], "x", blocks=[x])


def conditioned(k: int, condition: float, seed: int = 0) -> Array:
    """A covariance (k, k) with that condition number, in no particular axes."""
    rng = np.random.default_rng(seed)
    Q = np.linalg.qr(rng.standard_normal((k, k)))[0]
    return (Q * np.geomspace(1.0, condition, k)) @ Q.T / np.sqrt(condition)


def rosenbrock(variance: float = 1.0) -> wb.Problem:
    """x ~ N(1, v), y | x ~ N(x^2, 1/10): mean (1, 1 + v), variances v and 0.1 + 4 v + 2 v^2."""
    x = wb.Block("x", (2,))
    first, second = x.symbol[0], x.symbol[1]
    return wb.Problem(
        [
            wb.Residual("valley", second - first**2, np.sqrt(0.1)),
            wb.Residual("along", first - 1, np.sqrt(variance)),
        ],
        "x",
        blocks=[x],
    )


def two_modes(apart: float) -> wb.Problem:
    """x: half N(-apart, 1), half N(apart, 1); y standard normal."""
    x = wb.Block("x", (2,))
    a, b = x.symbol[0], x.symbol[1]
    far = cs.fabs(a)
    # minus the log of the sum is 1/2 (|a| - apart)^2 - log(1 + exp(-2 apart |a|)); log 2 and
    # more, so that the root is smooth
    overlap = 1 + np.log(2) - cs.log1p(cs.exp(-2 * apart * far))
    return wb.Problem(
        [
            wb.Residual("nearer mode", far - apart, 1.0),
            wb.Residual("overlap", cs.sqrt(2 * overlap), 1.0),
            wb.Residual("y", b, 1.0),
        ],
        "x",
        blocks=[x],
    )


def bounded() -> wb.Problem:
    """A standard normal of two, the first above 1: mean 1.525135, variance 0.199098."""
    x = wb.Block("x", (2,))
    return wb.Problem(
        [wb.residuals.gaussian(x.symbol)], "x", bounds={"x": ([1.0, -np.inf], np.inf)}, blocks=[x]
    )
