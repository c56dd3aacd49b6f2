"""Numbers with an interval around them: rates, medians, and who of two is ahead."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Z = 1.959963984540054  # of the standard normal, two-sided 95 %
RESAMPLED = 2_000


@dataclass(frozen=True)
class Interval:
    """An estimate, and between which numbers it lies with 95 % confidence."""

    value: float
    low: float
    high: float


def rate(successes: int, trials: int) -> Interval:
    """A proportion with Wilson's score interval (1927), which is right for 0 and for all, too."""
    if trials == 0:
        return Interval(np.nan, 0.0, 1.0)
    p, n = successes / trials, trials
    middle = (p + Z**2 / (2 * n)) / (1 + Z**2 / n)
    half = Z / (1 + Z**2 / n) * float(np.sqrt(p * (1 - p) / n + Z**2 / (4 * n**2)))
    low = 0.0 if successes == 0 else max(0.0, middle - half)
    high = 1.0 if successes == trials else min(1.0, middle + half)
    return Interval(p, low, high)


def median(numbers: ArrayLike, seed: int = 0) -> Interval:
    """The median, failures counted as infinite, with the percentile bootstrap (Efron 1979).

    Of a single number there is nothing to resample: its interval is unknown, NaN.
    """
    x = np.sort(np.asarray(numbers, dtype=float).ravel())
    if x.size == 0:
        return Interval(np.nan, np.nan, np.nan)
    if x.size == 1:
        return Interval(float(x[0]), np.nan, np.nan)
    rng = np.random.default_rng(seed)
    drawn = np.sort(x[rng.integers(0, x.size, (RESAMPLED, x.size))], axis=1)
    middles = np.sort(_middle(drawn))
    low, high = middles[int(0.025 * RESAMPLED)], middles[int(np.ceil(0.975 * RESAMPLED)) - 1]
    return Interval(float(_middle(x[None])[0]), float(low), float(high))


def _middle(rows: Array) -> Array:
    """Of sorted rows; the mean of two equal infinities is not NaN, of a finite and one infinite."""
    n = rows.shape[1]
    a, b = rows[:, (n - 1) // 2], rows[:, n // 2]
    return np.where(a == b, a, (a + b) / 2)


@dataclass(frozen=True)
class Duel:
    """Two solvers on the same starts: `first` needed less, `second` did, neither, or both fail."""

    first: int
    second: int
    ties: int
    both_fail: int

    @property
    def share(self) -> Interval:
        """Of the decided ones, how many the first won; Wilson's interval."""
        return rate(self.first, self.first + self.second)

    @property
    def decided(self) -> bool:
        """Whether the interval leaves out one half."""
        return self.share.low > 0.5 or self.share.high < 0.5


def duel(a: ArrayLike, b: ArrayLike, tie: float = 0.01) -> Duel:
    """Costs of two solvers (P,), infinite where one failed; within `tie` of each other is a tie."""
    x, y = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    fails = np.isinf(x) & np.isinf(y)
    with np.errstate(invalid="ignore"):
        tied = ~fails & (abs(x - y) <= tie * np.minimum(x, y))
    first, second = ~fails & ~tied & (x < y), ~fails & ~tied & (x > y)
    return Duel(int(first.sum()), int(second.sum()), int(tied.sum()), int(fails.sum()))
