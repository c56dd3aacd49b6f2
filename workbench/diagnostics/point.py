"""One point of a problem: its linearization, what constraints hold there, and the yardsticks."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array, Mask
from workbench.blocks import Layout, Values
from workbench.diagnostics.active_set import ActiveSet, ConstrainedJacobian, active_set_at
from workbench.diagnostics.identifiability import prior_sigma
from workbench.diagnostics.yardsticks import Yardsticks, yardsticks
from workbench.problem import Linearization, Problem


@dataclass(frozen=True, eq=False)
class Point:
    """What a diagnosis is computed from.

    Attributes:
        problem: the problem.
        at: the values of all blocks that it reads.
        here: its linearization at these values, without columns of rounding errors.
        priors: the names of the residuals that are priors, not data.
    """

    problem: Problem = field(repr=False)
    at: Values = field(repr=False)
    here: Linearization = field(repr=False)
    priors: tuple[str, ...] = ()

    @cached_property
    def active(self) -> ActiveSet:
        """What the problem's constraints hold here."""
        return active_set_at(self.problem, self.at)

    @property
    def active_pattern(self) -> csc_array:
        """Which unknowns these read, (k, n), by structure."""
        return self.active.pattern(self.problem)

    @cached_property
    def constrained(self) -> ConstrainedJacobian:
        """The Jacobian with the gradients of what is held."""
        return ConstrainedJacobian(self.here, self.active.rows)

    @cached_property
    def measured(self) -> ConstrainedJacobian:
        """The constrained Jacobian with every unknown in units of its yardstick."""
        return self.constrained.measured(self.yardsticks.sizes)

    @cached_property
    def yardsticks(self) -> Yardsticks:
        """What each unknown is held against."""
        read = (*self.problem.free.blocks, *self.problem.fixed.blocks)
        both = Layout(tuple({block.name: block for block in read}.values()))
        return yardsticks(self.problem.free, both, self.at, self.prior_sigma)

    @cached_property
    def is_prior(self) -> Mask:
        """Which rows are priors, (m,)."""
        return self.problem.rows_named(self.priors)

    @cached_property
    def prior_sigma(self) -> Array:
        """What the priors alone say of each entry (n,), infinite where they say nothing."""
        if not self.here.finite:
            return np.full(self.here.shape[1], np.inf)
        return prior_sigma(self.here, self.is_prior)

    @property
    def rows(self) -> dict[str, slice]:
        """The rows of each residual, followed by those of active bounds and constraints."""
        m, found = self.here.shape[0], dict(self.problem.rows)
        return found | {name: slice(m + i, m + i + 1) for i, name in enumerate(self.active.names)}
