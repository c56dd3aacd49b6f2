"""The largest and the smallest singular value of a Jacobian that was eliminated, without an SVD."""

from collections.abc import Callable

import numpy as np

from workbench.arrays import Array
from workbench.problem import Linearization
from workbench.problem.lanczos import largest_eigenvalue

ACCURATE = 1e-6  # relative error of the squares of singular values, by Lanczos' method


def condition_along(
    here: Linearization, constraints: Array, covariance_times: Callable[[Array], Array]
) -> float:
    """The condition of J (m, n) along the directions that the rows A (k, n) of constraints allow.

    `covariance_times` multiplies by the inverse P of J'J plus any multiple of A'A. Along these
    directions the inverse of J'J is P - P A' (A P A')^-1 A P, whose largest eigenvalue is one over
    the square of the smallest singular value. NaN where Lanczos' method does not converge.
    """
    n = here.shape[1]
    inverse = _within(constraints, covariance_times)
    allowed = _within(constraints, lambda v: v)

    def normal(v: Array) -> Array:
        return allowed(here.jacobian.T @ (here.jacobian @ allowed(v)))

    largest = largest_eigenvalue(normal, n, ACCURATE)
    return float(np.sqrt(largest * largest_eigenvalue(inverse, n, ACCURATE)))


def _within(A: Array, times: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """P - P A' (A P A')^-1 A P as a product with vectors, from the product P."""
    if not len(A):
        return times
    across = times(A.T)
    inner = A @ across
    return lambda v: times(v) - across @ np.linalg.solve(inner, across.T @ v)
