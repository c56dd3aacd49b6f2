"""How many independent frames the frames of a video are worth, from the errors of its keypoints."""

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks.checks import reals
from workbench.fitting.observations import BadObservation


def effective_frames(errors: ArrayLike, known: ArrayLike | None = None) -> float:
    """The number of independent frames whose mean error is as uncertain as that of these T frames.

    Errors of a detector are alike from frame to frame: a constant part, such as a hip that is
    always found too far out, and noise that changes slowly. If x_t has the autocorrelation r_k
    about zero, the mean of T frames has the variance of the mean of

        n = T / (1 + 2 sum over k of (1 - k / T) r_k)

    independent ones (Geyer, Practical Markov chain Monte Carlo, 1992). With the sums of x_t x_{t+k}
    of all pairs of frames for r_k this is mean(x^2) / mean(x)^2, so that no lag has to be cut off.
    One series says little; the squares are therefore summed over all series, one for each
    coordinate of each landmark, before they are divided. White noise has n = T, a constant has
    n = 1, and noise with x_t = rho x_{t-1} + e_t has T (1 - rho) / (1 + rho) for large T.

    `errors` (T, ...) are differences that a fit left, in sigmas, one series for each entry of a
    frame; `known` of the same shape is False where nothing was observed. Errors that the fit took
    over into the shape or the pose are not among them, so that n is an estimate from above.
    The result is between 1 and T. Raises BadObservation if no series has two known frames, or if
    a known error is not finite.
    """
    x = reals("the errors of a video", errors)
    there = np.ones(x.shape, dtype=bool) if known is None else np.asarray(known, dtype=bool)
    if x.ndim == 0 or there.shape != x.shape:
        raise BadObservation(
            f"errors are (T, ...) and `known` has the same shape, not {x.shape} and {there.shape}"
        )
    x = np.where(there, x, 0.0).reshape(len(x), -1)
    if not np.isfinite(x).all():
        raise BadObservation("the errors of a video must be finite where something was observed")
    count = there.reshape(x.shape).sum(axis=0)
    used = count > 1
    if not used.any():
        raise BadObservation("no landmark was observed in two frames, so nothing can be compared")
    return worth_of_errors(x[:, used], count[used])


def worth_of_errors(x: Array, count: Array) -> float:
    """n of errors (T, M), zero where not known; `count` (M,) says how often each is known."""
    squares, sums = np.sum(x**2), np.sum(x.sum(axis=0) ** 2 / count)
    return float(np.clip(squares / sums if sums > 0 else np.inf, 1, len(x)))


def autocorrelation(errors: Array, known: Array) -> Array:
    """The correlation r_k about zero of errors k frames apart, (T,), of all series (T, ...) pooled.

    The products of all pairs of known frames are summed, and divided by the number of pairs. Lags
    with fewer pairs than one for each series are NaN.
    """
    x = np.where(known, errors, 0.0).reshape(len(errors), -1)
    there = np.asarray(known, dtype=float).reshape(x.shape)
    found = np.full(len(x), np.nan)
    for k in range(len(x)):
        pairs = np.sum(there[k:] * there[: len(x) - k])
        if pairs >= max(1, x.shape[1] // 2):
            found[k] = np.sum(x[k:] * x[: len(x) - k]) / pairs
    return found / found[0] if found[0] > 0 else found
