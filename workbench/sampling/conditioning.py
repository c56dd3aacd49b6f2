r"""What stays where it is while draws are made, and how much wider the answer is without that.

With H = J'J at a mode, a for what is sampled and b for what is held fixed, Laplace's covariance of
a is H_aa^-1 given b (conditional), and the block (H^-1)_aa with b free as well (marginal). The
ratio of their standard deviations, at least 1, says what holding b fixed claims to know.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.blocks.layout import entries
from workbench.errors import joined
from workbench.problem import Linearization, Problem
from workbench.sampling.modes import rows_between
from workbench.sampling.subspace import Subspace

MOST_RATIO = 1.2  # of the standard deviations: above it, intervals are of another question
MOST_BLOCKS = 6  # blocks in a sentence


@dataclass(frozen=True, eq=False)
class Conditioning:
    """What is held fixed, and Laplace's standard deviations with and without it, (k,) each."""

    labels: tuple[str, ...]  # the entries that are sampled
    names: tuple[str, ...]  # what is held fixed, such as `betas` or `66 of the 72 numbers of pose`
    count: int  # how many numbers are held fixed
    given: tuple[str, ...]  # the blocks that are fixed in the problem itself
    conditional: Array  # (k,) standard deviations with these numbers held fixed
    # (k,) standard deviations with all numbers free; infinite where nothing determines them
    marginal: Array

    def of_entries(self, at: Index) -> "Conditioning":
        """The same of some entries (m,)."""
        return replace(
            self,
            labels=tuple(self.labels[i] for i in at),
            conditional=self.conditional[at],
            marginal=self.marginal[at],
        )

    @property
    def ratios(self) -> Array:
        """The marginal over the conditional standard deviations, (k,); 1 if nothing is held."""
        return np.asarray(self.marginal / self.conditional)

    @property
    def holds(self) -> bool:
        """Whether no interval is narrower by more than a factor of 1.2 for what is held."""
        return bool((self.ratios <= MOST_RATIO).all())

    @property
    def worst(self) -> int:
        """The entry with the largest ratio."""
        return int(np.argmax(self.ratios))

    @property
    def what(self) -> str:
        """The names of what is held fixed."""
        if len(self.names) > MOST_BLOCKS:
            more = len(self.names) - MOST_BLOCKS
            return f"{', '.join(self.names[:MOST_BLOCKS])} and {more} blocks more"
        return joined(self.names)

    def __str__(self) -> str:
        if not self.count:
            return "Held fixed: nothing; every free number is sampled or integrated out."
        numbers = "1 number" if self.count == 1 else f"{self.count:,} numbers"
        return f"Held fixed: {self.what} ({numbers}). {self.wider}."

    @property
    def wider(self) -> str:
        """How much wider intervals are with everything free: a sentence without a full stop."""
        i = self.worst
        if np.isinf(self.ratios[i]):
            return (
                f"With these free as well, the residuals do not determine {self.labels[i]} at all: "
                "its standard deviation is infinite"
            )
        return (
            f"With these free as well, standard deviations are up to {self.ratios[i]:.3g} times as "
            f"large ({self.labels[i]}, by J'J)"
        )

    @property
    def failed(self) -> str:
        """Why intervals are not usable, and what to do."""
        return (
            f"these draws hold {self.what} fixed, as if known exactly, so that intervals are "
            f"conditional. {self.wider}; at most {MOST_RATIO} is allowed. Name these blocks too, "
            "or integrate them out, as is done without `--conditional` (in Python rest=integrated)"
        )


def conditioning(problem: Problem, fixed_values: Array, space: Subspace, z: Array) -> Conditioning:
    """What a subspace holds fixed, and what that does to the spread at z (k,).

    What is between two bounds, or two limits of a constraint, has at most the spread of a uniform
    distribution there; entries with equal bounds, and what equations tie, are not free in the
    marginal either.
    """
    x = space.points(z[None])[0]
    here = problem.linearize_at(x, fixed_values)
    width = problem.upper - problem.lower
    span = space.span
    held = np.flatnonzero(~(span != 0).any(axis=1))
    J = np.vstack([here.dense, rows_between(problem.lower, problem.upper, np.sqrt(12))])
    constraints = problem.stacked_constraints
    if constraints is not None:
        limits = constraints.upper - constraints.lower
        between = np.isfinite(limits) & ~constraints.equal
        A = constraints.linearize(x, fixed_values).rows(between)
        J = np.vstack([J, A * (np.sqrt(12) / limits[between])[:, None]])
    count = problem.free.size - span.shape[1]
    if count == len(held):
        others = np.eye(problem.free.size)[:, held[width[held] > 0]]
    else:  # and directions of the rest that change no residual
        others = scipy.linalg.null_space(span.T)
    if constraints is not None and constraints.equal.any() and others.shape[1]:
        A = constraints.linearize(x, fixed_values).rows(constraints.equal)
        others = others @ scipy.linalg.null_space(A @ others)
    conditional = _deviations(J @ span)[: space.size]
    marginal = _deviations(J @ np.hstack([span, others]))[: space.size] if count else conditional
    return Conditioning(
        space.labels,
        _named(problem, held, count),
        count,
        problem.fixed.names,
        conditional,
        np.maximum(marginal, conditional),
    )


def _deviations(J: Array) -> Array:
    """The square roots of the diagonal of (J'J)^-1, infinite where J says nothing."""
    return np.asarray(np.sqrt(np.diag(Linearization(np.zeros(len(J)), J).covariance)))


def _named(problem: Problem, held: Index, count: int) -> tuple[str, ...]:
    names = []
    for name, part in problem.free.slices.items():
        size = part.stop - part.start
        own = int(np.sum((held >= part.start) & (held < part.stop)))
        if own:
            names.append(name if own == size else f"{own} of the {size} numbers of {name}")
    more = count - len(held)
    directions = "1 direction" if more == 1 else f"{more} directions"
    return (*names, directions) if more else tuple(names)


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
    of_priors = here.dense[problem.rows_named(tuple(priors))]
    J = np.vstack([of_priors, rows_between(problem.lower, problem.upper, np.sqrt(12))])
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
