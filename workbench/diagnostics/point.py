"""One point of a problem: its linearization, what constraints hold there, and the yardsticks."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array, Mask
from workbench.blocks import Values
from workbench.diagnostics.active_set import ActiveSet, ConstrainedJacobian, active_set_at
from workbench.diagnostics.eliminated_jacobian import EliminatedJacobian
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
        """The bounds and constraints that are active here."""
        return active_set_at(self.problem, self.at)

    @property
    def active_pattern(self) -> csc_array:
        """Which unknowns the active rows depend on, (k, n), by structure."""
        return self.active.pattern(self.problem)

    @cached_property
    def constrained(self) -> ConstrainedJacobian:
        """The Jacobian under the active bounds and constraints."""
        return ConstrainedJacobian(self.here, self.active.rows)

    @cached_property
    def measured(self) -> ConstrainedJacobian:
        """The constrained Jacobian with every unknown in units of its yardstick."""
        return self.constrained.measured(self.yardsticks.sizes)

    @cached_property
    def by_elimination(self) -> EliminatedJacobian | None:
        """The same without singular values, where the unknowns were eliminated part after part."""
        found = self.constrained.by_elimination
        return None if found is None else found.scaled(self.yardsticks.sizes)

    @cached_property
    def yardsticks(self) -> Yardsticks:
        """The yardstick of each unknown."""
        read = self.problem.known.values()
        return yardsticks(self.problem.free, read, self.at, self.prior_sigma)

    @cached_property
    def is_prior(self) -> Mask:
        """Which rows are priors, (m,)."""
        return self.problem.rows_named(self.priors)

    @cached_property
    def prior_sigma(self) -> Array:
        """Standard deviations by the priors alone (n,), infinite where they say nothing."""
        if not self.here.finite:
            return np.full(self.here.shape[1], np.inf)
        return prior_sigma(self.here, self.is_prior)

    @property
    def rows(self) -> dict[str, slice]:
        """The rows of each residual, followed by those of active bounds and constraints."""
        m, found = self.here.shape[0], dict(self.problem.rows)
        return found | {name: slice(m + i, m + i + 1) for i, name in enumerate(self.active.names)}
