"""What one linearization does not tell: profiles of the cost, and other minima.

Laplace's interval of an entry is what a parabola through the minimum says. The profile follows the
true cost: at each value of the entry all other unknowns are fitted anew. The interval of level
a ends where the cost is above its minimum by half the a-quantile of chi-squared with one degree of
freedom (Venzon and Moolgavkar, A method for computing profile-likelihood-based confidence
intervals, 1988). It may be lopsided, and it may be open: then no value of the entry on that side is
refuted (Raue et al., Structural and practical identifiability analysis, Bioinformatics 2009).

A direction that is weak at one point may be the floor of a valley, along which every point is as
good, or the way into a second basin, at nearly the same cost. So the fit is repeated from points on
both sides along the weakest directions, and the ends are told apart.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import inf, sqrt

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike
from scipy.special import ndtri

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.blocks.layout import in_units
from workbench.diagnostics import diagnose_whole
from workbench.errors import BadArgument, UnknownName
from workbench.problem import Problem
from workbench.solvers import DEFAULT, SOLVERS, Solver

FIRST_STEP = 0.5  # of Laplace's standard deviation: the first step
STEP_GROWTH, LONGEST_STEP = 1.5, 4.0  # while the cost rises slowly; in standard deviations
MOST_FITS = 25  # fits on each side
PAST_THE_END = 1.3  # of the rise at which the interval ends: where a side is followed to
NEAR_THE_END = 0.02  # of the root of the rise: how near a fit is to each end of the interval
MOST_REFINEMENTS = 6  # fits for that
BETTER_SHARE = 1e-6  # of the cost, by which another minimum has to be lower
START_DEVIATIONS = 3.0  # standard deviations: how far a start is from the minimum
FARTHEST_START = 1.5  # characteristic scales: but no farther than this
START_SHARES = (1.0, 0.5, -1.0, -0.5)  # of this distance: where the starts are, on both sides
SAME_MINIMUM = 0.01  # characteristic scales of each entry: nearer ends are one
SAME_COST = 1e-6  # of 1 + cost: ends of the same cost that are apart are in one valley


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
        (low, high), (first, last) = self.interval, (self.at[0], self.at[-1])
        unit, level = "" if self.unit == "1" else f" {self.unit}", f"({self.level:.0%})"
        other = "on the other side nothing bounds it up to"
        match low == -inf, high == inf:
            case True, True:
                text = f"nothing bounds {self.entry} between {first:.4g} and {last:.4g}{unit}"
            case True, False:
                text = f"{self.entry} is below {high:.4g}{unit} {level}; {other} {first:.4g}{unit}"
            case False, True:
                text = f"{self.entry} is above {low:.4g}{unit} {level}; {other} {last:.4g}{unit}"
            case _:
                text = f"{self.entry} is between {low:.4g} and {high:.4g}{unit} {level}"
        if np.isfinite(self.sd):
            a, b = self.laplace
            text += f"; Laplace says {a:.4g} to {b:.4g}"
        if self.lower is not None:
            text += "; on the way there is a lower minimum, so that the fit was not at the best one"
        return text


def profile_likelihood(
    problem: Problem,
    values: Mapping[str, ArrayLike],
    entry: str,
    *,
    level: float = 0.9,
    solver: Solver = SOLVERS[DEFAULT],
) -> Profile:
    """Follow the lowest cost to both sides of a free entry's value at the minimum `values`.

    `entry` is the name of a single number, such as `betas[0]` or `pose[left_knee, x]`. Every fit
    starts from the one before it. A side ends where the cost has risen past the end of the
    interval, or after 25 fits.

    Raises UnknownName for an entry that is not free, and BadArgument for a level that is not
    between 0 and 1 and for a problem with nothing else free.
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
    k = labels[entry]
    whole = diagnose_whole(problem, values)
    sd = float(whole.identifiability.sigma[k])
    size = min(sd, float(whole.scales.sizes[k]))
    others = problem.freeing(*(name for name in labels if name != entry))

    def fit(values: Values, value: float) -> _Fit:
        x, fixed = problem.split(values)
        x[k] = value
        fitted = problem.values(x, fixed)
        fitted = {**fitted, **solver.solve(others, fitted).values}
        return value, problem.linearize(fitted).cost, fitted

    start = problem.read(values)
    best = float(problem.split(start)[0][k])
    middle = (best, whole.here.cost, start)
    below, above = (_fits_on_one_side(fit, middle, sign * size, _rise(level)) for sign in (-1, 1))
    at, costs, fits = zip(*below[::-1], middle, *above, strict=True)
    least = int(np.argmin(costs))
    lower = fits[least] if costs[least] < whole.here.cost * (1 - BETTER_SHARE) else None
    unit = problem.free.unit(k)
    return Profile(entry, unit, best, sd, level, np.array(at), np.array(costs), tuple(fits), lower)


