"""Counts with exact intervals, medians with exact intervals, and exact tests of who is ahead.

Everything here holds for small numbers too, and says how often it is wrong: an interval that cannot
be had at the stated confidence is not given.
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from math import comb

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array

LEVEL = 0.05  # of every test; intervals have the confidence 1 - LEVEL
FEWEST = 6  # numbers for an interval of their median, and decided problems for a test
TIE = 0.01  # efforts that differ by less, as a share of the smaller one, are equal


@dataclass(frozen=True)
class Interval:
    """An estimate, and between which numbers it lies with a confidence of `coverage` or more, at
    least 95 %; NaN where there is no such interval.
    """

    value: float
    low: float = np.nan
    high: float = np.nan
    coverage: float = np.nan

    @property
    def bounded(self) -> bool:
        """Whether there is one."""
        return not np.isnan(self.low)


def rate(successes: int, trials: int) -> Interval:
    """A proportion of independent trials with the exact interval of Clopper and Pearson (Biometrika
    26, 1934): for every true proportion it covers in at least 95 % of the cases.
    """
    if trials == 0:
        return Interval(np.nan)
    from scipy.special import betaincinv  # which takes a quarter of a second to import

    k, n, tail = successes, trials, LEVEL / 2
    low = 0.0 if k == 0 else float(betaincinv(k, n - k + 1, tail))
    high = 1.0 if k == n else float(betaincinv(k + 1, n - k, 1 - tail))
    return Interval(k / n, low, high, 1 - LEVEL)


def median(numbers: ArrayLike) -> Interval:
    """The median, failures counted as infinite, between two order statistics (David and Nagaraja,
    Order Statistics, third edition, 2003, section 7.1).

    Of n independent numbers the median of their distribution lies between the k-th smallest and the
    k-th largest with probability 1 - 2 P(B < k) or more, B being binomial (n, 1/2), for every
    distribution. k is the largest for which that is 95 %; below FEWEST = 6 numbers there is none.
    The value is NaN if one of the numbers is.
    """
    x = np.sort(np.asarray(numbers, dtype=float).ravel())
    n = x.size
    if n == 0 or np.isnan(x).any():
        return Interval(np.nan)
    a, b = float(x[(n - 1) // 2]), float(x[n // 2])
    middle = a if a == b else (a + b) / 2  # two equal infinities: their mean is not NaN
    k = 0
    while 2 * _below(k + 1, n) <= LEVEL:
        k += 1
    if k == 0:
        return Interval(middle)
    return Interval(middle, float(x[k - 1]), float(x[n - k]), 1 - 2 * _below(k, n))


def _below(k: int, n: int) -> float:
    """P(B < k) of a binomial B (n, 1/2), from whole numbers."""
    whole: int = 2**n
    return sum(comb(n, i) for i in range(k)) / whole


def sign_test(first: int, second: int) -> float:
    """The exact two-sided p-value of two numbers of wins.

    It is the probability that a number of wins is at least as far from one half of all as here, if
    each win is equally likely for both.
    """
    n, most = first + second, max(first, second)
    return min(1.0, 2 * _below(n - most + 1, n))


def holm(p_values: Sequence[float]) -> list[float]:
    """p-values corrected for there being several (Holm, A simple sequentially rejective multiple
    test procedure, Scand. J. Statist. 6, 1979): the probability that any true null hypothesis has
    one of at most alpha is at most alpha.
    """
    m = len(p_values)
    order = sorted(range(m), key=lambda i: p_values[i])
    corrected, highest = [1.0] * m, 0.0
    for rank, i in enumerate(order):
        highest = max(highest, min(1.0, (m - rank) * p_values[i]))
        corrected[i] = highest
    return corrected


@dataclass(frozen=True)
class PairedTest:
    """Two solvers compared from the same starts.

    Several starts of one problem are not independent evidence. A problem is therefore won by the
    solver that won more of its starts, and the test compares problems.
    """

    first: int  # from how many starts the first solver needed less
    second: int  # from how many starts the second solver needed less
    ties: int  # from how many starts both needed equally much
    both_fail: int  # from how many starts both failed
    # on how many problems the first was ahead, and on how many the second
    problems: tuple[int, int]
    # the p-value corrected for all pairs that were compared; NaN if there are no other pairs
    corrected: float = np.nan

    @property
    def p(self) -> float:
        """The p-value of the exact two-sided sign test on problems."""
        return sign_test(*self.problems)

    @property
    def decided(self) -> bool:
        """Whether one is ahead beyond chance, at the level of 5 % for all pairs together."""
        return (self.p if np.isnan(self.corrected) else self.corrected) <= LEVEL

    @property
    def turned(self) -> "PairedTest":
        """The same comparison with the two solvers exchanged."""
        return replace(
            self,
            first=self.second,
            second=self.first,
            problems=(self.problems[1], self.problems[0]),
        )

    @property
    def won(self) -> bool:
        """Whether the first is ahead beyond chance."""
        return self.decided and self.problems[0] > self.problems[1]


def paired_test(
    a: ArrayLike, b: ArrayLike, problems: Sequence[Hashable], tie: float = TIE
) -> PairedTest:
    """Compare two solvers by their efforts (P,) from the same starts, infinite where one failed.

    `problems` names the problem of each start. Efforts that differ by at most the share `tie` are a
    tie. A start at which an effort is unknown (NaN) is left out, unless the other solver failed.
    """
    x, y = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    fails = np.isposinf(x) & np.isposinf(y)
    with np.errstate(invalid="ignore"):
        tied = ~fails & (abs(x - y) <= tie * np.minimum(x, y))
        first = ~fails & ~tied & ((x < y) | (np.isnan(x) & np.isposinf(y)))
        second = ~fails & ~tied & ((x > y) | (np.isnan(y) & np.isposinf(x)))
    ahead: dict[Hashable, int] = {}
    for problem, won in zip(problems, first.astype(int) - second.astype(int), strict=True):
        ahead[problem] = ahead.get(problem, 0) + int(won)
    of_problems = sum(v > 0 for v in ahead.values()), sum(v < 0 for v in ahead.values())
    return PairedTest(
        int(first.sum()), int(second.sum()), int(tied.sum()), int(fails.sum()), of_problems
    )


def holm_corrected(tests: Sequence[PairedTest]) -> list[PairedTest]:
    """The comparisons with p-values corrected for their number."""
    return [replace(d, corrected=p) for d, p in zip(tests, holm([d.p for d in tests]), strict=True)]


def ratios(times: ArrayLike) -> Array:
    """(P, S): each solver's effort over the least on the problem; infinite if it failed."""
    t = np.asarray(times, dtype=float)
    if t.shape[1] == 0:
        return t
    least = t.min(axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        over_least = np.where(t == least, 1.0, t / least)
    return np.where(np.isinf(t), np.inf, over_least)


def performance_profile(times: ArrayLike, alphas: ArrayLike) -> Array:
    """rho_s(alpha), (len(alphas), S): the share of problems on which a solver needs at most alpha
    times what the best of them needs (Dolan and More, Math. Program. 91, 2002).
    """
    return _shares(ratios(times), alphas)


def data_profile(times: ArrayLike, unknowns: ArrayLike, kappas: ArrayLike) -> Array:
    """d_s(kappa), (len(kappas), S): the share of problems solved within kappa simplex gradients,
    that is kappa (n_p + 1) residuals (More and Wild, SIAM J. Optim. 20, 2009).
    """
    t, n = np.asarray(times, dtype=float), np.asarray(unknowns, dtype=float)
    return _shares(t / (n[:, None] + 1), kappas)


def _shares(amounts: Array, limits: ArrayLike) -> Array:
    limit = np.asarray(limits, dtype=float)
    if not len(amounts):
        return np.zeros((limit.size, amounts.shape[1]))
    within = amounts[None] <= limit[:, None, None] * (1 + 1e-12)
    return np.asarray(np.mean(within & np.isfinite(amounts)[None], axis=1))
