"""The Jacobian that is diagnosed, under the bounds and constraints that are active at a point.

And the same at points nearby, at which active constraints hold as well.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_array, csr_array, vstack

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Layout, Values
from workbench.diagnostics.bases import row_space, tangent_space
from workbench.diagnostics.sparse_jacobian import SparseJacobian
from workbench.errors import NotFinite
from workbench.problem import Linearization, Problem
from workbench.problem.steps import EPS
from workbench.problem.storage import by_nonzeros, stacked
from workbench.threads import limited_threads

IN_NULL_SPACE = 1e-9  # squared part of an entry in the null space, from which on it is not known
ON_BOUND = 1e-6  # of the size of a bound: nearer points are on it, as for the sampler
ON_BOUND_OF_WIDTH = 1e-3  # of the way between two bounds, the most that counts as on one
POINTS = 4  # nearby: in a space of g motions, chance leaves nothing at each point
POINTS_OF_MANY = 2  # where there are many unknowns
MANY_UNKNOWNS = 400
MOST_UNKNOWNS = 3000  # with more, there are no points nearby
NEARBY = 0.1  # of a scale, how far points nearby are away in each entry
CLOSER = 0.1  # of that, where no Jacobian is finite so far away
NEWTON_STEPS = 20  # back to what has to hold, at the most
NEWTON_TOLERANCE = 1e-12  # of the length of what has to hold
MOST_ENTRIES_OF_GRAPH = 1e7  # up to which the graph of a Jacobian is asked for its pattern


@dataclass(frozen=True, eq=False)
class ActiveSet:
    """The constraints and bounds of a problem that are active at a point.

    An equation is always active; an inequality is where its value misses one of its limits by no
    more than its tolerance, or lies beyond it. A row whose gradient is zero there forbids nothing.
    A bound is an inequality on one unknown, whose gradient is a row of the identity; its
    tolerance is a millionth of its size (of 1, if it is smaller), and at most a thousandth of the
    way to the other bound.

    Attributes:
        rows: (k, n) the gradients of the active constraints, then of the active bounds.
        active: (K,) which of all rows of constraints are active.
        bounded: (n,) which unknowns are on a bound.
        names: the active rows in order, such as `tie` and `x[0] >= 0`.
    """

    rows: Array = field(repr=False)
    active: Mask = field(repr=False)
    bounded: Mask = field(repr=False)
    names: tuple[str, ...] = ()

    @property
    def any(self) -> bool:
        """Whether any bound or constraint is active."""
        return bool(self.names)

    @property
    def what(self) -> str:
        """`bounds`, `constraints`, or both."""
        kinds = [("bounds", self.bounded.any()), ("constraints", self.active.any())]
        return " and ".join(kind for kind, some in kinds if some)

    def pattern(self, problem: Problem) -> csc_array:
        """Which unknowns the active rows read, (k, n), by structure."""
        rows = [csc_array(_rows_of_identity(self.bounded))]
        if problem.stacked_constraints is not None and self.active.any():
            every = pattern_of(problem.stacked_constraints.function).tocsr()
            rows.insert(0, csc_array(every[np.flatnonzero(self.active)]))
        return csc_array(vstack(rows))


def active_set_at(
    problem: Problem, at: Mapping[str, ArrayLike], like: ActiveSet | None = None
) -> ActiveSet:
    """What is active at these values; with `like`, the gradients here of what it says is active."""
    x, fixed = problem.split(at)
    constraints, rows, names = problem.stacked_constraints, np.zeros((0, x.size)), []
    active = np.zeros(0, dtype=bool)
    if constraints is not None:
        here = constraints.linearize(x, fixed)
        c, slack = here.values, here.tolerance
        active = constraints.equal | (c <= here.lower + slack) | (c >= here.upper - slack)
        active &= here.usable
        active = active if like is None else like.active
        rows = here.rows(active)
        names = [constraints.label(int(row)) for row in np.flatnonzero(active)]
    low, high = _on_bounds(problem, x)
    bounded = low | high if like is None else like.bounded
    names += [_bound(problem, int(i), bool(low[i])) for i in np.flatnonzero(bounded)]
    return ActiveSet(np.vstack([rows, _rows_of_identity(bounded)]), active, bounded, tuple(names))


def _rows_of_identity(chosen: Mask) -> Array:
    """The rows of the identity for the chosen unknowns, (k, n)."""
    rows = np.zeros((int(chosen.sum()), len(chosen)))
    rows[np.arange(len(rows)), np.flatnonzero(chosen)] = 1.0
    return rows


def _on_bounds(problem: Problem, x: Array) -> tuple[Mask, Mask]:
    """Which unknowns are on their lower and which on their upper bounds, or beyond, (n,) each."""
    lower, upper = problem.lower, problem.upper
    widest = ON_BOUND_OF_WIDTH * (upper - lower)  # infinite where a side is free
    near = [
        np.minimum(ON_BOUND * np.maximum(1.0, abs(np.where(np.isfinite(side), side, 0.0))), widest)
        for side in (lower, upper)
    ]
    return x <= lower + near[0], x >= upper - near[1]


def _bound(problem: Problem, i: int, low: bool) -> str:
    """`x[0] >= 0`, or `x[0] = 0.3` where both bounds are the same."""
    lower, upper = problem.lower[i], problem.upper[i]
    sign = "=" if lower == upper else ">=" if low else "<="
    return f"{problem.free.label(i)} {sign} {lower if low else upper:g}"


@dataclass(frozen=True, eq=False)
class ConstrainedJacobian:
    """A Jacobian J (m, n) under constraints, whose gradients are the rows A (k, n).

    What can move is d = Z y with A Z = 0, and the residuals change by J Z y: the reduced Jacobian.
    A direction is noticed if a residual notices it or a constraint forbids it. Without rows all
    of this is J itself.

    Attributes:
        here: the linearization with the Jacobian J.
        rows: A, the gradients of active constraints and bounds; rows of zeros are dropped.
    """

    here: Linearization
    rows: Array

    def __post_init__(self) -> None:
        # a constraint whose gradient vanishes at this point forbids nothing to first order
        self.__dict__["rows"] = self.rows[self.rows.any(axis=1)]

    @cached_property
    def tangent(self) -> Array:
        """Z (n, p), orthonormal; entries that no row reads stay what they are."""
        return tangent_space(self.rows)

    @property
    def count(self) -> int:
        """How many directions the constraints forbid."""
        return len(row_space(self.rows))

    @cached_property
    def reduced(self) -> Linearization:
        """J Z (m, p): how the residuals change along what may move."""
        if not len(self.rows):
            return self.here
        return self.here.along_columns(self.tangent)

    @cached_property
    def stacked(self) -> Linearization:
        """J above A, with rows of A as long as J's longest column: to compare columns."""
        if not len(self.rows):
            return self.here
        length = float(self.here.column_norms.max(initial=0.0)) or 1.0
        A = self.rows / np.linalg.norm(self.rows, axis=1)[:, None] * length
        r = np.concatenate([self.here.residual, np.zeros(len(A))])
        return Linearization(r, stacked(self.here.jacobian, A))

    @cached_property
    def sparse(self) -> SparseJacobian | None:
        """The same by a sparse factorization; None for a dense Jacobian.

        Raises NotFinite, TooLarge.
        """
        if not self.here.estimated:
            return None
        check_finite(self.here)
        with limited_threads():  # its matrices are small
            return SparseJacobian.of(self.here, self.rows, self.stacked)

    @cached_property
    def null(self) -> Array:
        """(n, n - rank), orthonormal: what no residual notices and no constraint forbids."""
        if self.sparse is None:
            spectrum = self.stacked.spectrum
            return spectrum.Vt[spectrum.rank :].T
        with limited_threads():
            return self.sparse.null

    @property
    def tolerance(self) -> float:
        """By how much a vector of length 1 may change J above A if that counts as nothing."""
        if self.sparse is None:
            return self.stacked.spectrum.tolerance
        return self.sparse.factored.tolerance * float(self.stacked.column_norms.max())

    @property
    def rank(self) -> int:
        """The rank: directions that change a residual or that a constraint forbids."""
        if self.sparse is not None:
            with limited_threads():
                return self.sparse.rank
        return self.count + self.reduced.spectrum.rank

    @property
    def condition(self) -> float:
        """The condition of the reduced Jacobian; infinite without full rank."""
        n = self.here.shape[1]
        if self.rank < n or not n:
            return float("inf")
        if self.sparse is not None:
            with limited_threads():
                return self.sparse.condition
        s = self.reduced.spectrum.s
        return float(s[0] / s[-1]) if s.size else 1.0

    @cached_property
    def laplace(self) -> tuple[Array, Array]:
        """Each entry's sigma (n,), and a square root of the covariance: half @ half.T, (n, rank).

        Entries that take part in a null direction have an infinite sigma; directions that a
        constraint forbids add nothing to it.
        """
        s, directions = self.reduced.spectrum.determined
        along = directions.T
        forbidden = np.zeros(self.here.shape[1])
        if len(self.rows):
            along = self.tangent @ along
            forbidden = 1 - np.sum(self.tangent**2, axis=1)
        half = along / s
        sigma = np.sqrt(np.sum(half**2, axis=1))
        sigma[1 - np.sum(along**2, axis=1) - forbidden > IN_NULL_SPACE] = np.inf
        return sigma, half

    def only(self, part: Index) -> "ConstrainedJacobian":
        """Some of the residuals' rows, under the same constraints."""
        return ConstrainedJacobian(self.here.rows(part), self.rows)

    def measured(self, scales: Array) -> "ConstrainedJacobian":
        """This Jacobian in unknowns y with x = scales * y."""
        if (scales == 1).all():
            return self
        return ConstrainedJacobian(self.here.scaled(scales), self.rows * scales)


