"""Whether a stationary point is a minimum: the least curvature of the cost there.

At a minimum the Hessian of the Lagrangian has no negative eigenvalue on the directions that bounds
and constraints leave free (Nocedal and Wright, Numerical Optimization, 2006, theorem 12.5). Its
products with vectors are differences of gradients, so that no Hessian is built.
"""

from collections.abc import Callable

import numpy as np
import scipy.linalg

from workbench.arrays import Array, Mask
from workbench.problem import Problem
from workbench.problem.spectrum import largest_eigenvalue

SADDLE = -1e-4  # of the largest eigenvalue: below, a stationary point counts as a saddle
STEP = 1e-5  # of a whitened unknown, for differences of gradients: their errors are about 1e-10
ON_A_LIMIT = 1e-9  # of a number
SMALL = 200  # unknowns up to which all eigenvalues are computed
ACCURATE = 1e-5  # of the largest eigenvalue, by Lanczos' method


def least_curvature(problem: Problem, x: Array, fixed: Array) -> float:
    """The smallest eigenvalue of the Hessian at a stationary point x (n,) over the largest one.

    Unknowns are scaled by the lengths of their columns of the Jacobian there, so that units do not
    matter. Unknowns on a bound are held fixed, and directions along which active constraints change
    are left out. NaN if the linearization is not finite, and 0 if nothing remains free.
    """
    here = problem.linearize_at(x, fixed)
    if not (np.isfinite(x).all() and here.finite):
        return np.nan
    lengths = here.column_norms
    scale = np.where(lengths > 0, lengths, 1.0)
    free = np.eye(len(x))[:, _inside(problem, x)] / scale[:, None]
    there, active = problem.stacked_constraints, np.zeros(0)
    if there is not None:
        now = there.linearize(x, fixed)
        at_limit = np.minimum(now.values - now.lower, now.upper - now.values) <= now.tolerance
        A = now.rows(at_limit)
        free = free @ scipy.linalg.null_space(A @ free)
        active = np.zeros(there.size)
        active[at_limit] = -np.linalg.lstsq((A / scale).T, here.gradient / scale)[0]

    def gradient(at: Array) -> Array:
        of_cost = problem.cost_and_gradient(at, fixed)[1]
        if there is None:
            return of_cost
        return np.asarray(of_cost + there.linearize(at, fixed).jacobian.T @ active)

    def product(v: Array) -> Array:
        step = free @ v * (STEP / np.linalg.norm(v))
        bend = (gradient(x + step) - gradient(x - step)) / (2 * STEP)
        return np.asarray(free.T @ bend * np.linalg.norm(v))

    return _least_by_largest(product, free.shape[1])


def _inside(problem: Problem, x: Array) -> Mask:
    room = ON_A_LIMIT * np.maximum(1, abs(x))
    return np.asarray((x > problem.lower + room) & (x < problem.upper - room))


def _least_by_largest(product: Callable[[Array], Array], n: int) -> float:
    if n == 0:
        return 0.0
    if n <= SMALL:
        H = np.array([product(unit) for unit in np.eye(n)])
        if not np.isfinite(H).all():
            return np.nan
        values = np.linalg.eigvalsh((H + H.T) / 2)
        return _by_largest(values.min(), abs(values).max())
    largest = largest_eigenvalue(product, n, ACCURATE)
    # shifted, the smallest one is the largest, and is found to a part of the largest
    shifted = largest - largest_eigenvalue(lambda v: largest * v - product(v), n, ACCURATE)
    return _by_largest(shifted, largest)


def _by_largest(value: float, largest: float) -> float:
    return value / largest if largest > 0 else 0.0 * largest
