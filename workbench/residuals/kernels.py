"""Robust kernels: how much a large residual still counts.

A kernel replaces the square s = (r / sigma)^2 of a whitened residual by rho(s), with
rho(s) ~ s at 0, so that sigma keeps its meaning and the cost is 1/2 sum rho(s). It is given as
the factor g(s) = sqrt(rho(s) / s): the residual r / sigma shrinks to g(s) r / sigma, whose
square is rho(s). That is smooth at 0, so Gauss-Newton and its kin need nothing else.

A kernel is a function of a matrix of squares (d, N), one column for each of N points with d
coordinates, and returns factors of the same shape. The kernels below treat every number by
itself; `of_norms` makes kernels of |r / sigma| out of them. Weights are outside of the kernel,
1/2 w rho(s): an outlier of low confidence is still an outlier, and counts less.
"""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as cs
import numpy as np

from workbench.errors import BadResidual

Kernel = Callable[[cs.MX], cs.MX]


def quadratic(s: cs.MX) -> cs.MX:
    """rho(s) = s: no robustness, the Gaussian."""
    return cs.MX.ones(*s.shape)


def geman_mcclure(s: cs.MX) -> cs.MX:
    """rho(s) = s / (1 + s), which is at most 1, however far away an outlier is.

    In the residual x: sigma^2 rho = sigma^2 x^2 / (sigma^2 + x^2), SMPLify's penaliser; dividing
    by sigma^2 here makes the cost dimensionless, so weights taken from SMPLify, which keeps the
    sigma^2, are not interchangeable with ours (Geman and McClure 1987; Bogo et al. 2016).
    rho is 1/2 at |x| = sigma; a residual has most influence at |x| = sigma / sqrt(3).
    """
    if not isinstance(s, (cs.MX, cs.SX, cs.DM)):
        raise BadResidual(
            f"geman_mcclure is the kernel itself, not geman_mcclure({s!r}); write "
            "kernel=geman_mcclure, and say by sigma where outliers begin"
        )
    return 1 / cs.sqrt(1 + s)


def huber(threshold: float = 1.345) -> Kernel:
    """rho(s) = s up to |x| = threshold sigma, linear in |x| beyond: 2 k |x|/sigma - k^2.

    1.345 keeps 95 % of the efficiency on Gaussian data (Huber 1964). Raises BadResidual for a
    threshold that is not above zero.
    """
    if not isinstance(threshold, (int, float, np.number)) or not 0 < threshold < np.inf:
        raise BadResidual(
            f"huber takes a threshold above zero, in sigmas, not {threshold}; the kernel is "
            "huber() or huber(threshold)"
        )
    return Huber(float(threshold))


@dataclass(frozen=True)
class Huber:
    """Huber's kernel as a value, so that two with the same threshold are equal; see `huber`."""

    threshold: float  # k, in sigmas

    def __call__(self, s: cs.MX) -> cs.MX:
        """The factors g(s) of squares s."""
        k = self.threshold
        far = s > k**2
        size = cs.sqrt(cs.if_else(far, s, 1))  # guarded: both branches are evaluated
        shrunk = cs.sqrt(cs.if_else(far, 2 * k * size - k**2, 1)) / size
        return cs.if_else(far, shrunk, 1)


@dataclass(frozen=True)
class Scaled:
    """A kernel with a scale of its own, apart from sigma; see `scaled`."""

    of: Kernel  # at a scale of one sigma
    scale: float  # c, in sigmas

    def __call__(self, s: cs.MX) -> cs.MX:
        """The factors g(s / c^2) of squares s."""
        return self.of(s / self.scale**2)


def scaled(kernel: Kernel, scale: float) -> Scaled:
    """c^2 rho(s / c^2): the same kernel, for which outliers begin c times as far away.

    Sigma says how noisy good data are, and c where bad data begin; with `geman_mcclure` alone both
    are one number, and whoever widens it to reach farther also trusts all data less, compared with
    priors. Near zero c changes nothing: c^2 rho(s / c^2) ~ s. Give `of_norms(scaled(...))` for
    distances of points. Raises BadResidual for a kernel that is no function, for one of norms, and
    for a scale that is not above zero.
    """
    if not callable(kernel) or isinstance(kernel, OfNorms):
        raise BadResidual(
            "scaled takes a kernel of single numbers, such as geman_mcclure, not "
            f"{kernel!r}; for distances write of_norms(scaled(geman_mcclure, 10))"
        )
    if not isinstance(scale, (int, float, np.number)) or not 0 < scale < np.inf:
        raise BadResidual(f"a kernel's scale is a number of sigmas above zero, not {scale}")
    return Scaled(kernel, float(scale))


@dataclass(frozen=True)
class OfNorms:
    """A kernel of the lengths of whole residuals, made from one of single numbers: `of_norms`."""

    of: Kernel

    def __call__(self, squares: cs.MX) -> cs.MX:
        """One factor g(s_1 + ... + s_d) for all d coordinates of a point: (d, N) from (d, N)."""
        return cs.repmat(self.of(cs.sum1(squares)), squares.shape[0], 1)


def of_norms(kernel: Kernel) -> OfNorms:
    """The kernel of |p - q| instead of each coordinate: 1/2 sum over points of rho(|r / sigma|^2).

    Every coordinate of a point is shrunk by the same factor, g(s) r / sigma with s = |r / sigma|^2,
    so the squares of its rows add up to rho(s). The cost does not depend on the directions of the
    axes, as that of a kernel of single coordinates does, and a point that is wrong in one
    coordinate is trusted less in the others as well. With `quadratic` nothing changes.

    A point keeps its two or three rows: one row sqrt(rho(|r|^2)) would have the same cost, but no
    derivative where r is zero. If the sigmas of a point's coordinates differ, |r / sigma| is
    Mahalanobis' distance. 95 % of Gaussian points in space lie within 2.80 sigma, and not within
    1.96.

    Raises BadResidual if it is given no function, or a kernel that is already one of norms.
    """
    if not callable(kernel) or isinstance(kernel, OfNorms):
        raise BadResidual(
            "of_norms takes a kernel of single numbers, such as geman_mcclure or huber(1.345), "
            f"not {kernel!r}"
        )
    return OfNorms(kernel)
