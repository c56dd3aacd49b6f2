"""Profiles: which share of the problems a solver solves within how much of the effort.

`times` is (P, S): what solver s needed on problem p, infinite where it failed, NaN nowhere.
"""

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array


def ratios(times: ArrayLike) -> Array:
    """(P, S): each solver's effort over the least on the problem; infinite if it failed."""
    t = np.asarray(times, dtype=float)
    if t.shape[1] == 0:
        return t
    least = t.min(axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        found = np.where(t == least, 1.0, t / least)
    return np.where(np.isinf(t), np.inf, found)


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
