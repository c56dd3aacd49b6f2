"""A least-squares problem seen from one point, where it is nearly linear."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

Array = NDArray[np.float64]
EPS = float(np.finfo(float).eps)
CHOLESKY_UP_TO = 1e6  # of the condition of J; its square is what Cholesky meets


@dataclass(frozen=True, eq=False)
class Linearization:
    """r(x + p) ~ r + J p, whitened, and the textbook formulas on it."""

    residual: Array  # (m,)
    jacobian: Array  # (m, n)

    @property
    def cost(self) -> float:
        """1/2 |r|^2."""
        return 0.5 * float(self.residual @ self.residual)

    @cached_property
    def gradient(self) -> Array:
        """J' r, (n,): the factor 2 of |r|^2 is gone with the half."""
        return self.jacobian.T @ self.residual

    @cached_property
    def normal(self) -> Array:
        """J' J, (n, n): Gauss and Newton's Hessian."""
        return self.jacobian.T @ self.jacobian

    @cached_property
    def column_norms(self) -> Array:
        """|J_i|, (n,): what one unit of each entry does to the residual."""
        columns = self.jacobian.T  # as it is stored
        return np.asarray(np.sqrt(np.einsum("ij,ij->i", columns, columns)))

    @property
    def finite(self) -> bool:
        """Whether every number of the residual and the Jacobian is."""
        if not np.isfinite(self.residual).all():
            return False
        return bool(np.isfinite(self.column_norms).all() or np.isfinite(self.jacobian).all())

    @cached_property
    def svd(self) -> tuple[Array, Array, Array]:
        """`U, s, Vt` of the Jacobian, thin: s (k,) falls, the rows of Vt (k, n) are directions."""
        return np.linalg.svd(self.jacobian, full_matrices=False)

    @property
    def tolerance(self) -> float:
        """The singular value below which a direction counts as unseen: eps max(m, n) s_1."""
        s = self.svd[1]
        return float(EPS * max(self.jacobian.shape) * s.max(initial=0.0))

    @property
    def rank(self) -> int:
        """How many directions the residual notices."""
        return int(np.sum(self.svd[1] > self.tolerance))

    def step(self, damping: float = 0.0, scaling: Array | float = 1.0) -> Array:
        """The p (n,) least in |J p + r|^2 + damping |D p|^2, D = diag(scaling).

        Without damping, Gauss and Newton's step; where J has no full rank, the shortest one. Well
        conditioned normal equations go to Cholesky, all else to the singular values. The scaling
        must be above zero.
        """
        D = np.broadcast_to(np.asarray(scaling, dtype=float), self.gradient.shape)
        A = self.normal + damping * np.diag(D**2)
        d = np.sqrt(np.diag(A))
        if (d > 0).all():
            try:
                L = scipy.linalg.cholesky(A / np.outer(d, d), lower=True)
            except np.linalg.LinAlgError:
                L = np.zeros((1, 1))
            if np.diag(L).min() > 1 / CHOLESKY_UP_TO:
                return -scipy.linalg.cho_solve((L, True), self.gradient / d) / d
        if damping == 0 or (D == 1).all():
            D, (U, s, Vt) = np.ones_like(D), self.svd
        else:
            U, s, Vt = np.linalg.svd(self.jacobian / D, full_matrices=False)
        seen = s > EPS * max(self.jacobian.shape) * s.max(initial=0.0)
        s, U, Vt = s[seen], U[:, seen], Vt[seen]
        # unseen directions are left out: there damping below eps would magnify rounding errors
        return np.asarray(-(Vt.T @ ((U.T @ self.residual) / (s + damping / s))) / D)

    def predicted_cost(self, step: Array) -> float:
        """1/2 |r + J p|^2."""
        r = self.residual + self.jacobian @ step
        return 0.5 * float(r @ r)

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
