"""Exercises of lecture 10 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


@variant(
    "rho",
    points=1,
    minutes=8,
    draw=lambda rng: {
        "SIGMA": rounded(rng, 0.21, 0.9, digits=3),
        "SCALE": rounded(rng, 1.1, 3.9, digits=3),
    },
    arguments=lambda rng, numbers: (rng.uniform(-6, 6),),
)
def rho(x: float, *, SIGMA: float, SCALE: float) -> float:
    """A loss that is (x / SIGMA)^2 near zero, half of that at |x| = SCALE, and bounded far away.

    Of the form of Geman and McClure's.

    x, SIGMA and SCALE in one unit -> a number
    """
    return (x / SIGMA) ** 2 / (1 + (x / SCALE) ** 2)


@mistake("rho", "this has no sigma in front: near zero it has to be (x / SIGMA)^2")
def rho_without_sigma(x, *, SIGMA, SCALE):
    return x**2 / (SCALE**2 + x**2)


@variant(
    "influence",
    points=2,
    minutes=12,
    draw=lambda rng: {
        "WIDTH": rounded(rng, 0.41, 2.9, digits=3),
        "POWER": rounded(rng, 0.6, 1.9, digits=2),
    },
    arguments=lambda rng, numbers: (rng.uniform(-5, 5),),
    edges=lambda numbers: [(0.0,)],
)
def influence(x: float, *, WIDTH: float, POWER: float) -> float:
    """The derivative by x of the loss rho(x) = ((1 + (x / WIDTH)^2)^POWER - 1) / POWER.

    x and WIDTH in one unit -> a number, in one over the unit
    """
    return 2 * x / WIDTH**2 * (1 + (x / WIDTH) ** 2) ** (POWER - 1)


@mistake("influence", "the inner derivative is 2 x / WIDTH^2")
def influence_without_inner(x, *, WIDTH, POWER):
    return (1 + (x / WIDTH) ** 2) ** (POWER - 1)


@variant(
    "max_mixture",
    points=3,
    minutes=20,
    draw=lambda rng: {
        "SHARES": [*(some := rounded(rng, 0.11, 0.4, count=2, digits=3)), round(1 - sum(some), 3)],
        "MEANS": [
            rounded(rng, -3, -1, digits=3),
            rounded(rng, -0.9, 0.9, digits=3),
            rounded(rng, 1, 3, digits=3),
        ],
        "DEVIATIONS": rounded(rng, 0.21, 1.4, count=3, digits=3),
    },
    arguments=lambda rng, numbers: (rng.uniform(-4, 4, 6),),
)
def max_mixture(
    x: Array, *, SHARES: list[float], MEANS: list[float], DEVIATIONS: list[float]
) -> Array:
    """For each angle, the least of -log(share N(angle; mean, deviation^2)) over your three components.

    N is the density of a Gaussian in one dimension; leave out its factor sqrt(2 pi).

    x (n,) rad -> (n,)
    """
    off = (x[:, None] - MEANS) / DEVIATIONS
    return np.min(0.5 * off**2 + np.log(DEVIATIONS) - np.log(SHARES), axis=1)


@mistake("max_mixture", "a wide component is lower: the density has 1 / deviation in front")
def max_mixture_without_width(x, *, SHARES, MEANS, DEVIATIONS):
    return np.min(0.5 * ((x[:, None] - MEANS) / DEVIATIONS) ** 2 - np.log(SHARES), axis=1)


@mistake("max_mixture", "this is the sum of all components, and not the likeliest one")
def max_mixture_of_all(x, *, SHARES, MEANS, DEVIATIONS):
    off = (x[:, None] - MEANS) / DEVIATIONS
    return -np.log(np.sum(np.exp(-0.5 * off**2) * SHARES / DEVIATIONS, axis=1))
