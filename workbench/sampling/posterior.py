"""A posterior as draws, with what is known of their worth."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.blocks import Values
from workbench.errors import WorkbenchError
from workbench.problem import Problem
from workbench.sampling.arviz_quietly import inference_data
from workbench.sampling.conditioning import Conditioning
from workbench.sampling.descent import Mode
from workbench.sampling.importance import Importance
from workbench.sampling.mixing import Mixing, Verdict
from workbench.sampling.modes import Found, missed, searched
from workbench.sampling.subspace import Subspace
from workbench.sampling.text import summary

Array = NDArray[np.float64]


class NotConverged(WorkbenchError):
    """An interval was asked of draws that do not carry one."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """Draws of what was sampled, (E, S, W, k): ensembles, steps, walkers, entries.

    What they are worth is said by `mixing`, by the modes that were `found`, by `held` (what was
    held fixed, and how much wider intervals are without that), and by `importance` where a
    Gaussian stands for the posterior. The verdict draws on all of them; it stands before
    everything that is printed, and `interval` asks it.
    """

    problem: Problem = field(repr=False)
    at: Values = field(repr=False)  # of every block that the problem reads
    subspace: Subspace = field(repr=False)
    draws: Array = field(repr=False)
    log_prob: Array = field(repr=False)  # (E, S, W), up to a constant
    mixing: Mixing
    method: str  # `emcee` or `laplace`
    found: Found = field(repr=False)
    held: Conditioning = field(repr=False)
    importance: Importance | None = None
    seconds: float = 0.0
    interrupted: bool = False
    unsaved: str = ""  # why the last checkpoint could not be written; empty if it was

    @property
    def labels(self) -> tuple[str, ...]:
        """What was sampled: `betas[0]`, `pose[left_elbow, x]`."""
        return self.subspace.labels

    @property
    def units(self) -> tuple[str, ...]:
        """Of each of them."""
        return self.subspace.units

    @property
    def size(self) -> int:
        """k."""
        return self.subspace.size

    @cached_property
    def flat(self) -> Array:
        """All draws in one table (E S W, k)."""
        return self.draws.reshape(-1, self.size)

    @property
    def mean(self) -> Array:
        """(k,)."""
        return np.asarray(self.flat.mean(axis=0))

    @property
    def sd(self) -> Array:
        """(k,)."""
        return np.asarray(self.flat.std(axis=0))

    @property
    def covariance(self) -> Array:
        """(k, k)."""
        return np.atleast_2d(np.cov(self.flat.T))

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The minima of the cost that were found, the one with the largest mass first."""
        return self.found.modes

    @cached_property
    def missed(self) -> tuple[float, float] | None:
        """A mode that the draws hardly visit: its share of the mass, and of the draws; or None."""
        return missed(self.modes, self.flat)

    @cached_property
    def judged(self) -> tuple[Verdict, str]:
        """The verdict, and its reason: the first thing that is wrong, or what was looked at.

        In this order: chains that have not mixed; modes that draws miss; a Gaussian that does not
        hold; intervals that are narrow because of what was held fixed.
        """
        verdict, why = self.mixing.judged
        if verdict is not Verdict.USABLE:
            return verdict, why
        if self.missed is not None:
            share, here = self.missed
            return Verdict.MODE_MISSED, (
                f"least squares finds another mode with {share:.0%} of the mass (by Laplace's "
                f"approximation), where {here:.1%} of the draws are. "
                + (
                    "Laplace's approximation is of one mode; draw with `sample`"
                    if self.mixing.exact
                    else "Begin at the other mode and compare, or add what tells the modes apart"
                )
            )
        if self.importance is not None and not self.importance.holds:
            return Verdict.NOT_GAUSSIAN, str(self.importance)
        if not self.held.holds:
            mixed = "" if self.mixing.exact else f"the chains have mixed ({why}), but "
            return Verdict.CONDITIONAL, mixed + self.held.failed
        told = [
            why,
            *([] if self.importance is None else [str(self.importance)]),
            searched(self.found),
        ]
        return verdict, "; ".join(told)

    @property
    def usable(self) -> bool:
        """Whether intervals from these draws may be used as they are."""
        return self.judged[0] is Verdict.USABLE

    @property
    def mixed(self) -> bool:
        """Whether intervals mean something at least where what is held fixed is known exactly."""
        return self.judged[0] in (Verdict.USABLE, Verdict.CONDITIONAL)

    @property
    def verdict(self) -> str:
        """What the draws are worth, in a sentence or two."""
        verdict, why = self.judged
        return f"{verdict.value}: {why}"

    def interval(self, level: float = 0.9) -> Array:
        """The central interval of each entry (k, 2), `held.what` being fixed if anything is.

        Raises NotConverged unless the draws are usable. Where nothing is wrong but that what is
        held fixed makes the interval narrow, `conditional_interval` still gives it.
        """
        if not self.usable:
            raise NotConverged(f"there is no interval: {self.verdict}")
        return self._central(level)

    def conditional_interval(self, level: float = 0.9) -> Array:
        """The same for readers who know that it holds only if `held.what` is known exactly.

        (k, 2). Raises NotConverged if the draws are worth nothing even so.
        """
        if not self.mixed:
            raise NotConverged(f"there is no interval: {self.verdict}")
        return self._central(level)

    def _central(self, level: float) -> Array:
        tail = (1 - level) / 2
        return np.quantile(self.flat, [tail, 1 - tail], axis=0).T

    def coordinates(self, values: Mapping[str, ArrayLike]) -> Array:
        """What was sampled (k,), read off free blocks; those that are missing are as at `at`.

        Where directions were sampled, it is the nearest point that they reach.
        """
        x, space = self.problem.free.pack({**self.at, **values}), self.subspace
        if space.entries is not None:
            return np.asarray(x[space.entries])
        span = space.span
        return np.asarray(space.centre + np.linalg.lstsq(span, x - space.origin)[0][: space.size])

    def points(self, count: int, seed: int = 0) -> Array:
        """`count` random draws of all free numbers (count, n), what was integrated out included."""
        rng = np.random.default_rng(seed)
        z = self.flat[rng.integers(len(self.flat), size=count)]
        return self.subspace.points(z, rng.standard_normal((count, self.subspace.rest.shape[1])))

    def values(self, count: int, seed: int = 0) -> list[Values]:
        """The same by block, with the fixed blocks: what a body takes."""
        fixed = {name: np.asarray(self.at[name], dtype=float) for name in self.problem.fixed.names}
        return [fixed | self.problem.free.unpack(x, fixed) for x in self.points(count, seed)]

    def inference_data(self) -> Any:
        """As arviz.InferenceData; a chain is an ensemble, not a walker. See `arviz_quietly`."""
        return inference_data(self.draws, self.log_prob, self.labels, self.verdict)

    def __str__(self) -> str:
        return summary(self)


def as_values(problem: Problem, at: Mapping[str, ArrayLike]) -> Values:
    """The blocks that a problem reads, as arrays."""
    read = (*problem.free.names, *problem.fixed.names)
    return {name: np.asarray(at[name], dtype=float) for name in read if name in at}