_Fit = tuple[float, float, Values]  # the entry's value, the cost, all values


def _fits_on_one_side(
    fit: Callable[[Values, float], _Fit], middle: _Fit, size: float, rise: float
) -> list[_Fit]:
    """Fits on one side, each from the one before, and more where the cost has risen by `rise`.

    Steps are FIRST_STEP to LONGEST_STEP signed sizes.
    """
    side: list[_Fit] = []
    (value, before, values), step = middle, FIRST_STEP
    least = before
    for _ in range(MOST_FITS):
        value, cost, values = fit(values, value + step * size)
        side.append((value, cost, values))
        least = min(least, cost)
        if cost - least > PAST_THE_END * rise:
            break
        if cost - before < 0.3 * rise:
            step = min(STEP_GROWTH * step, LONGEST_STEP)
        before = cost
    end = sqrt(rise)
    for _ in range(MOST_REFINEMENTS):
        fits = [middle, *side]
        costs = np.array([cost for _, cost, _ in fits])
        roots = np.sqrt(costs - costs.min())
        past = np.flatnonzero(roots >= end)
        if not len(past) or past[0] == 0 or np.abs(roots - end).min() < NEAR_THE_END * end:
            break
        k = int(past[0])
        share = min(max((end - roots[k - 1]) / (roots[k] - roots[k - 1]), 0.2), 0.8)
        between = fits[k - 1][0] + share * (fits[k][0] - fits[k - 1][0])
        side.insert(k - 1, fit(fits[k - 1][2], float(between)))
    return side


def _rise(level: float) -> float:
    """Half the quantile of chi squared with one degree of freedom, which is a squared normal."""
    return float(ndtri((1 + level) / 2) ** 2) / 2


def _crossing(entry_values: Array, roots: Array, end: float, nowhere: float) -> float:
    """Where the root of the rise first comes to `end`, by linear interpolation."""
    past = np.flatnonzero(roots >= end)
    if not len(past):
        return nowhere
    k = int(past[0])
    share = (end - roots[k - 1]) / (roots[k] - roots[k - 1])
    return float(entry_values[k - 1] + share * (entry_values[k] - entry_values[k - 1]))


@dataclass(frozen=True, eq=False)
class OtherMinimum:
    """An end that is not the first one, to which some `starts` led.

    `excess` is its cost minus that of the first, and `apart` the largest difference of an `entry`
    from there, in characteristic scales.
    """

    values: Values = field(repr=False)
    excess: float
    apart: float
    entry: str
    starts: int


@dataclass(frozen=True, eq=False)
class OtherMinima:
    """What so many starts along the weakest directions, in words, ended in: some came back to the
    first minimum; those in the valley have the same cost, apart from it, and the other minima have
    other costs, the lowest first.
    """

    starts: int
    came_back: int
    valley: tuple[OtherMinimum, ...]
    minima: tuple[OtherMinimum, ...]
    directions: tuple[str, ...] = field(repr=False)

    @property
    def better(self) -> tuple[OtherMinimum, ...]:
        """The minima at a lower cost than the first."""
        return tuple(minimum for minimum in self.minima if minimum.excess < 0)

    def __str__(self) -> str:
        """All of it in sentences."""
        sentences = [
            f"Of {self.starts} fits from starts on both sides along the {len(self.directions)} "
            f"weakest directions, {self.came_back} came back."
        ]
        if self.valley:
            far = max(self.valley, key=lambda minimum: minimum.apart)
            starts = sum(minimum.starts for minimum in self.valley)
            sentences.append(
                f"{starts} ended elsewhere at the same cost, up to {far.apart:.2g} characteristic "
                f"scales away in {far.entry}: this is a valley, and where a fit ends in it is "
                "arbitrary."
            )
        for minimum in self.minima:
            side = "above" if minimum.excess > 0 else "below"
            sentences.append(
                f"{minimum.starts} ended in another minimum, at a cost {abs(minimum.excess):.3g} "
                f"{side}, which differs most in {minimum.entry}, by {minimum.apart:.2g} "
                "characteristic scales."
            )
        if self.better:
            sentences.append("The fit was not at the best minimum.")
        if not self.valley and not self.minima:
            sentences.append("No other minimum was found this way.")
        return " ".join(sentences)


