"""One point of a problem: its linearization, what constraints hold there, scales, points nearby."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_array, csr_array

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Values
from workbench.diagnostics.active_set import (
    ActiveSet,
    ConstrainedJacobian,
    active_set_at,
    constrained_jacobian_at,
    pattern_at,
)
from workbench.diagnostics.identifiability import prior_sigma
from workbench.diagnostics.scales import Scales, scales
from workbench.diagnostics.sparse_jacobian import SparseJacobian
from workbench.problem import Linearization, Problem
from workbench.problem.storage import by_nonzeros

COUNT, FEWER = 4, 2  # points nearby: in a space of g motions, chance leaves nothing at each point
MANY, MOST = 400, 3000  # unknowns from which on there are fewer, and none
NEAR = 0.1  # of a scale, how far they are away in each entry
CLOSER = 0.1  # of that, where nothing finite is found so far away
STEPS = 20  # of Newton's method back to what is held, at the most
REACHED = 1e-12  # of the length of what is held


@dataclass(frozen=True, eq=False)
class Point:
    """What a diagnosis is computed from.

    Attributes:
        problem: the problem.
        values: the values of all blocks that it reads.
        here: its linearization at these values, without columns of rounding errors.
        priors: the names of the residuals that are priors, not data.
        given_scales: by block, the characteristic scale that a user says.
    """

    problem: Problem = field(repr=False)
    values: Values = field(repr=False)
    here: Linearization = field(repr=False)
    priors: tuple[str, ...] = ()
    given_scales: Mapping[str, ArrayLike] = field(default_factory=dict, repr=False)

    @cached_property
    def pattern(self) -> csc_array:
        """Where the Jacobian of the residuals can be nonzero, (m, n)."""
        return pattern_at(self.problem)

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
        """The constrained Jacobian with every unknown in units of its scale."""
        return self.constrained.measured(self.scales.sizes)

    @cached_property
    def by_elimination(self) -> SparseJacobian | None:
        """The same by a sparse factorization, where the Jacobian is sparse."""
        found = self.constrained.by_elimination
        return None if found is None else found.scaled(self.scales.sizes)

    @cached_property
    def scales(self) -> Scales:
        """The characteristic scale of each unknown."""
        read = self.problem.known.values()
        return scales(
            self.problem.free,
            read,
            self.values,
            self.prior_sigma,
            self.given_scales,
            of_people=bool(self.problem.trees),
        )

    @property
    def yardsticks(self) -> Scales:
        """The same, under its former name."""
        return self.scales

    @cached_property
    def nearby(self) -> tuple[tuple[Array, ConstrainedJacobian], ...]:
        """Points x (n,) near this one, and the constrained Jacobian at each.

        A symmetry of a problem is undone wherever its unknowns are, and a coincidence only at one
        point: two decays of the same rate, a board that stands exactly across the view. Unknowns
        move at random by a share of their scales. Active constraints and bounds hold at the new
        points too, and so does what residuals say of one block in a problem that ties it to others:
        a quaternion keeps its length, and a corner that a prior holds its place. There are no
        points for a very large problem, and where nothing finite is found.
        """
        n = self.problem.free.size
        if not 0 < n <= MOST:
            return ()
        count, rows = COUNT if n <= MANY else FEWER, self._rows_of_one_block()
        for share in (NEAR, NEAR * CLOSER):
            points = [*self._at_random(rows, share, count)]
            if len(points) == count:
                break
        return tuple(points)

    def _rows_of_one_block(self) -> Index:
        """The rows that read one block, which other rows read together with others."""
        free, pattern = self.problem.free, self.pattern
        part = [csr_array(pattern[:, at]) for at in free.slices.values()]
        reads = np.column_stack([np.diff(one.indptr) > 0 for one in part])
        alone = reads.sum(axis=1) == 1
        shared = reads[reads.sum(axis=1) > 1].any(axis=0)
        return np.flatnonzero(alone & reads[:, shared].any(axis=1))

    def _at_random(
        self, rows: Index, share: float, count: int
    ) -> Iterator[tuple[Array, ConstrainedJacobian]]:
        rng, problem = np.random.default_rng(0), self.problem
        x, fixed = problem.split(self.values)
        for _ in range(count):
            step = share * self.scales.sizes * rng.standard_normal(x.size)
            y = self._held(rows, x + np.where(self.active.bounded, 0.0, step), x, fixed)
            if not np.isfinite(y).all():
                continue
            there = constrained_jacobian_at(problem, problem.values(y, fixed), self.active)
            if there.here.finite and np.isfinite(there.rows).all():
                yield y, there

    def _held(self, rows: Index, y: Array, x: Array, fixed: Array) -> Array:
        """y (n,), moved so that active constraints and these rows have the values that they have
        at x; by Newton's method with the smallest steps, in scales.
        """
        held, _ = self._what_is_held(rows, x, fixed)
        sizes = self.scales.sizes
        for _ in range(STEPS if held.size else 0):
            there, A = self._what_is_held(rows, y, fixed)
            missed = there - held
            if not np.isfinite(missed).all() or not np.isfinite(A).all():
                return np.full(y.shape, np.nan)
            if np.linalg.norm(missed) <= REACHED * (1 + np.linalg.norm(held)):
                break
            y = y - sizes * np.linalg.lstsq(A * sizes, missed)[0]
        return y

    def _what_is_held(self, rows: Index, x: Array, fixed: Array) -> tuple[Array, Array]:
        """The values (k,) of active constraints and of these rows, and their Jacobian (k, n)."""
        problem, active = self.problem, self.active.active
        values, A = np.zeros(0), np.zeros((0, x.size))
        if rows.size:
            here = problem.linearize(problem.values(x, fixed)).rows(rows)
            J = here.jacobian
            values, A = here.residual, J if isinstance(J, np.ndarray) else by_nonzeros(J).toarray()
        if problem.stacked_constraints is None or not active.any():
            return values, A
        held = problem.stacked_constraints.linearize(x, fixed)
        return np.append(values, held.values[active]), np.vstack([A, held.rows(active)])

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


def null_in_units(constrained: ConstrainedJacobian, lengths: Array) -> Array:
    """(n, d) an orthonormal basis of the null space of unknowns y = lengths * x.

    The dimension is that of the Jacobian in the unknowns' own units, which decides the rank. From
    columns of length 1, or nearly so, by singular vectors; where the unknowns were eliminated, from
    the null space that this found.
    """
    n = len(lengths)
    d, held = n - constrained.rank, constrained.stacked
    if constrained.by_elimination is not None or held.estimated:
        null = constrained.null * lengths[:, None]
        return np.asarray(np.linalg.qr(null / np.linalg.norm(null, axis=0))[0])
    read = np.flatnonzero(held.column_norms > 0)
    R = held.unit_triangle[:, read] * (held.column_norms / lengths)[read]
    Vt = np.linalg.svd(R, full_matrices=True)[2]
    basis = np.zeros((n, d))
    silent = np.setdiff1d(np.arange(n), read)[:d]
    basis[silent, np.arange(len(silent))] = 1.0
    basis[read, len(silent) :] = Vt[len(read) - (d - len(silent)) :].T
    return basis


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """Rank and singular values at a few random points, a tenth of a scale away in each entry.

    Attributes:
        here: the point in the middle; `Point.nearby` are the others.
    """

    here: Point

    @cached_property
    def points(self) -> tuple[tuple[int, Array], ...]:
        """The rank and the singular values (min(m, n),) at each point."""
        if self.here.here.estimated or self.here.problem.free.size > MANY:
            return ()
        measured = [there.measured(self.here.scales.sizes) for _, there in self.here.nearby]
        return tuple((there.rank, there.reduced.spectrum.s) for there in measured)

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
