"""A least-squares problem seen from one point, where it is nearly linear."""

from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.sparse import issparse

from workbench.problem.chain import half_squared
from workbench.problem.constraint_set import Constrained
from workbench.problem.steps import EPS, automatic

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Linearization:
    """r(x + p) ~ r + J p, whitened, and the textbook formulas on it."""

    residual: Array  # (m,)
    jacobian: Array  # (m, n); a sparse array in `outline_at` of a large problem
    constraints: Constrained | None = None  # of the problem, seen from the same point

    @cached_property
    def cost(self) -> float:
        """1/2 |r|^2; infinite where that is too large to be a number."""
        return half_squared(self.residual)

    @cached_property
    def gradient(self) -> Array:
        """J' r, (n,): the factor 2 of |r|^2 is gone with the half. Infinite like `normal`."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self.jacobian.T @ self.residual

    @cached_property
    def normal(self) -> Array:
        """J' J, (n, n): Gauss and Newton's Hessian; infinite where it is too large."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self.jacobian.T @ self.jacobian

    @cached_property
    def column_norms(self) -> Array:
        """|J_i|, (n,): what one unit of each entry does to the residual.

        Columns whose squares are too large to be numbers are scaled before; those whose squares are
        zero to rounding have the length zero.
        """
        if issparse(self.jacobian):
            return np.asarray(np.sqrt((self.jacobian**2).sum(axis=0)))
        columns = self.jacobian.T  # as it is stored
        with np.errstate(over="ignore"):
            norms = np.asarray(np.sqrt(np.vecdot(columns, columns)))
        for i in np.flatnonzero(norms == np.inf):
            largest = np.abs(columns[i]).max()
            if largest < np.inf:
                norms[i] = largest * np.linalg.norm(columns[i] / largest)
        return norms

    def reached(self, i: int) -> NDArray[np.bool_]:
        """The rows (m,) in which column i of the Jacobian is not zero."""
        return np.asarray(self.jacobian @ np.eye(1, self.jacobian.shape[1], i)[0] != 0)

    @cached_property
    def finite(self) -> bool:
        """Whether every number of the residual and the Jacobian is.

        One of the Jacobian that is not would be seen in J' r, even beside a residual of zero.
        """
        if not (isfinite(self.cost) or np.isfinite(self.residual).all()):
            return False
        if self.constraints is not None and not self.constraints.finite:
            return False
        entries = self.jacobian.data if issparse(self.jacobian) else self.jacobian
        return bool(np.isfinite(self.gradient).all() or np.isfinite(entries).all())

    @cached_property
    def svd(self) -> tuple[Array, Array, Array]:
        """`U, s, Vt` of the Jacobian, thin: s (k,) falls, the rows of Vt (k, n) are directions."""
        return np.linalg.svd(self.jacobian, full_matrices=False)

    @cached_property
    def singular_values(self) -> Array:
        """Of the Jacobian with columns of length 1, (k,): so no unknown's unit matters."""
        return np.asarray(np.linalg.svd(self.triangle[1], compute_uv=False), dtype=float)

    @property
    def tolerance(self) -> float:
        """The singular value below which a direction counts as unseen: eps max(m, n) s_1."""
        s = self.singular_values
        return float(EPS * max(self.jacobian.shape) * s.max(initial=0.0))

    @property
    def rank(self) -> int:
        """How many directions the residual notices."""
        return int(np.sum(self.singular_values > self.tolerance))

    @cached_property
    def triangle(self) -> tuple[Array, Array, Array]:
        """`d, R, b`: |(R / d^-1) p + b| is |J p + r| but for a constant; R (k, n) of J / d by QR.

        d are the column norms, 1 where one is zero; b (k,) is Q'r; k = min(m, n).
        """
        m, n = self.jacobian.shape
        d = np.where(self.column_norms > 0, self.column_norms, 1.0)
        A = np.empty((m, n + 1), order="F")
        A[:, :n], A[:, n] = self.jacobian / d, self.residual
        R = scipy.linalg.qr(A, mode="r", overwrite_a=True, check_finite=False)[0]
        k = min(m, n)
        return d, np.asarray(R[:k, :n], dtype=float), np.asarray(R[:k, n], dtype=float)

    def step(self, damping: float = 0.0, scaling: Array | float = 1.0) -> Array:
        """The p (n,) least in |J p + r|^2 + damping |D p|^2, D = diag(scaling).

        Without damping, Gauss and Newton's step; where J has no full rank, the shortest one. The
        scaling must be above zero. How it is computed: `steps.automatic`.
        """
        D = np.array(np.broadcast_to(scaling, self.gradient.shape), dtype=float)
        return automatic(self, damping, D).p

    def without(self, held: NDArray[np.bool_], p: Array) -> "Linearization":
        """The problem in the entries that are not held, once the held ones have moved by p."""
        rest = ~held
        moved = np.where(held, p, 0.0)
        smaller = Linearization(self.residual + self.jacobian @ moved, self.jacobian[:, rest])
        smaller.__dict__["normal"] = self.normal[np.ix_(rest, rest)]
        return smaller

    def promise(self, p: Array) -> float:
        """By how much the linear model says that a step lowers the cost."""
        if "normal" in self.__dict__:  # known already, and small: no need to read J again
            bend = float(p @ self.normal @ p)
        else:
            bend = float(np.sum((self.jacobian @ p) ** 2))
        return -float(self.gradient @ p) - 0.5 * bend

    def predicted_cost(self, step: Array) -> float:
        """1/2 |r + J p|^2."""
        return half_squared(self.residual + self.jacobian @ step)

    @property
    def covariance(self) -> Array:
        """Laplace's approximation to the posterior covariance, (J' J)^-1, (n, n).

        R^-1 R^-T from the triangle R of J with its columns scaled to length 1, never from the
        normal equations: no entry's unit costs a digit. Directions that the residual does not
        notice get infinite variance, wherever they point to.
        """
        m, n = self.jacobian.shape
        lengths = np.where(self.column_norms > 0, self.column_norms, 1.0)
        R = scipy.linalg.qr(self.jacobian / lengths, mode="r")[0][: min(m, n)]
        _, s, Vt = np.linalg.svd(R, full_matrices=False)
        seen = s > EPS * max(m, n) * s.max(initial=0.0)
        if seen.sum() == n:
            half = scipy.linalg.solve_triangular(R, np.eye(n)) / lengths[:, None]
            return np.asarray(half @ half.T)
        s, Vt = s[seen], Vt[seen]
        half = Vt.T / s / lengths[:, None]
        blind = 1 - np.sum(Vt**2, axis=0) > 1e-9  # entries with a part in the null space
        C: Array = half @ half.T
        C[blind, :] = C[:, blind] = np.nan
        C[blind, blind] = np.inf
        return C
