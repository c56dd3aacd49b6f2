"""Robust kernels: how much a large residual still counts.

A kernel replaces the square s = (r / sigma)^2 of a whitened residual by rho(s), with
rho(s) ~ s at 0, so that sigma keeps its meaning and the cost is 1/2 sum rho(s). It is given as
the factor g(s) = sqrt(rho(s) / s): the residual r / sigma shrinks to g(s) r / sigma, whose
square is rho(s). That is smooth at 0, so Gauss-Newton and its kin need nothing else.
"""

from collections.abc import Callable

import casadi as cs
import numpy as np

from workbench.errors import BadResidual

Kernel = Callable[[cs.MX], cs.MX]


def quadratic(s: cs.MX) -> cs.MX:
    """rho(s) = s: no robustness, the Gaussian."""
    return cs.MX.ones(*s.shape)


def geman_mcclure(s: cs.MX) -> cs.MX:
    """rho(s) = s / (1 + s), at most 1 however far the outlier.

    In the residual x: sigma^2 rho = sigma^2 x^2 / (sigma^2 + x^2), SMPLify's penaliser; dividing
    by sigma^2 here makes the cost dimensionless, so weights taken from SMPLify, which keeps the
    sigma^2, are not interchangeable with ours (Geman and McClure 1987; Bogo et al. 2016).
    Halfway (rho = 1/2) at |x| = sigma; the pull is strongest at |x| = sigma / sqrt(3).
    Raises BadResidual for a number: it has no parameter of its own.
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

    def kernel(s: cs.MX) -> cs.MX:
        far = s > threshold**2
        size = cs.sqrt(cs.if_else(far, s, 1))  # guarded: both branches are evaluated
        shrunk = cs.sqrt(cs.if_else(far, 2 * threshold * size - threshold**2, 1)) / size
        return cs.if_else(far, shrunk, 1)

    return kernel
