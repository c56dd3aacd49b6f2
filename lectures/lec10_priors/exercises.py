"""Exercises of lecture 10, priors and robust losses.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
Then

    workbench lecture check 10 lec10_priors.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def whitened(x: Array, mean: Array, C: Array) -> Array:
    """A residual for a Gaussian prior: its sum of squares is Mahalanobis' distance squared.

    That is (x - mean)' C^-1 (x - mean), for every x.

    x (n,), mean (n,), C (n, n), symmetric and positive definite -> (n,)
    """
    raise Unsolved("whitened")


def rho(x: float, sigma: float) -> float:
    """Geman and McClure's loss without a unit: one half at |x| = sigma, and below one everywhere.

    x and sigma in one unit -> a number
    """
    raise Unsolved("rho")


def influence(x: float, sigma: float) -> float:
    """The derivative of that rho by x: how hard a residual pulls.

    x and sigma in one unit -> a number, in one over the unit
    """
    raise Unsolved("influence")


def shrunk(x: Array, sigma: float) -> Array:
    """What Gauss-Newton is given in the place of x: its square is rho, and it has the sign of x.

    x (n,) and sigma in one unit -> (n,)
    """
    raise Unsolved("shrunk")


def max_mixture(x: Array, shares: Array, means: Array, covariances: Array) -> float:
    """The least of -log(share N(x; mean, covariance)) over the components of a mixture.

    N is the density of a Gaussian; leave out its factor (2 pi)^(n/2), which all of them share.

    x (n,); shares (k,), summing to one; means (k, n); covariances (k, n, n) -> a number
    """
    raise Unsolved("max_mixture")


def line(x: Array, y: Array) -> Array:
    """Slope a and offset b of the line y = a x + b that most of the points lie along.

    Three in ten points, or fewer, are anywhere, also far off and all on one side; the others lie
    within a few hundredths of the line. Any method that finds it to 0.05, in a and in b.

    x (n,), from 0 to 1; y (n,) -> (2,)
    """
    raise Unsolved("line")
