"""Numbers that are expected near a mean: a Gaussian prior, or a measurement."""

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular

from workbench.arrays import Array
from workbench.blocks.checks import reals
from workbench.errors import BadResidual
from workbench.residuals.arguments import named
from workbench.residuals.residual import Residual, check_symbolic


def gaussian(
    expression: cs.MX,
    *,
    mean: ArrayLike = 0.0,
    covariance: ArrayLike = 1.0,
    unit: str = "1",
    name: str | None = None,
) -> Residual:
    """x - mean with its covariance: half the sum of squares is half Mahalanobis' distance squared.

    x is a block's symbol or any expression, read in the order of the array that a user sees.
    `mean` has the array's shape or broadcasts to it; `covariance` is a variance, one per entry, or
    a matrix (n, n). A matrix is whitened by its Cholesky factor, L^-1 (x - mean), so that the
    residual has no unit left and sigma 1. Raises BadResidual if shapes do not fit, a number is
    not finite or the covariance is not positive definite, and NotNumbers for text and the like.
    """
    check_symbolic("what a gaussian is about", expression)
    x = cs.vec(expression)
    n = int(x.shape[0])
    name = name or named("gaussian", expression)
    rows, columns = expression.shape
    shape = (n,) if columns == 1 else (columns, rows)  # as a user sees it
    C = reals(f"residual {name!r}: the covariance", covariance)
    mu = reals(f"residual {name!r}: the mean", mean)
    given = mu.shape
    try:
        mu = mu if mu.shape == (n,) else np.broadcast_to(mu, shape).ravel()
    except ValueError:
        mu = np.zeros(0)
    if mu.size != n or C.shape not in ((), (n,), (n, n)):
        raise BadResidual(
            f"residual {name!r} is about {shape} numbers, but has a mean of {given} and "
            f"a covariance of {C.shape}; give a mean for {shape} or ({n},), and a covariance of "
            f"shape (), ({n},) or ({n}, {n})"
        )
    if not np.isfinite(mu).all():
        i = int(np.argmax(~np.isfinite(mu)))
        raise BadResidual(f"residual {name!r} needs a finite mean, but entry {i} of it is {mu[i]}")
    difference = x - cs.DM(mu)
    if C.ndim == 2:
        return Residual(name, cs.sparsify(cs.DM(whitening(C, name))) @ difference, 1.0)
    if not ((C > 0) & np.isfinite(C)).all():
        wrong = C[~((C > 0) & np.isfinite(C))].flat[0]
        raise BadResidual(f"residual {name!r} needs finite variances above zero, not {wrong}")
    return Residual(name, difference, np.sqrt(C), unit)


def whitening(C: Array, name: str) -> Array:
    """L^-1 of a covariance C = L L', both (n, n), for the residual of this name; zero above.

    Raises BadResidual for one that is not finite, not symmetric or not positive definite.
    """
    rounding = 1e-12 * np.abs(C).max(initial=0)  # of what was computed in two orders
    # Cholesky would read the lower half only
    if not (np.isfinite(C).all() and np.allclose(C, C.T, rtol=1e-9, atol=rounding)):
        raise BadResidual(f"residual {name!r} needs a covariance that is finite and symmetric")
    try:
        L = np.linalg.cholesky(C)
    except np.linalg.LinAlgError:
        low = np.linalg.eigvalsh(C)[0]
        raise BadResidual(
            f"residual {name!r} needs a positive definite covariance; the smallest eigenvalue "
            f"of this one is {low:.3g}"
        ) from None
    # as a triangle: a general inverse leaves rounding errors where half of the numbers are zero
    return np.tril(solve_triangular(L, np.eye(len(L)), lower=True))
