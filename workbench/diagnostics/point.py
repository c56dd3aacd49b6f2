"""One point of a problem: its linearization, what constraints hold there, and the yardsticks."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from workbench.blocks import Layout, Values
from workbench.diagnostics.held import Held, Tied, held_at
from workbench.diagnostics.identifiability import prior_sigma
from workbench.diagnostics.yardsticks import Yardsticks, yardsticks
from workbench.problem import Linearization, Problem

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Point:
    """What a diagnosis is computed from."""

    problem: Problem = field(repr=False)
    at: Values = field(repr=False)
    here: Linearization = field(repr=False)
    priors: tuple[str, ...] = ()  # residuals that are no data

    @cached_property
    def held(self) -> Held:
        """What the problem's constraints hold here."""
        return held_at(self.problem, self.at)

    @property
    def held_pattern(self) -> csc_array:
        """Which unknowns these read, (k, n), by structure."""
        return self.held.pattern(self.problem)

    @cached_property
    def tied(self) -> Tied:
        """The Jacobian with the gradients of what is held."""
        return Tied(self.here, self.held.rows)

    @cached_property
    def measured(self) -> Tied:
        """The same with every unknown in units of its yardstick."""
        return self.tied.measured(self.yardsticks.sizes)

    @cached_property
    def yardsticks(self) -> Yardsticks:
        """What each unknown is held against."""
        read = (*self.problem.free.blocks, *self.problem.fixed.blocks)
        both = Layout(tuple({block.name: block for block in read}.values()))
        return yardsticks(self.problem.free, both, self.at, self.prior_sigma)

    @cached_property
    def is_prior(self) -> NDArray[np.bool_]:
        """Which rows are priors, (m,)."""
        found = np.zeros(self.here.shape[0], dtype=bool)
        for name in self.priors:
            found[self.problem.rows[name]] = True
        return found

    @cached_property
    def prior_sigma(self) -> Array:
        """What the priors alone say of each entry (n,), infinite where they say nothing."""
        if not self.here.finite:
            return np.full(self.here.shape[1], np.inf)
        return prior_sigma(self.here, self.is_prior)

    @property
    def rows(self) -> dict[str, slice]:
        """Where each residual's rows are, and after them those of constraints that hold."""
        m, found = self.here.shape[0], dict(self.problem.rows)
        return found | {name: slice(m + i, m + i + 1) for i, name in enumerate(self.held.names)}