def other_minima(
    problem: Problem,
    values: Mapping[str, ArrayLike],
    *,
    directions: int = 8,
    solver: Solver = SOLVERS[DEFAULT],
) -> OtherMinima:
    """Fit from four starts along each of the weakest directions at the minimum `values`.

    On each side of the minimum there are two starts: at three standard deviations along the
    direction, but at most 1.5 characteristic scales, and at half this distance. Minima in no such
    direction are not found. Raises BadArgument for no directions.
    """
    if directions < 1:
        raise BadArgument(f"one direction or more is looked along, not {directions}")
    whole = diagnose_whole(problem, values)
    sizes, first_cost = whole.scales.sizes, whole.here.cost
    J = whole.here.dense * sizes
    weakest = (0, min(directions, J.shape[1]) - 1)
    squares, vectors = scipy.linalg.eigh(J.T @ J, subset_by_index=weakest)
    s, basis = np.sqrt(np.maximum(squares, 0)), vectors.T
    x, fixed = problem.split(values)
    lengths = np.minimum(START_DEVIATIONS / np.maximum(s, 1e-300), FARTHEST_START)
    starts = [
        np.clip(x + share * length * sizes * d, problem.lower, problem.upper)
        for d, length in zip(basis, lengths, strict=True)
        for share in START_SHARES
    ]

    def same(a: Array, b: Array) -> bool:
        return float(np.abs((a - b) / sizes).max()) < SAME_MINIMUM

    came_back = 0
    ends: list[tuple[Array, float]] = []  # points that differ, and their costs
    counts: list[int] = []  # how many starts led to each
    for start in starts:
        solution = solver.solve(problem, problem.values(start, fixed))
        end = problem.split({**values, **solution.values})[0]
        known = next((i for i, (point, _) in enumerate(ends) if same(end, point)), None)
        if same(end, x):
            came_back += 1
        elif known is not None:
            counts[known] += 1
        else:
            ends.append((end, solution.cost))
            counts.append(1)
    others = []
    for (end, cost), count in zip(ends, counts, strict=True):
        away = np.abs((end - x) / sizes)
        k = int(np.argmax(away))
        excess, entry = cost - first_cost, problem.free.label(k)
        end_values = problem.values(end, fixed)
        others.append(OtherMinimum(end_values, excess, float(away[k]), entry, count))
    level = SAME_COST * (1 + first_cost)
    valley = tuple(other for other in others if abs(other.excess) <= level)
    minima = [other for other in others if abs(other.excess) > level]
    minima.sort(key=lambda other: other.excess)
    words = tuple(in_units(d * sizes, problem.free) for d in basis)
    return OtherMinima(len(starts), came_back, valley, tuple(minima), words)


def laplace_points(
    problem: Problem, values: Mapping[str, ArrayLike], count: int, seed: int = 0
) -> list[Values]:
    """Points drawn from N(x*, (J'J)^-1) at the minimum `values`, within the bounds; what the
    problem does not determine stays.
    """
    s, V = problem.linearize(values).spectrum.determined
    x, fixed = problem.split(values)
    steps = (np.random.default_rng(seed).standard_normal((count, len(s))) / s) @ V
    return [problem.values(np.clip(x + d, problem.lower, problem.upper), fixed) for d in steps]
