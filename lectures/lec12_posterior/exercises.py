"""Exercises of lecture 12, the posterior.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
Angles are in radians, lengths in metres, images in pixels. Then

    workbench lecture check 12 lec12_posterior.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray

F, D, LENGTH = 1000.0, 5.0, 0.25  # px, m, m: the camera and the forearm of the lecture
SIGMA, PRIOR = 3.0, 0.6  # px, rad: the detector's error, and what is known of the angle beforehand


def log_posterior(phi: float, seen: float) -> float:
    """The log posterior of the lecture's forearm, without its constant: 0 where both residuals are 0.

    phi rad, out of the image plane; seen px, from the elbow -> a number
    """
    raise Unsolved("log_posterior")


def deviations(J: Array) -> Array:
    """Laplace's standard deviation of each unknown, with all others unknown as well.

    J (m, n), of the whitened residuals, with independent columns -> (n,)
    """
    raise Unsolved("deviations")


def interval(draws: Array, level: float) -> Array:
    """The central interval of each entry: it holds the share `level`, and as many draws are below it as above.

    draws (S, k), level a share such as 0.9 -> (k, 2), low and high; np.quantile is allowed
    """
    raise Unsolved("interval")


def next_point(log_p, x: Array, y: Array, drawn: float) -> Array:
    """The point after x in the chain of Metropolis: y, which was proposed, or x once more.

    The step is taken with the probability that the lecture says. To decide, a number was `drawn`
    uniformly from 0 to 1, so that it is below a probability P in a share P of all cases.

    log_p takes (n,) and answers the logarithm of the density; x (n,), y (n,), drawn above 0 -> (n,)
    """
    raise Unsolved("next_point")


def stretch(x: Array, other: Array, z: float) -> tuple[Array, float]:
    """Goodman and Weare's stretch move of walker x about another one.

    The proposal, and the logarithm of the factor beside p(y) / p(x) with which it is accepted. The
    density of z is the lecture's, proportional to 1 / sqrt(z).

    x (k,), other (k,), z above 0 -> (k,) and a number
    """
    raise Unsolved("stretch")


def draw(log_p, start: Array, count: int) -> Array:
    """Draws from a density in two dimensions that may be narrow, slanted, bent, or in two pieces.

    Use any method of your own (not emcee), and random numbers of a fixed seed. You are not told which
    density it is. Four are tried, and one of them is two hundred times as long as wide, so that no
    single size of steps will do. Standard deviations are between 0.01 and 2, along directions of any
    slant, and pieces are at most 4 apart. Along the directions of the density, the mean of your draws
    must be right to a quarter of a standard deviation, and the standard deviations to a fifth; with
    two pieces, that asks for the right share of draws in each. `count` is 1000. Calls of log_p are not
    counted: ten for each draw are known to be enough, and more are allowed. An answer is stopped after 10
    seconds, which are for all four densities together (`workbench lecture check --seconds` changes that).

    log_p takes (2,) and answers the logarithm of the density; start (2,); count -> (count, 2)
    """
    raise Unsolved("draw")
