"""Laplace's approximation to the covariance of the unknowns, (J'J)^-1."""

import numpy as np
import scipy.linalg

from workbench.arrays import Array
from workbench.problem.steps import factor_of
from workbench.problem.storage import Symmetric

NEGLIGIBLE = 1e-9  # the square of an entry's part in the null space up to which it has none


def covariance_of(R: Array, lengths: Array, relative: float, estimated: bool) -> Array:
    """(J'J)^-1 (n, n) from the triangle R of J with columns of length 1, and their `lengths` (n,).

    Directions whose singular value is at most `relative` times the largest count as null; entries
    with a part in them have infinite variance, and NaN for their covariance with others.
    """
    n = len(lengths)
    _, s, Vt = np.linalg.svd(R, full_matrices=False)
    determined = s > relative * s.max(initial=0.0)
    if determined.sum() == n and not estimated:
        half = scipy.linalg.solve_triangular(R, np.eye(n)) / lengths[:, None]
        return np.asarray(half @ half.T)
    return covariance_without(s[determined], Vt[determined], lengths)


def covariance_without(s: Array, Vt: Array, lengths: Array) -> Array:
    """The covariance (n, n), infinite for what is not determined.

    J has the columns of U diag(s) V' times `lengths`; s (r,) and the rows of V' (r, n) are those of
    the determined directions. What V leaves out is the null space: an entry has the share 1 - sum
    of v_i^2 of its unit vector in it.
    """
    half = Vt.T / s / lengths[:, None]
    null = 1 - np.sum(Vt**2, axis=0) > NEGLIGIBLE
    C: Array = half @ half.T
    C[null, :] = C[:, null] = np.nan
    C[null, null] = np.inf
    return C


def inverse_times(normal: Symmetric, right: Array, raised: Array | float = 0.0) -> Array | None:
    """(A + diag(raised))^-1 times an array (n, k), A = J'J; None where too few digits are left."""
    more = np.broadcast_to(np.asarray(raised, dtype=float), normal.shape[:1])
    if not isinstance(normal, np.ndarray):
        factor = factor_of(normal, more)
        return None if factor is None else factor.solve(right)
    try:
        lower = scipy.linalg.cho_factor(normal + np.diag(more), lower=True)
    except np.linalg.LinAlgError:
        return None
    return np.asarray(scipy.linalg.cho_solve(lower, right))