def constrained_jacobian_at(
    problem: Problem, at: Mapping[str, ArrayLike], like: ActiveSet | None = None
) -> ConstrainedJacobian:
    """The Jacobian of a problem at a point, and what bounds and constraints fix at it."""
    here = linearized(problem, at)
    return ConstrainedJacobian(here, active_set_at(problem, at, like).rows)


def linearized(problem: Problem, at: Mapping[str, ArrayLike]) -> Linearization:
    """A problem's linearization at these values, of the residuals alone.

    Columns that are nothing but rounding errors are zero in it: see `only_rounding`.
    """
    here = replace(problem.linearize(at), constraints=None)
    if not here.finite:
        return here
    noise = only_rounding(here.column_norms, problem.split(at)[0], problem.free, problem.size)
    return here.scaled(np.where(noise, 0.0, 1.0)) if noise.any() else here


def check_finite(here: Linearization) -> None:
    """Raise NotFinite if there is NaN or infinity, of which there are no ranks and directions."""
    if not here.finite:
        raise NotFinite("the Jacobian holds NaN or infinity here; see `not_finite` for where")


def only_rounding(lengths: Array, x: Array, free: Layout, m: int) -> Mask:
    """Which columns, of these lengths (n,) in m rows at x, may be nothing but rounding, (n,).

    Entries of one unit can be compared: a column is, if it is below eps max(m, n) of the longest
    of its unit. Entries without a unit cannot; a column of any unit is, too, if a change by one, or
    by the size of x_i if that is more, changes the rows by less than the rounding error of one
    sigma, or of the longest column if that is shorter.
    """
    units = np.array([block.unit for block in free.blocks for _ in range(block.size)])
    longest = float(lengths.max(initial=0.0))
    least = np.full(lengths.shape, 10 * EPS * np.sqrt(m) * min(1.0, longest))
    for unit in set(units.tolist()) - {"1"}:
        alike = units == unit
        own = EPS * max(m, len(lengths)) * float(lengths[alike].max())
        least[alike] = np.maximum(least[alike], own)
    return np.asarray((lengths > 0) & (lengths * np.maximum(1.0, abs(x)) <= least))


