"""Profile likelihoods: how the lowest cost rises as one entry is held away from its best value.

Laplace's interval of an entry is what a parabola through the minimum says. The profile follows the
true cost: at each value of the entry all other unknowns are fitted anew. The interval of level
a ends where the cost is above its minimum by half the a-quantile of chi-squared with one degree of
freedom (Venzon and Moolgavkar, A method for computing profile-likelihood-based confidence
intervals, 1988). It may be lopsided, and it may be open: then no value of the entry on that side is
refuted (Raue et al., Structural and practical identifiability analysis, Bioinformatics 2009).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import inf, sqrt

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.diagnostics import diagnose_whole
from workbench.errors import BadArgument, UnknownName
from workbench.problem import Problem
from workbench.solvers import DEFAULT, SOLVERS, Solver

FIRST = 0.5  # of Laplace's standard deviation: the first step
GROWTH, LONGEST = 1.5, 4.0  # of a step while the cost rises slowly, and its limit in deviations
MOST = 25  # fits on each side
PAST = 1.3  # of the rise at which the interval ends: where a side is followed to
CLOSE, REFINED = 0.02, 6  # of the root of the rise: how near a fit is to each end; fits for that
BETTER = 1e-6  # of the cost, by which another minimum has to be lower


@dataclass(frozen=True, eq=False)
class Profile:
    """The profile of one entry.

    Attributes:
        entry: its name, such as `betas[0]`.
        unit: what it is measured in.
        best: its value at the minimum.
        sd: its standard deviation by Laplace's approximation; infinite where a null direction
            takes part.
        level: of the interval.
        at: (k,) values of the entry, rising.
        costs: (k,) the lowest cost that was found at each.
        fits: all unknowns at each of these.
        lower: values at a lower cost than the first ones had, if the fits came upon some.
    """

    entry: str
    unit: str
    best: float
    sd: float
    level: float
    at: Array
    costs: Array
    fits: tuple[Values, ...] = field(repr=False)
    lower: Values | None = field(default=None, repr=False)

    @property
    def rise(self) -> float:
        """How far the cost is above its minimum at the ends of the interval."""
        return _rise(self.level)

    @property
    def interval(self) -> tuple[float, float]:
        """The values of the entry, on either side, at which the cost has risen by `rise`.

        One is infinite if the cost does not rise so far within the profile.
        """
        roots = np.sqrt(np.maximum(self.costs - self.costs.min(), 0))
        least, end = int(np.argmin(self.costs)), sqrt(self.rise)
        return (
            _crossing(self.at[least::-1], roots[least::-1], end, -inf),
            _crossing(self.at[least:], roots[least:], end, inf),
        )

    @property
    def laplace(self) -> tuple[float, float]:
        """The interval of the same level by Laplace's approximation."""
        reach = sqrt(2 * self.rise) * self.sd
        return self.best - reach, self.best + reach

    def __str__(self) -> str:
        """The interval in a sentence, beside Laplace's."""
        low, high = self.interval
        unit = "" if self.unit == "1" else f" {self.unit}"
        told = f"{self.entry} is between {_said(low)} and {_said(high)}{unit} ({self.level:.0%})"
        if low == -inf and high == inf:
            told = f"nothing bounds {self.entry} between {_ends(self.at, unit)}"
        elif low == -inf or high == inf:
            side, end = ("below", high) if low == -inf else ("above", low)
            followed = self.at[0] if low == -inf else self.at[-1]
            told = (
                f"{self.entry} is {side} {_said(end)}{unit} ({self.level:.0%}); on the other side "
                f"nothing bounds it up to {followed:.4g}{unit}"
            )
        if np.isfinite(self.sd):
            a, b = self.laplace
            told += f"; Laplace says {_said(a)} to {_said(b)}"
        if self.lower is not None:
            told += "; on the way there is a lower minimum, so that the fit was not at the best one"
        return told


