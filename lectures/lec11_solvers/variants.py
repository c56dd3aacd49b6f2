"""Exercises of lecture 11 with numbers of each student's own, for packs."""

import numpy as np
from scipy.stats import norm

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


@variant(
    "effort_until",
    points=2,
    minutes=15,
    draw=lambda rng: {
        "PRICES": [1.0, rounded(rng, 2.1, 9.9, digits=2), rounded(rng, 11, 60, digits=1)]
    },
    arguments=lambda rng, numbers: (
        np.exp(-np.arange(8) / 2) + rng.uniform(0, 0.2, 8),
        np.cumsum(rng.integers(0, 4, (8, 3)), axis=0),
        0.3,
    ),
)
def effort_until(costs: Array, counts: Array, goal: float, *, PRICES: list[float]) -> float:
    """The effort at which a run first visits a point that costs at most `goal`.

    Row k of `counts` is how many residuals, Jacobians and Hessians had been evaluated by point k; one of each
    costs PRICES (3,).

    costs (k,), which may rise again and reach the goal; counts (k, 3) -> an effort
    """
    return float(counts[np.flatnonzero(costs <= goal)[0]] @ PRICES)


@mistake("effort_until", "counts are running sums already: add up no rows")
def effort_until_of_sums(costs, counts, goal, *, PRICES):
    return float(counts[: np.flatnonzero(costs <= goal)[0] + 1].sum(axis=0) @ PRICES)


@variant(
    "profile",
    points=3,
    minutes=20,
    draw=lambda rng: {"ALPHAS": sorted(rounded(rng, 1.05, 3.9, count=4, digits=3))},
    arguments=lambda rng, numbers: (rng.uniform(1, 5, (7, 3)),),
)
def profile(times: Array, *, ALPHAS: list[float]) -> Array:
    """Performance profiles at ALPHAS: on which share of the problems is a solver's ratio at most alpha?

    The ratio is its time over the least time of any solver on the problem. All solvers solved all problems.

    times (P, S) above 0 -> (4, S), shares from 0 to 1
    """
    ratios = times / times.min(axis=1, keepdims=True)
    return np.array([np.mean(ratios <= alpha, axis=0) for alpha in ALPHAS])


@mistake(
    "profile", "the least time is that of all solvers on one problem, not of one solver on all"
)
def profile_by_solver(times, *, ALPHAS):
    ratios = times / times.min(axis=0, keepdims=True)
    return np.array([np.mean(ratios <= alpha, axis=0) for alpha in ALPHAS])


@variant(
    "wilson",
    points=2,
    minutes=12,
    draw=lambda rng: {"LEVEL": rounded(rng, 0.61, 0.985, digits=3)},
    arguments=lambda rng, numbers: (int(rng.integers(1, 15)), int(rng.integers(16, 40))),
    edges=lambda numbers: [(0, 10), (10, 10)],
)
def wilson(successes: int, trials: int, *, LEVEL: float) -> tuple[float, float]:
    """Wilson's interval of a share, of the confidence LEVEL (0.95 has z = 1.96).

    `scipy.stats.norm.ppf` is the quantile of the standard normal distribution.

    successes from 0 to trials -> two shares, low and high
    """
    p, n, z = successes / trials, trials, norm.ppf(0.5 + LEVEL / 2)
    middle, half = p + z**2 / (2 * n), z * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    return (middle - half) / (1 + z**2 / n), (middle + half) / (1 + z**2 / n)


@mistake("wilson", "the interval has two sides: z is the quantile of (1 + LEVEL) / 2")
def wilson_of_one_side(successes, trials, *, LEVEL):
    return wilson.solution(successes, trials, LEVEL=2 * LEVEL - 1)
