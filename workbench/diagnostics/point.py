"""One point of a problem: its linearization, what constraints hold there, and the yardsticks."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array, Mask
from workbench.blocks import Values
from workbench.diagnostics.active_set import (
    ActiveSet,
    ConstrainedJacobian,
    active_set_at,
    constrained_jacobian_at,
)
from workbench.diagnostics.identifiability import prior_sigma
from workbench.diagnostics.sparse_jacobian import SparseJacobian
from workbench.diagnostics.yardsticks import Yardsticks, yardsticks
from workbench.problem import Linearization, Problem

NEIGHBOURS = 4
NEARBY = 0.1  # how far they are away in each entry, in yardsticks


@dataclass(frozen=True, eq=False)
class Point:
    """What a diagnosis is computed from.

    Attributes:
        problem: the problem.
        values: the values of all blocks that it reads.
        here: its linearization at these values, without columns of rounding errors.
        priors: the names of the residuals that are priors, not data.
    """

    problem: Problem = field(repr=False)
    values: Values = field(repr=False)
    here: Linearization = field(repr=False)
    priors: tuple[str, ...] = ()

    @cached_property
    def active(self) -> ActiveSet:
        """The bounds and constraints that are active here."""
        return active_set_at(self.problem, self.values)

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
    def by_elimination(self) -> SparseJacobian | None:
        """The same without singular values, where the unknowns were eliminated part after part."""
        found = self.constrained.by_elimination
        return None if found is None else found.scaled(self.yardsticks.sizes)

    @cached_property
    def yardsticks(self) -> Yardsticks:
        """The yardstick of each unknown."""
        read = self.problem.known.values()
        return yardsticks(self.problem.free, read, self.values, self.prior_sigma)

    @cached_property
    def block_units(self) -> Array:
        """(n,) the yardsticks, one for each block: where those of a block differ, their mean.

        All ones where the unknowns were eliminated: that is done in columns of length 1.
        """
        sizes = self.yardsticks.sizes
        if self.constrained.by_elimination is not None:
            return np.ones_like(sizes)
        at = self.problem.free.slices.values()
        means = [np.full(i.stop - i.start, np.sqrt(np.mean(sizes[i] ** 2))) for i in at]
        return np.concatenate([np.zeros(0), *means])

    @cached_property
    def in_block_units(self) -> ConstrainedJacobian:
        """The constrained Jacobian with every unknown in its `block_units`."""
        same = np.array_equal(self.block_units, self.yardsticks.sizes)
        return self.measured if same else self.constrained.measured(self.block_units)

    def null_in(self, measured: ConstrainedJacobian, units: Array) -> Array:
        """(n, d) an orthonormal basis of the null space in these units, of this Jacobian in them.

        The dimension is that of the Jacobian in the unknowns' own units, which decides the rank.
        """
        if measured is self.constrained:
            return measured.null
        if measured.rank == self.constrained.rank:
            return measured.null
        return np.asarray(np.linalg.qr(self.constrained.null / units[:, None])[0])

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


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """Rank and singular values at a few random points, a tenth of a yardstick away in each entry.

    The constraints and bounds that are active here count as active there. Points where the
    Jacobian is not finite are left out, and all points for a large sparse Jacobian.

    Attributes:
        here: the point in the middle.
    """

    here: Point

    @cached_property
    def points(self) -> tuple[tuple[int, Array], ...]:
        """The rank and the singular values (min(m, n),) at each point."""
        if self.here.here.estimated or not self.here.problem.free.size:
            return ()
        rng = np.random.default_rng(0)
        found = []
        problem, at, steps = self.here.problem, self.here.values, self.here.yardsticks.sizes
        sizes = problem.free.placed(steps)
        for _ in range(NEIGHBOURS):
            moved = {
                block.name: np.asarray(at[block.name], dtype=float)
                + NEARBY * sizes[block.name] * rng.standard_normal(np.shape(at[block.name]))
                for block in problem.free.blocks
            }
            there = constrained_jacobian_at(problem, at | moved, self.here.active)
            if there.here.finite and np.isfinite(there.rows).all():
                there = there.measured(steps)
                found.append((there.rank, there.reduced.spectrum.s))
        return tuple(found)

    @property
    def ranks(self) -> tuple[int, ...]:
        """The rank at each of the points."""
        return tuple(rank for rank, _ in self.points)

    @property
    def weaker_here(self) -> float:
        """How many times weaker the weakest direction that is seen is here than typically there."""
        if not self.points:
            return 1.0
        here = self.here.measured.reduced
        rank = here.spectrum.rank
        there = [s[rank - 1] for _, s in self.points if s.size >= rank]
        if not there or not rank:
            return 1.0
        return float(np.median(there)) / float(here.spectrum.s[rank - 1])
