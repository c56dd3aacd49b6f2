"""How many steps a chain takes to forget: the integrated autocorrelation time."""

import numpy as np
import scipy.fft

from workbench.arrays import Array

TOGETHER = 64  # chains in one transform
WINDOW = 5.0  # autocorrelation times: Sokal's compromise between bias and noise


def integrated_time(draws: Array) -> float:
    """The integrated autocorrelation time in steps, at least 1 (Sokal 1997, emcee's window).

    Deviations are from the mean of everything, not of each walker: a walker that stays where it
    began has then an endless memory, as it should. Of constant draws it is infinite.
    """
    covariance, S = autocovariance(draws), draws.shape[1]
    if not covariance[0] > 0:
        return np.inf
    times = 2 * np.cumsum(covariance / covariance[0]) - 1
    inside = np.arange(S) < WINDOW * times
    window = int(np.argmin(inside)) if not inside.all() else S - 1
    return float(max(1.0, times[window]))


def autocovariance(draws: Array) -> Array:
    """The sum of products of deviations that are t steps apart, (S,), over all walkers.

    It is computed by the Fourier transform, padded so that the end does not meet the beginning.
    """
    S = draws.shape[1]
    deviations = (draws - draws.mean()).transpose(0, 2, 1).reshape(-1, S)
    n = scipy.fft.next_fast_len(2 * S)
    power = np.zeros(n // 2 + 1)
    for first in range(0, len(deviations), TOGETHER):
        some = scipy.fft.rfft(deviations[first : first + TOGETHER], n, axis=1)
        power += np.sum(some.real**2 + some.imag**2, axis=0)
    covariance: Array = scipy.fft.irfft(power, n)[:S]
    return covariance