def not_finite(here: Linearization) -> tuple[tuple[int, int], ...]:
    """Rows and columns of entries that are NaN or infinite; column -1 means the residual."""
    if here.finite:
        return ()
    r = [(int(i), -1) for i in np.flatnonzero(~np.isfinite(here.residual))]
    return (*r, *here.not_finite)


def pattern_at(problem: Problem) -> csc_array:
    """Where a problem's Jacobian can be nonzero, (m, n), by its whole graph.

    The graph of a very large mesh takes many times the memory of its Jacobian, and points that are
    computed by arithmetic alone are in no graph. There it is the pattern of the chain rule, in
    which each point reads all of its body's blocks.
    """
    if problem.size * problem.free.size > MOST_ENTRIES_OF_GRAPH or not problem.has_graph:
        return problem.pattern
    return pattern_of(problem.function)


def pattern_of(function: cs.Function) -> csc_array:
    """Where the Jacobian of a function's first output by its first input can be nonzero."""
    sparsity = function.jac_sparsity(0, 0)
    starts, rows = sparsity.get_ccs()
    return csc_array((np.ones(len(rows), dtype=bool), rows, starts), shape=sparsity.shape)


# Points nearby.


def points_nearby(
    problem: Problem,
    values: Values,
    active: ActiveSet,
    pattern: csc_array,
    sizes: Array,
) -> tuple[tuple[Array, ConstrainedJacobian], ...]:
    """Points x (n,) near these values, and the constrained Jacobian at each.

    A symmetry of a problem is undone wherever its unknowns are, and a coincidence only at one
    point. Unknowns move at random by a share of their scales `sizes` (n,). Active constraints and
    bounds hold at the new points too, and so does what residuals say of one block in a problem that
    ties it to others: a quaternion keeps its length. There are no points for a very large problem,
    and where no Jacobian nearby is finite.
    """
    n = problem.free.size
    if not 0 < n <= MOST_UNKNOWNS:
        return ()
    count = POINTS if n <= MANY_UNKNOWNS else POINTS_OF_MANY
    rows = _rows_of_one_block(problem, pattern)
    points: list[tuple[Array, ConstrainedJacobian]] = []
    for share in (NEARBY, NEARBY * CLOSER):
        points = [*_at_random(problem, values, active, share * sizes, rows, count)]
        if len(points) == count:
            break
    return tuple(points)


