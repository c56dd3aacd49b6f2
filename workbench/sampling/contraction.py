"""How much narrower a posterior is than its prior, entry by entry."""

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks.layout import entries
from workbench.problem import Linearization, Problem
from workbench.sampling.descent import rows_between

WIDTH = 10  # characters of a bar


def prior_deviations(
    problem: Problem,
    at: Mapping[str, ArrayLike],
    names: str | Iterable[str],
    priors: Iterable[str],
) -> Array:
    """The standard deviation (k,) of each named entry before there are data, by J'J of the priors.

    `priors` are the names of the residuals that are priors, taken as linear at `at`. An entry
    between two bounds has at most the spread of a uniform distribution there. Infinite where
    nothing is known beforehand. Raises UnknownName for a prior that is no residual.
    """
    here = problem.linearize(at)
    named = entries(problem.free, names)
    told = here.dense[problem.rows_named(tuple(priors))]
    J = np.vstack([told, rows_between(problem.lower, problem.upper, np.sqrt(12))])
    if not len(J):
        return np.full(len(named), np.inf)
    return np.asarray(np.sqrt(np.diag(Linearization(np.zeros(len(J)), J).covariance))[named])


def contraction(sd: Array, before: Array) -> Array:
    """1 - sd / before, (k,): 0 if the data said nothing, near 1 if they said nearly all.

    `before` (k,) are the prior's standard deviations; NaN where these are not known. It is negative
    where the posterior is wider than the prior.
    """
    known = np.isfinite(before) & (before > 0)
    return np.where(known, 1 - sd / np.where(known, before, 1.0), np.nan)


def contraction_bar(value: float, full: str = "#", empty: str = ".") -> str:
    """A contraction as a bar with its number, such as `0.72 #######...`; else `no prior known`."""
    if not np.isfinite(value):
        return "no prior known"
    filled = int(np.clip(round(WIDTH * value), 0, WIDTH))
    return f"{value:5.2f} {full * filled}{empty * (WIDTH - filled)}"
