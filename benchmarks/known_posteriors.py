"""Posteriors whose marginals are known: whether intervals that are called usable are right.

Thresholds of mixing are those that the workbench had before these densities were made up; four
others (a narrower banana, equal modes, a bound, and a Gaussian of ten numbers) had been looked at
beforehand, and are not here.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as cs
import numpy as np
import scipy.stats

import workbench as wb
from workbench.arrays import Array
from workbench.sampling import sample

OFF = 0.15  # of the width of an interval: more, and it is wrong
EXACT = 2_000_000  # exact draws, where no formula gives the quantiles


@dataclass(frozen=True, eq=False)
class Known:
    """A problem, where sampling begins, what is named, and the ends (k, 2) of intervals of 90 %."""

    problem: wb.Problem
    at: wb.Values
    names: str | tuple[str, ...] | None
    ends: Array
    steps: int = 4000


def _exact(draws: Array) -> Array:
    return np.quantile(draws, [0.05, 0.95], axis=0).T


def _normal(sd: Array, mean: Array | float = 0.0) -> Array:
    return np.asarray(mean + np.multiply.outer(sd, scipy.stats.norm.ppf([0.05, 0.95])))


def _covariance(k: int, condition: float) -> Array:
    Q = np.linalg.qr(np.random.default_rng(k).standard_normal((k, k)))[0]
    return np.asarray((Q * np.geomspace(1.0, condition, k)) @ Q.T)


def gaussian(k: int, condition: float, names: tuple[str, ...] | None, steps: int) -> Known:
    """N(0, C) of k numbers in no particular axes; a few may be named."""
    C, x = _covariance(k, condition), wb.Block("x", (k,))
    problem = wb.Problem([wb.residuals.gaussian(x.symbol, covariance=C)], "x", blocks=[x])
    at = range(k) if names is None else [int(name[2:-1]) for name in names]
    return Known(problem, {"x": np.zeros(k)}, names, _normal(np.sqrt(np.diag(C))[list(at)]), steps)


def banana() -> Known:
    """x ~ N(1, 1) and y given x ~ N(x^2, 1/10)."""
    x = wb.Block("x", (2,))
    first, second = x.symbol[0], x.symbol[1]
    terms = [
        wb.Residual("valley", second - first**2, np.sqrt(0.1)),
        wb.Residual("along", first - 1, 1.0),
    ]
    rng = np.random.default_rng(0)
    one = 1 + rng.standard_normal(EXACT)
    two = one**2 + np.sqrt(0.1) * rng.standard_normal(EXACT)
    problem = wb.Problem(terms, "x", blocks=[x])
    return Known(problem, {"x": np.ones(2)}, None, _exact(np.column_stack([one, two])))


def funnel() -> Known:
    """v ~ N(0, 1) and x given v ~ N(0, exp(v)) three times, written as residuals.

    Half the sum of squares has to hold the log of the width, 3 v / 2, which a square cannot be: it
    is (v + 3/2)^2 / 2 without a constant, so v is taken about -3/2.
    """
    v, x = wb.Block("v"), wb.Block("x", (3,))
    terms = [
        wb.Residual("width", v.symbol + 1.5, 1.0),
        wb.Residual("x", x.symbol * cs.exp(-v.symbol / 2), 1.0),
    ]
    rng = np.random.default_rng(0)
    wide = rng.standard_normal(EXACT)
    three = rng.standard_normal(EXACT) * np.exp(wide / 2)
    ends = _exact(np.column_stack([wide, three]))
    problem = wb.Problem(terms, ("v", "x"), blocks=[v, x])
    at = {"v": np.array(-1.5), "x": np.zeros(3)}
    return Known(problem, at, None, ends[[0, 1, 1, 1]], 8000)


def two_modes(apart: float, share: float) -> Known:
    """x: N(-apart, 1) with that share, else N(apart, 1); and y ~ N(0, 1)."""
    x = wb.Block("x", (2,))
    a, b = x.symbol[0], x.symbol[1]
    mixture = -cs.log(
        share * cs.exp(-0.5 * (a + apart) ** 2) + (1 - share) * cs.exp(-0.5 * (a - apart) ** 2)
    )
    terms = [wb.Residual("x", cs.sqrt(2 * mixture), 1.0), wb.Residual("y", b, 1.0)]
    rng = np.random.default_rng(0)
    one = rng.standard_normal(EXACT) + np.where(rng.uniform(size=EXACT) < share, -apart, apart)
    ends = np.vstack([_exact(one[:, None]), _normal(np.ones(1))])
    return Known(wb.Problem(terms, "x", blocks=[x]), {"x": np.array([apart, 0.1])}, None, ends)


def student(freedom: float, k: int) -> Known:
    """k independent numbers with Student's distribution of so many degrees of freedom."""
    x = wb.Block("x", (k,))
    u = x.symbol**2 / freedom + 1e-12
    root = x.symbol * cs.sqrt((freedom + 1) / freedom * cs.log(1 + u) / u)  # signed: no kink at 0
    ends = np.tile(scipy.stats.t(freedom).ppf([0.05, 0.95]), (k, 1))
    problem = wb.Problem([wb.Residual("tails", root, 1.0)], "x", blocks=[x])
    return Known(problem, {"x": np.full(k, 0.01)}, None, ends)


