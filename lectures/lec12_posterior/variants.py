"""Exercises of lecture 12 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


@variant(
    "log_posterior",
    points=2,
    minutes=15,
    draw=lambda rng: {
        "FOCAL": rounded(rng, 700, 1900, digits=1),
        "DEPTH": rounded(rng, 3.1, 7.9, digits=3),
        "LENGTH": rounded(rng, 0.19, 0.33, digits=3),
        "SIGMA": rounded(rng, 1.5, 6.5, digits=2),
        "MEAN": rounded(rng, -0.6, 0.6, digits=3),
        "PRIOR": rounded(rng, 0.3, 0.9, digits=3),
    },
    arguments=lambda rng, numbers: (rng.uniform(-1.2, 1.2), rng.uniform(20, 60)),
)
def log_posterior(
    phi: float,
    seen: float,
    *,
    FOCAL: float,
    DEPTH: float,
    LENGTH: float,
    SIGMA: float,
    MEAN: float,
    PRIOR: float,
) -> float:
    """The log posterior of the lecture's forearm, with your camera, person and prior; no constant.

    The elbow is at DEPTH m on the axis of a camera of FOCAL px; the forearm of LENGTH m is turned by phi out of
    the image plane, away from the camera, and its wrist was seen `seen` px from the elbow, with an error of
    SIGMA px. Beforehand phi is Gaussian about MEAN with the standard deviation PRIOR, rad. It is 0 if both
    residuals are 0.

    phi rad; seen px -> a number
    """
    pixel = FOCAL * LENGTH * np.cos(phi) / (DEPTH + LENGTH * np.sin(phi))
    return -0.5 * ((pixel - seen) / SIGMA) ** 2 - 0.5 * ((phi - MEAN) / PRIOR) ** 2


@mistake("log_posterior", "the prior's mean is not zero")
def log_posterior_about_zero(phi, seen, *, FOCAL, DEPTH, LENGTH, SIGMA, MEAN, PRIOR):
    return log_posterior.solution(
        phi, seen, FOCAL=FOCAL, DEPTH=DEPTH, LENGTH=LENGTH, SIGMA=SIGMA, MEAN=0.0, PRIOR=PRIOR
    )


@variant(
    "interval",
    points=2,
    minutes=10,
    draw=lambda rng: {
        "BELOW": rounded(rng, 0.01, 0.09, digits=3),
        "ABOVE": rounded(rng, 0.11, 0.3, digits=3),
    },
    arguments=lambda rng, numbers: (rng.standard_normal((200, 2)),),
)
def interval(draws: Array, *, BELOW: float, ABOVE: float) -> Array:
    """An interval of each entry that is not central: a share BELOW of the draws is below it, ABOVE above.

    By np.quantile, with its usual interpolation.

    draws (S, k) -> (k, 2), low and high
    """
    return np.quantile(draws, [BELOW, 1 - ABOVE], axis=0).T


@mistake("interval", "ABOVE is what lies above: the quantile is 1 - ABOVE")
def interval_the_other_way(draws, *, BELOW, ABOVE):
    return np.quantile(draws, [ABOVE, 1 - BELOW], axis=0).T


@variant(
    "stretch",
    points=3,
    minutes=20,
    draw=lambda rng: {"A": rounded(rng, 1.4, 3.6, digits=3)},
    arguments=lambda rng, numbers: (*rng.standard_normal((2, 3)), rng.uniform(0.05, 0.95)),
)
def stretch(x: Array, other: Array, u: float, *, A: float) -> tuple[Array, float]:
    """Goodman and Weare's stretch move of walker x about another one, with the stretch drawn by you.

    z has a density proportional to 1 / sqrt(z) from 1 / A to A, and is drawn from u, which is uniform from 0
    to 1: z is where the distribution function of that density is u. Return the proposal, and the logarithm of
    the factor beside p(y) / p(x) with which it is accepted.

    x (k,), other (k,), u -> (k,) and a number
    """
    z = ((A - 1) * u + 1) ** 2 / A
    return other + z * (x - other), (len(x) - 1) * np.log(z)


@mistake(
    "stretch", "z is not uniform from 1 / A to A: invert the distribution function of 1 / sqrt(z)"
)
def stretch_uniformly(x, other, u, *, A):
    z = 1 / A + u * (A - 1 / A)
    return other + z * (x - other), (len(x) - 1) * np.log(z)


@mistake(
    "stretch", "the exponent is k - 1: stretching gives k, and the density of z takes one away"
)
def stretch_with_k(x, other, u, *, A):
    y, factor = stretch.solution(x, other, u, A=A)
    return y, factor * len(x) / (len(x) - 1)


@mistake("stretch", "the logarithm of the factor is asked for")
def stretch_not_its_logarithm(x, other, u, *, A):
    y, factor = stretch.solution(x, other, u, A=A)
    return y, np.exp(factor)
