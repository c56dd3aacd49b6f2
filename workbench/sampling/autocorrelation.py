"""How many steps a chain takes to forget, and whether independent chains agree.

Draws are (E, S, W): E independent ensembles, S steps, W walkers. Walkers of one ensemble propose
from each other and are no independent chains; ensembles are.
"""

import numpy as np
import scipy.fft
import scipy.special

from workbench.arrays import Array

TOGETHER = 64  # chains in one transform
WINDOW = 5.0  # autocorrelation times: Sokal's compromise between bias and noise


def integrated_time(draws: Array) -> float:
    """The integrated autocorrelation time in steps, at least 1 (Sokal 1997, emcee's window).

    Deviations are from the mean of everything, not of each walker: a walker that stays where it
    began has then an endless memory, as it should. Of constant draws it is infinite.
    """
    S = draws.shape[1]
    deviations = (draws - draws.mean()).transpose(0, 2, 1).reshape(-1, S)
    n = scipy.fft.next_fast_len(2 * S)
    power = np.zeros(n // 2 + 1)
    for first in range(0, len(deviations), TOGETHER):
        some = scipy.fft.rfft(deviations[first : first + TOGETHER], n, axis=1)
        power += np.sum(some.real**2 + some.imag**2, axis=0)
    covariance = scipy.fft.irfft(power, n)[:S]
    if not covariance[0] > 0:
        return np.inf
    times = 2 * np.cumsum(covariance / covariance[0]) - 1
    inside = np.arange(S) < WINDOW * times
    window = int(np.argmin(inside)) if not inside.all() else S - 1
    return float(max(1.0, times[window]))


def potential_scale(draws: Array) -> float:
    """Rank-normalised split R-hat of ensembles (Vehtari et al. 2021), the larger of bulk and tails.

    1 where ensembles, and their first and second halves, have the same distribution.
    """
    E, S, _ = draws.shape
    half = S // 2
    if half == 0:
        return np.inf
    halves = np.concatenate([draws[:, :half], draws[:, S - half :]]).reshape(2 * E, -1)
    if np.ptp(halves) == 0:
        return np.inf
    folded = abs(halves - np.median(halves))
    return max(_plain_scale(_normal_scores(part)) for part in (halves, folded))


def _normal_scores(chains: Array) -> Array:
    from scipy.stats import rankdata  # a second to import: not before it is needed

    ranks = rankdata(chains, axis=None).reshape(chains.shape)
    return np.asarray(scipy.special.ndtri((ranks - 0.375) / (chains.size + 0.25)))


def _plain_scale(chains: Array) -> float:
    n = chains.shape[1]
    within = chains.var(axis=1, ddof=1).mean()
    between = n * chains.mean(axis=1).var(ddof=1)
    return float(np.sqrt((n - 1) / n + between / (n * within))) if within > 0 else np.inf


def disagreement(draws: Array, time: float) -> float:
    """The chance that ensembles whose memory is `time` steps have means as far apart as these.

    With the memory right, (E - 1) times the variance of E means, over the one that it predicts,
    is chi-square of E - 1. A tiny chance says that the memory is longer than it looks.
    """
    E, S, W = draws.shape
    predicted = draws.var() * time / (S * W)
    if E < 2 or not np.isfinite(predicted) or predicted == 0:
        return np.nan
    found = draws.reshape(E, -1).mean(axis=1).var(ddof=1)
    return float(scipy.special.chdtrc(E - 1, (E - 1) * found / predicted))
