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
from workbench.sampling.importance import Importance
from workbench.sampling.mixing import Mixing
from workbench.sampling.modes import Mode
from workbench.sampling.subspace import Subspace

Array = NDArray[np.float64]


class NotConverged(WorkbenchError):
    """An interval was asked of draws that do not carry one."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """Draws of what was sampled, (E, S, W, k): ensembles, steps, walkers, entries.

    What they are worth is `mixing`, and, where the rest was integrated out, `importance`. The
    verdict stands before everything that is printed, and `interval` asks it.
    """

    problem: Problem = field(repr=False)
    at: Values = field(repr=False)  # of every block that the problem reads
    subspace: Subspace = field(repr=False)
    draws: Array = field(repr=False)
    log_prob: Array = field(repr=False)  # (E, S, W), up to a constant
    mixing: Mixing
    method: str  # `emcee` or `laplace`
    modes: tuple[Mode, ...] = field(repr=False)
    importance: Importance | None = None
    seconds: float = 0.0
    interrupted: bool = False

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
    def usable(self) -> bool:
        """Whether the chains have mixed, and the Gaussian conditional, if there is one, holds."""
        return self.mixing.usable and (self.importance is None or self.importance.holds)

    @property
    def verdict(self) -> str:
        """What the draws are worth, in a sentence or two."""
        said = str(self.mixing)
        return said if self.importance is None else f"{said}. {self.importance}"

    def interval(self, level: float = 0.9) -> Array:
        """The central interval of each entry (k, 2). Raises NotConverged if there is none."""
        if not self.usable:
            raise NotConverged(f"there is no interval: {self.verdict}")
        tail = (1 - level) / 2
        return np.quantile(self.flat, [tail, 1 - tail], axis=0).T

    def points(self, count: int, seed: int = 0) -> Array:
        """`count` random draws of all free numbers (count, n), what was integrated out included."""
        rng = np.random.default_rng(seed)
        z = self.flat[rng.integers(len(self.flat), size=count)]
        return self.subspace.points(z, rng.standard_normal((count, self.subspace.rest.shape[1])))

    def values(self, count: int, seed: int = 0) -> list[Values]:
        """The same by block, with the fixed blocks: what a body takes."""
        fixed = {name: np.asarray(self.at[name], dtype=float) for name in self.problem.fixed.names}
        return [fixed | self.problem.free.unpack(x) for x in self.points(count, seed)]

    def inference_data(self) -> Any:
        """As arviz.InferenceData; a chain is an ensemble, not a walker. See `arviz_quietly`."""
        return inference_data(self.draws, self.log_prob, self.labels, self.verdict)

    def __str__(self) -> str:
        from workbench.sampling.text import summary

        return summary(self)


def as_values(problem: Problem, at: Mapping[str, ArrayLike]) -> Values:
    """The blocks that a problem reads, as arrays."""
    read = (*problem.free.names, *problem.fixed.names)
    return {name: np.asarray(at[name], dtype=float) for name in read if name in at}