def _rows_of_one_block(problem: Problem, pattern: csc_array) -> Index:
    """The rows that read one block, which other rows read together with others."""
    columns_of = [csr_array(pattern[:, part]) for part in problem.free.slices.values()]
    reads = np.column_stack([np.diff(columns.indptr) > 0 for columns in columns_of])
    alone = reads.sum(axis=1) == 1
    shared = reads[reads.sum(axis=1) > 1].any(axis=0)
    return np.flatnonzero(alone & reads[:, shared].any(axis=1))


def _at_random(
    problem: Problem, values: Values, active: ActiveSet, sizes: Array, rows: Index, count: int
) -> Iterator[tuple[Array, ConstrainedJacobian]]:
    """Points about as far away as these sizes (n,), at which active constraints and rows hold.

    By Newton's method with the smallest steps, in these sizes.
    """
    rng = np.random.default_rng(0)
    x, fixed = problem.split(values)
    kept, _ = _kept(problem, active, rows, x, fixed)
    for _ in range(count):
        y = x + np.where(active.bounded, 0.0, sizes * rng.standard_normal(x.size))
        for _ in range(NEWTON_STEPS if kept.size else 0):
            here, A = _kept(problem, active, rows, y, fixed)
            error = here - kept
            if not np.isfinite(error).all() or not np.isfinite(A).all():
                y = np.full(y.shape, np.nan)
            if not np.linalg.norm(error) > NEWTON_TOLERANCE * (1 + np.linalg.norm(kept)):
                break
            y = y - sizes * np.linalg.lstsq(A * sizes, error)[0]
        if np.isfinite(y).all():
            near = constrained_jacobian_at(problem, problem.values(y, fixed), active)
            if near.here.finite and np.isfinite(near.rows).all():
                yield y, near


def _kept(
    problem: Problem, active: ActiveSet, rows: Index, x: Array, fixed: Array
) -> tuple[Array, Array]:
    """The values (k,) of active constraints and of these rows, and their Jacobian (k, n)."""
    values, A = np.zeros(0), np.zeros((0, x.size))
    if rows.size:
        of_rows = problem.linearize(problem.values(x, fixed)).rows(rows)
        J = of_rows.jacobian
        values, A = of_rows.residual, J if isinstance(J, np.ndarray) else by_nonzeros(J).toarray()
    if problem.stacked_constraints is None or not active.active.any():
        return values, A
    here = problem.stacked_constraints.linearize(x, fixed)
    return np.append(values, here.values[active.active]), np.vstack([A, here.rows(active.active)])
