"""A mixture of Gaussians as a prior, in the two forms that a least-squares problem can take.

With e_j(x) = 1/2 |L_j^-1 (x - mu_j)|^2 + c_j, L_j L_j' = Sigma_j and c_j = log det L_j - log g_j,
minus the log density of the mixture is, up to a constant,

    -log sum over j of exp(-e_j)       exactly, and at most      min over j of e_j,

the max-mixture of Olson and Agarwal (Inference on networks of mixtures for robust robot mapping,
2013), which SMPLify takes (Bogo et al. 2016, section 3.3). The second is larger than the first by
at most the log of the number of components, 2.08 for eight.
"""

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks.checks import reals
from workbench.errors import BadResidual
from workbench.residuals.arguments import named
from workbench.residuals.gaussian import whitening
from workbench.residuals.residual import Residual, check_symbolic

SMALLEST = 1e-30  # of a Kullback-Leibler divergence: below, its root is taken for 0


def max_mixture(
    expression: cs.MX,
    *,
    shares: ArrayLike,
    means: ArrayLike,
    covariances: ArrayLike,
    name: str | None = None,
) -> Residual:
    """The rows of the likeliest component, L_j^-1 (x - mu_j), and sqrt(2 (c_j - min c)).

    The likeliest one is that with the least e_j(x) = 1/2 |L_j^-1 (x - mu_j)|^2 + c_j, where
    L_j L_j' is its covariance and c_j = log det L_j - log g_j.

    The cost is min over j of e_j(x), less the smallest c_j. It has kinks where two components are
    equally likely, and no derivative there; on either side it is one Gaussian. x is a block's
    symbol or an expression of D numbers, read in the order of the array that a user sees; shares
    (C,) are the weights g_j of the components, means (C, D), covariances (C, D, D). Raises
    BadResidual for arrays that do not fit, shares that are not above 0, and a covariance that is
    not positive definite.
    """
    name = name or named("max_mixture", expression)
    white, c = _components(name, expression, shares, means, covariances)
    e = 0.5 * cs.sum1(white**2).T + cs.DM(c)  # (C, 1)
    first = _first_of(e <= cs.mmin(e))
    rows = cs.vertcat(white @ first, cs.dot(cs.DM(np.sqrt(2 * (c - c.min()))), first))
    return Residual(name, rows, 1.0, components=_each_alone(name, white))


def log_sum_mixture(
    expression: cs.MX,
    *,
    shares: ArrayLike,
    means: ArrayLike,
    covariances: ArrayLike,
    name: str | None = None,
) -> Residual:
    """The mixture itself as rows: sqrt(gamma_j) L_j^-1 (x - mu_j) for all j, and sqrt(2 KL).

    gamma_j = exp(-e_j) / sum of exp(-e) is the share of component j at x, and KL the
    Kullback-Leibler divergence of gamma from the same shares with x - mu = 0 everywhere, which are
    proportional to exp(-c). Half the sum of squares is exactly -log sum of exp(-e_j), plus log sum
    of exp(-c_j). Arguments and errors are those of `max_mixture`.
    """
    name = name or named("log_sum_mixture", expression)
    white, c = _components(name, expression, shares, means, covariances)
    squares = 0.5 * cs.sum1(white**2).T  # (C, 1)
    e = squares + cs.DM(c)
    log_gamma = -e - _log_sum_exp(-e)
    log_prior = -c - np.logaddexp.reduce(-c)
    gamma = cs.exp(log_gamma)
    KL = cs.dot(gamma, log_gamma - cs.DM(log_prior))
    some = KL > SMALLEST
    root = cs.if_else(some, cs.sqrt(2 * cs.if_else(some, KL, 1)), 0)
    rows = cs.vec(white * cs.repmat(cs.exp(0.5 * log_gamma).T, white.shape[0], 1))
    return Residual(name, cs.vertcat(rows, root), 1.0, components=_each_alone(name, white))


def _each_alone(name: str, white: cs.MX) -> tuple[Residual, ...]:
    """Each column L_j^-1 (x - mu_j) of a matrix (D, C) as a residual of its own."""
    columns = cs.horzsplit(white)
    return tuple(Residual(f"{name}, component {j}", one, 1.0) for j, one in enumerate(columns))


def _components(
    name: str, expression: cs.MX, shares: ArrayLike, means: ArrayLike, covariances: ArrayLike
) -> tuple[cs.MX, Array]:
    """L_j^-1 (x - mu_j) as the columns of a matrix (D, C), and the c_j (C,)."""
    check_symbolic("what a mixture is about", expression)
    x = cs.vec(expression)
    g = reals(f"residual {name!r}: the shares", shares)
    mu = reals(f"residual {name!r}: the means", means)
    sigma = reals(f"residual {name!r}: the covariances", covariances)
    C, D = len(np.atleast_1d(g)), int(x.shape[0])
    if g.shape != (C,) or mu.shape != (C, D) or sigma.shape != (C, D, D):
        raise BadResidual(
            f"residual {name!r} is about {D} numbers, and has shares {g.shape}, means {mu.shape} "
            f"and covariances {sigma.shape}; they must be (C,), (C, {D}) and (C, {D}, {D})"
        )
    if not C or not ((g > 0) & np.isfinite(g)).all() or not np.isfinite(mu).all():
        raise BadResidual(
            f"residual {name!r} needs finite means, and shares above 0; leave out a component that "
            "has none"
        )
    inverse = np.array([whitening(one, name) for one in sigma])  # L^-1, (C, D, D)
    c = -np.log(np.einsum("cii->ci", inverse)).sum(axis=1) - np.log(g / g.sum())
    shifts = np.einsum("cde,ce->cd", inverse, mu).ravel()
    stacked = cs.DM(inverse.reshape(C * D, D)) @ x - cs.DM(shifts)
    return cs.reshape(stacked, D, C), np.asarray(c)


def _first_of(lowest: cs.MX) -> cs.MX:
    """1 for the first component among those that are lowest, and 0 for the others, (C, 1)."""
    before = cs.MX(0)
    found = []
    for j in range(lowest.shape[0]):
        found.append(lowest[j] * (1 - before))
        before = cs.fmax(before, lowest[j])
    return cs.vertcat(*found)


def _log_sum_exp(x: cs.MX) -> cs.MX:
    largest = cs.mmax(x)
    return largest + cs.log(cs.sum1(cs.exp(x - largest)))