def profile_likelihood(
    problem: Problem,
    values: Mapping[str, ArrayLike],
    entry: str,
    *,
    level: float = 0.9,
    solver: Solver = SOLVERS[DEFAULT],
    progress: Callable[[int], object] | None = None,
) -> Profile:
    """Follow the lowest cost to both sides of a free entry's value at the minimum `values`.

    `entry` is the name of a single number, such as `betas[0]` or `pose[left_knee, x]`. Every fit
    starts from the one before it. A side ends where the cost has risen past the end of the
    interval, or after 25 fits. `progress` is told how many fits are done.

    Raises UnknownName for an entry that is not free, and BadArgument for a level that is not
    between 0 and 1 and for a problem with nothing else free.

    >>> import casadi, numpy as np, workbench as wb
    >>> from workbench.fitting import profile_likelihood
    >>> from workbench.residuals import Residual
    >>> x = wb.Block("x", (2,))
    >>> seen = Residual("sum and difference", casadi.vertcat(
    ...     x.symbol[0] + x.symbol[1], x.symbol[0] - x.symbol[1]), 1.0)
    >>> found = profile_likelihood(wb.Problem([seen], ["x"]), {"x": [0, 0]}, "x[0]", level=0.9)
    >>> np.round([*found.interval, *found.laplace], 3).tolist()
    [-1.163, 1.163, -1.163, 1.163]
    """
    if not 0 < level < 1:
        raise BadArgument(f"the level of an interval is between 0 and 1, not {level:g}")
    labels = problem.free.single_labels
    if entry not in labels:
        raise UnknownName("free entry", entry, labels)
    if len(labels) < 2:
        raise BadArgument(
            f"{entry} is all that is free, so that there is nothing to fit; look at the cost itself"
        )
    found = diagnose_whole(problem, values)
    sd = float(found.identifiability.sigma[labels[entry]])
    yardstick = float(found.scales.sizes[labels[entry]])
    walk = _Walk(
        problem,
        problem.freeing(*(name for name in labels if name != entry)),
        labels[entry],
        solver,
        _rise(level),
        FIRST * min(sd, yardstick),
        LONGEST * min(sd, yardstick),
        progress,
    )
    start = problem.read(values)
    best = float(problem.split(start)[0][labels[entry]])
    middle = (best, found.here.cost, start)
    below, above = (walk.refined(middle, walk.followed(middle, sign)) for sign in (-1, 1))
    at, costs, fits = zip(*below[::-1], middle, *above, strict=True)
    k = int(np.argmin(costs))
    lower = fits[k] if costs[k] < found.here.cost * (1 - BETTER) else None
    unit = problem.free.unit(labels[entry])
    return Profile(entry, unit, best, sd, level, np.array(at), np.array(costs), tuple(fits), lower)


_Fit = tuple[float, float, Values]  # the entry's value, the cost, all values


@dataclass
class _Walk:
    """Fits on one side after the other, each from the one before."""

    problem: Problem
    others: Problem
    place: int
    solver: Solver
    rise: float
    first: float
    longest: float
    progress: Callable[[int], object] | None
    done: int = 0

    def followed(self, middle: _Fit, sign: int) -> list[_Fit]:
        found: list[_Fit] = []
        (at, before, values), step = middle, self.first
        least = before
        for _ in range(MOST):
            at, cost, values = self._fit(values, at + sign * step)
            found.append((at, cost, values))
            least = min(least, cost)
            if cost - least > PAST * self.rise:
                break
            if cost - before < 0.3 * self.rise:
                step = min(GROWTH * step, self.longest)
            before = cost
        return found

    def refined(self, middle: _Fit, side: list[_Fit]) -> list[_Fit]:
        """A side with fits near the end of the interval, where it crosses it."""
        end = sqrt(self.rise)
        for _ in range(REFINED):
            there = [middle, *side]
            least = min(cost for _, cost, _ in there)
            roots = np.sqrt([max(cost - least, 0.0) for _, cost, _ in there])
            past = np.flatnonzero(roots >= end)
            if not len(past) or past[0] == 0 or np.abs(roots - end).min() < CLOSE * end:
                break
            k = int(past[0])
            at = np.array([one[0] for one in there])
            share = (end - roots[k - 1]) / (roots[k] - roots[k - 1])
            between = at[k - 1] + min(max(share, 0.2), 0.8) * (at[k] - at[k - 1])
            side.insert(k - 1, self._fit(there[k - 1][2], float(between)))
        return side

    def _fit(self, values: Values, at: float) -> _Fit:
        found = self._fitted(values, at)
        self.done += 1
        if self.progress is not None:
            self.progress(self.done)
        return at, self.problem.linearize(found).cost, found

    def _fitted(self, values: Values, at: float) -> Values:
        x, fixed = self.problem.split(values)
        x[self.place] = at
        there = self.problem.values(x, fixed)
        return {**there, **self.solver.solve(self.others, there).values}


def _rise(level: float) -> float:
    """Half the quantile of chi squared with one degree of freedom, which is a squared normal."""
    return float(ndtri((1 + level) / 2) ** 2) / 2


def _crossing(at: Array, roots: Array, end: float, nowhere: float) -> float:
    """Where the root of the rise first comes to `end`, by linear interpolation."""
    past = np.flatnonzero(roots >= end)
    if not len(past):
        return nowhere
    k = int(past[0])
    share = (end - roots[k - 1]) / (roots[k] - roots[k - 1])
    return float(at[k - 1] + share * (at[k] - at[k - 1]))


def _said(number: float) -> str:
    return f"{number:.4g}"


def _ends(at: Array, unit: str) -> str:
    return f"{at[0]:.4g} and {at[-1]:.4g}{unit}"