def leaning() -> Known:
    """x alone is named; y = x / 2 + N(0, 1/4) is not, and is at least 0."""
    x, y = wb.Block("x"), wb.Block("y")
    terms = [wb.Residual("x", x.symbol, 1.0), wb.Residual("y", y.symbol - x.symbol / 2, 0.5)]
    rng = np.random.default_rng(0)
    one = rng.standard_normal(EXACT)
    kept = one[one / 2 + 0.5 * rng.standard_normal(EXACT) >= 0]
    problem = wb.Problem(terms, ("x", "y"), {"y": (0.0, np.inf)}, [x, y])
    return Known(problem, {"x": np.array(0.1), "y": np.array(0.1)}, "x", _exact(kept[:, None]))


def curved_rest() -> Known:
    """x ~ N(0, 1) is named; 29 numbers that are not lie on a bent ridge, N(x^2, 1) each.

    The marginal of x is N(0, 1); Laplace's approximation of the rest takes the ridge as straight.
    """
    x, y = wb.Block("x"), wb.Block("y", (29,))
    terms = [
        wb.Residual("x", x.symbol, 1.0),
        wb.Residual("y", y.symbol - x.symbol**2, 1.0),
    ]
    problem = wb.Problem(terms, ("x", "y"), blocks=[x, y])
    at = {"x": np.array(0.0), "y": np.zeros(29)}
    return Known(problem, at, "x", _normal(np.ones(1)), 20_000)


def tails_together(freedom: float, k: int, names: tuple[str, ...]) -> Known:
    """Student's distribution of k numbers with a covariance; a few are named, the tails are all's.

    Its log density is that of one residual of k rows, y sqrt((f + k) log(1 + u) / (f u)) with
    u = y'y / f and y whitened.
    """
    C, x = _covariance(k, 1e3), wb.Block("x", (k,))
    y = cs.DM(np.linalg.inv(np.linalg.cholesky(C))) @ x.symbol
    u = cs.sumsqr(y) / freedom + 1e-12
    rows = y * cs.sqrt((freedom + k) / freedom * cs.log(1 + u) / u)
    problem = wb.Problem([wb.Residual("tails", rows, 1.0)], "x", blocks=[x])
    at = [int(name[2:-1]) for name in names]
    ends = np.outer(np.sqrt(np.diag(C)[at]), scipy.stats.t(freedom).ppf([0.05, 0.95]))
    return Known(problem, {"x": np.full(k, 1e-3)}, names, ends)


def wide_funnel() -> Known:
    """v ~ N(0, 1) is named; 29 numbers that are not are N(0, exp(v)) each; see `funnel`."""
    v, x = wb.Block("v"), wb.Block("x", (29,))
    terms = [
        wb.Residual("width", v.symbol + 29 / 2, 1.0),
        wb.Residual("x", x.symbol * cs.exp(-v.symbol / 2), 1.0),
    ]
    problem = wb.Problem(terms, ("v", "x"), blocks=[v, x])
    return Known(problem, {"v": np.array(-29 / 2), "x": np.zeros(29)}, "v", _normal(np.ones(1)))


DENSITIES: dict[str, Callable[[], Known]] = {
    "wide banana": banana,
    "funnel": funnel,
    "unequal modes": lambda: two_modes(2.5, 0.3),
    "Student, 4": lambda: student(4.0, 3),
    "marginal at a bound": leaning,
    "Gaussian, 50": lambda: gaussian(50, 1e4, None, 8000),
    "2 of 50 named": lambda: gaussian(50, 1e4, ("x[3]", "x[20]"), 4000),
    "bent rest": curved_rest,
    "Student, 2 of 40 named": lambda: tails_together(5.0, 40, ("x[0]", "x[7]")),
    "funnel, width named": wide_funnel,
}


def judged(known: Known, seed: int) -> dict[str, Any]:
    """One run: its verdict, and whether its intervals are right.

    An interval is wrong if its width is off by more than OFF, or one of its ends by more than that
    share of the width.
    """
    posterior = sample(known.problem, known.at, known.names, seed=seed, steps=known.steps)
    found = np.quantile(posterior.flat, [0.05, 0.95], axis=0)
    width = np.ptp(known.ends, axis=1)
    off = abs(np.ptp(found, axis=0) / width - 1).max(), (abs(found - known.ends.T) / width).max()
    return {"usable": posterior.usable, "right": bool(max(off) <= OFF)}


def counted(runs: Sequence[dict[str, Any]]) -> dict[str, int]:
    """How many runs are right, usable, wrong although usable, and refused although right."""
    return {
        "runs": len(runs),
        "right": sum(run["right"] for run in runs),
        "usable": sum(run["usable"] for run in runs),
        "wrong": sum(run["usable"] and not run["right"] for run in runs),
        "refused": sum(run["right"] and not run["usable"] for run in runs),
    }


def verdicts(names: Sequence[str], seeds: Sequence[int]) -> dict[str, dict[str, int]]:
    """The counts of some densities, each with every seed."""
    found = {}
    for name in names:
        known = DENSITIES[name]()
        found[name] = counted([judged(known, seed) for seed in seeds])
        print(name, found[name], flush=True)
    return found
