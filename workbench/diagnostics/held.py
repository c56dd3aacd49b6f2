"""What constraints hold at a point: directions that no residual has to notice."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csc_array, issparse, vstack

from workbench.diagnostics.jacobian import Jacobian, jacobian_at
from workbench.problem import Problem
from workbench.problem.steps import EPS

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Held:
    """The active rows of a problem's constraints at a point.

    An equation is always active; an inequality is where its value misses one of its limits by no
    more than its tolerance, or lies beyond it. A row whose gradient is zero there holds nothing.
    """

    rows: Array = field(repr=False)  # (k, n): gradients of the active rows
    active: NDArray[np.bool_] = field(repr=False)  # (K,) of all rows
    names: tuple[str, ...] = ()  # of the active rows, in order

    @property
    def any(self) -> bool:
        """Whether there are any."""
        return bool(self.names)


def held_at(
    problem: Problem, at: Mapping[str, ArrayLike], active: NDArray[np.bool_] | None = None
) -> Held:
    """What holds at these values; or, where `active` (K,) says which rows do, their gradients."""
    constraints = problem.stacked_constraints
    if constraints is None:
        return Held(np.zeros((0, problem.free.size)), np.zeros(0, dtype=bool))
    there = constraints.linearize(*problem.split(at))
    c, slack = there.values, there.tolerance
    if active is None:
        active = constraints.equal | (c <= there.lower + slack) | (c >= there.upper - slack)
        active &= np.isfinite(there.jacobian).all(axis=1) & there.jacobian.any(axis=1)
    chosen = np.flatnonzero(active)
    names = tuple(constraints.label(int(row)) for row in chosen)
    return Held(there.jacobian[chosen], active, names)


@dataclass(frozen=True, eq=False)
class Tied:
    """A Jacobian J (m, n) and rows A (k, n) along which nothing may move.

    What can move is d = Z y with A Z = 0, and the residuals change by J Z y: the reduced Jacobian.
    A direction is noticed if a residual notices it or a constraint forbids it. Without rows all
    of this is J itself.
    """

    here: Jacobian
    rows: Array

    def __post_init__(self) -> None:
        # a constraint whose gradient vanishes at this point forbids nothing to first order
        self.__dict__["rows"] = self.rows[self.rows.any(axis=1)]

    @cached_property
    def tangent(self) -> Array:
        """Z (n, p), orthonormal; entries that no row reads stay what they are."""
        n = self.here.shape[1]
        read = np.flatnonzero(self.rows.any(axis=0))
        A = self.rows[:, read]
        A = A / np.linalg.norm(A, axis=1)[:, None]
        _, s, Vt = np.linalg.svd(A, full_matrices=True)
        local = Vt[int(np.sum(s > EPS * max(A.shape) * s.max(initial=0.0))) :].T
        Z = np.zeros((n, n - read.size + local.shape[1]))
        others = np.setdiff1d(np.arange(n), read)
        Z[others, np.arange(others.size)] = 1.0
        Z[read, others.size :] = local
        return Z

    @property
    def count(self) -> int:
        """How many directions the constraints forbid."""
        return self.here.shape[1] - self.tangent.shape[1] if len(self.rows) else 0

    @cached_property
    def reduced(self) -> Jacobian:
        """J Z (m, p): what the residuals notice of what may move."""
        if not len(self.rows):
            return self.here
        if isinstance(self.here.matrix, csc_array):
            moved = self.here.matrix @ csc_array(self.tangent)
            return Jacobian(self.here.residual, csc_array(moved))
        return Jacobian(self.here.residual, self.here.matrix @ self.tangent)

    @cached_property
    def stacked(self) -> Jacobian:
        """J above A, each row of A as long as J's longest column: for who looks at columns."""
        if not len(self.rows):
            return self.here
        length = float(self.here.column_norms.max(initial=0.0)) or 1.0
        A = self.rows / np.linalg.norm(self.rows, axis=1)[:, None] * length
        r = np.concatenate([self.here.residual, np.zeros(len(A))])
        if issparse(self.here.matrix):
            return Jacobian(r, csc_array(vstack([self.here.matrix, csc_array(A)])))
        return Jacobian(r, np.vstack([self.here.dense, A]))

    @property
    def rank(self) -> int:
        """How many directions are noticed."""
        return self.count + self.reduced.rank

    @property
    def condition(self) -> float:
        """Of the reduced Jacobian; infinite unless every direction is noticed."""
        s, n = self.reduced.svd[0], self.here.shape[1]
        if self.rank < n or not n:
            return float("inf")
        return float(s[0] / s[-1]) if s.size else 1.0

    @cached_property
    def laplace(self) -> tuple[Array, Array]:
        """Each entry's sigma (n,), and half of the covariance (n, rank): half @ half.T is it.

        Entries with a part in what is not noticed have an infinite sigma; what a constraint
        forbids adds nothing to any.
        """
        s, Vt = self.reduced.svd
        seen = s > self.reduced.tolerance
        along = Vt[: s.size][seen].T
        forbidden = np.zeros(self.here.shape[1])
        if len(self.rows):
            along = self.tangent @ along
            forbidden = 1 - np.sum(self.tangent**2, axis=1)
        half = along / s[seen]
        sigma = np.sqrt(np.sum(half**2, axis=1))
        sigma[1 - np.sum(along**2, axis=1) - forbidden > BLIND] = np.inf
        return sigma, half

    def only(self, part: NDArray[np.int64]) -> "Tied":
        """Some of the residuals' rows, under the same constraints."""
        return Tied(self.here.rows(part), self.rows)

    def measured(self, yardsticks: Array) -> "Tied":
        """The same in unknowns y, x = yardsticks * y."""
        if (yardsticks == 1).all():
            return self
        matrix = self.here.matrix
        if isinstance(matrix, csc_array):
            columns = np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))
            entries = matrix.data * yardsticks[columns]
            scaled = csc_array((entries, matrix.indices, matrix.indptr), shape=matrix.shape)
            return Tied(Jacobian(self.here.residual, scaled), self.rows * yardsticks)
        return Tied(Jacobian(self.here.residual, matrix * yardsticks), self.rows * yardsticks)


BLIND = 1e-9  # of an entry's square that lies in the null space: then it is not known


def tied_at(
    problem: Problem, at: Mapping[str, ArrayLike], active: NDArray[np.bool_] | None = None
) -> Tied:
    """The Jacobian of a problem at a point, and what its constraints hold there."""
    here = jacobian_at(problem, at)
    return Tied(here, held_at(problem, at, active).rows)
