"""Checks of lecture 10, and the mistakes that they tell apart."""

import numpy as np
from scipy.optimize import linprog
from scipy.special import logsumexp

from workbench.course import check, equal, holds, mistake
from workbench.lectures.lec10_priors import solutions

RNG = np.random.default_rng(10)
FACTORS = RNG.standard_normal((3, 4, 4))
COVARIANCES = FACTORS @ FACTORS.transpose(0, 2, 1) + 0.3 * np.eye(4)
MEANS = RNG.standard_normal((3, 4))
SHARES = np.array([0.2, 0.5, 0.3])
POINTS = 1.5 * RNG.standard_normal((6, 4))


# whitened


@check("whitened", points=1)
def is_mahalanobis(whitened):
    """its sum of squares is (x - mean)' C^-1 (x - mean)"""
    for mean, C in zip(MEANS, COVARIANCES, strict=True):
        for x in POINTS:
            expected = (x - mean) @ np.linalg.inv(C) @ (x - mean)
            equal(np.sum(whitened(x, mean, C) ** 2), expected, "the sum of squares", 1e-8)
        equal(whitened(mean, mean, C), np.zeros(4), "the residual at the mean")


@mistake("whitened", "the mean has to be taken away")
def without_the_mean(x, mean, C):
    return solutions.whitened(x, np.zeros(4), C)


@mistake("whitened", "this is multiplied by the factor L of C = L L'; a residual is divided by it")
def times_the_factor(x, mean, C):
    return np.linalg.cholesky(C) @ (x - mean)


@mistake("whitened", "the entries hang together: the sigmas on the diagonal are not all there is")
def by_the_diagonal(x, mean, C):
    return (x - mean) / np.sqrt(np.diag(C))


@mistake("whitened", "C^-1 (x - mean), squared, has C twice: it takes a root of C")
def by_the_covariance(x, mean, C):
    return np.linalg.solve(C, x - mean)


@mistake("whitened", "C = L L' has the inverse L'^-1 L^-1: L^-1 comes first. This is L'^-1")
def by_the_transposed_factor(x, mean, C):
    return np.linalg.solve(np.linalg.cholesky(C).T, x - mean)


# rho


@check("rho", points=1)
def is_one_half_at_sigma(rho):
    """it is one half at sigma, and below one"""
    for sigma in (0.05, 1.0, 100.0):
        equal(rho(0.0, sigma), 0, f"rho(0), sigma {sigma}")
        equal(rho(sigma, sigma), 0.5, f"rho(sigma), sigma {sigma}")
        far = rho(-1e4 * sigma, sigma)
        holds(0.999 < far <= 1, f"rho far off, sigma {sigma}", "nearly one, and not above", far)


@check("rho", points=1)
def is_geman_and_mcclures(rho):
    """it has the form of Geman and McClure"""
    for sigma in (0.1, 3.0):
        for share in (0.2, -0.7, 2.5):
            equal(
                rho(share * sigma, sigma),
                share**2 / (1 + share**2),
                f"rho({share} sigma), sigma {sigma}",
            )


@mistake(
    "rho",
    "this has the unit of x^2: it is SMPLify's, which keeps a factor sigma^2. Without it, weights mean something else",
)
def with_sigma_squared(x, sigma):
    return sigma**2 * solutions.rho(x, sigma)


@mistake("rho", "x has to be compared with sigma: this is for sigma = 1")
def without_sigma(x, sigma):
    return solutions.rho(x, 1.0)


@mistake("rho", "squares are missing: sigma^2 + x^2 below, x^2 above")
def without_squares(x, sigma):
    return abs(x) / (sigma + abs(x))


@mistake("rho", "this is another bounded loss (Welsch's): not one half at sigma")
def of_welsch(x, sigma):
    return 1 - np.exp(-(x**2) / sigma**2)


# influence


@check("influence", points=1)
def is_the_slope(influence):
    """it is what difference quotients of rho say"""
    for sigma in (0.5, 2.0):
        for x in (-3.0, -0.4, 0.0, 0.3, 1.7):
            h = 1e-5
            slope = (solutions.rho(x + h, sigma) - solutions.rho(x - h, sigma)) / (2 * h)
            equal(influence(x, sigma), slope, f"the influence at {x}, sigma {sigma}", 1e-7)


@check("influence", points=1)
def is_largest_before_sigma(influence):
    """it is largest at sigma / sqrt(3), and nothing far off"""
    for sigma in (0.5, 2.0):
        peak = influence(sigma / np.sqrt(3), sigma)
        equal(
            peak,
            3 * np.sqrt(3) / 8 / sigma,
            f"the influence at sigma / sqrt 3, sigma {sigma}",
            1e-9,
        )
        far = abs(influence(1000 * sigma, sigma))
        holds(far < 1e-6, "the influence at 1000 sigma", "next to nothing", far)


@mistake("influence", "the factor 2 of the derivative of x^2 is missing")
def without_the_two(x, sigma):
    return solutions.influence(x, sigma) / 2


@mistake(
    "influence",
    "both x^2 above and x^2 below change with x: this took the one below for a constant",
)
def of_the_numerator(x, sigma):
    return 2 * x / (sigma**2 + x**2)


@mistake("influence", "this is the influence of x^2 / sigma^2, which has no end")
def of_squares(x, sigma):
    return 2 * x / sigma**2


@mistake("influence", "a factor sigma^2 is missing above")
def without_sigma_above(x, sigma):
    return 2 * x / (sigma**2 + x**2) ** 2


# shrunk

SOME = np.array([-40.0, -3.0, -0.2, 0.0, 0.1, 0.9, 25.0])


@check("shrunk", points=1)
def has_rho_as_its_square(shrunk):
    """its square is rho"""
    for sigma in (0.3, 5.0):
        equal(
            shrunk(SOME, sigma) ** 2,
            [solutions.rho(x, sigma) for x in SOME],
            f"the square, sigma {sigma}",
        )


@check("shrunk", points=1)
def is_smooth_at_zero(shrunk):
    """it has the sign of x, and passes zero with the slope 1 / sigma"""
    for sigma in (0.3, 5.0):
        equal(np.sign(shrunk(SOME, sigma)), np.sign(SOME), "the signs")
        near = 1e-5 * sigma * np.array([-1.0, 1.0])
        equal(1e5 * shrunk(near, sigma), [-1, 1], "at -1e-5 and 1e-5 sigma, times 1e5", 1e-6)


@mistake(
    "shrunk",
    "the sign got lost: a root of rho without it has a kink at zero, where no derivative is",
)
def without_the_sign(x, sigma):
    return np.abs(solutions.shrunk(x, sigma))


@mistake("shrunk", "this is rho with a sign: it is squared again, and flat at zero. Take the root")
def not_the_root(x, sigma):
    return np.sign(x) * x**2 / (sigma**2 + x**2)


@mistake("shrunk", "the square of this has the factor sigma^2: divide by sigma")
def in_its_unit(x, sigma):
    return sigma * solutions.shrunk(x, sigma)


@mistake("shrunk", "the root of the denominator is missing: far off this falls back to zero")
def over_the_square(x, sigma):
    return x * sigma / (sigma**2 + x**2)


# max_mixture


@check("max_mixture", points=1)
def is_that_of_one(max_mixture):
    """with one component it is its Gaussian"""
    for mean, C in zip(MEANS, COVARIANCES, strict=True):
        for x in POINTS[:2]:
            expected = (
                0.5 * np.sum(solutions.whitened(x, mean, C) ** 2) + 0.5 * np.linalg.slogdet(C)[1]
            )
            came = max_mixture(x, np.ones(1), mean[None], C[None])
            equal(came, expected, "the cost, of one component with share 1", 1e-8)


@check("max_mixture", points=2)
def is_within_log_k(max_mixture):
    """it is above -log of the sum of all, and by log k at most; and it is the least"""
    for x in (*POINTS, *MEANS):
        each = [
            np.log(share)
            - 0.5 * np.sum(solutions.whitened(x, mean, C) ** 2)
            - 0.5 * np.linalg.slogdet(C)[1]
            for share, mean, C in zip(SHARES, MEANS, COVARIANCES, strict=True)
        ]
        came = max_mixture(x, SHARES, MEANS, COVARIANCES)
        above = came + logsumexp(each)
        holds(
            -1e-9 <= above <= np.log(3) + 1e-9,
            "the cost less -log of the sum",
            "from 0 to log 3 = 1.099",
            above,
        )
        equal(came, -max(each), "the cost", 1e-8)


def costs(x, shares, means, covariances, with_log_det=1.0, with_share=1.0):
    return np.array(
        [
            0.5 * np.sum(solutions.whitened(x, mean, C) ** 2)
            + with_log_det * 0.5 * np.linalg.slogdet(C)[1]
            - with_share * np.log(share)
            for share, mean, C in zip(shares, means, covariances, strict=True)
        ]
    )


@mistake(
    "max_mixture",
    "the densities' heights are missing: a wide Gaussian is low, so 1/2 log det C belongs to each",
)
def without_the_determinants(x, shares, means, covariances):
    return costs(x, shares, means, covariances, with_log_det=0.0).min()


@mistake("max_mixture", "the sign of log det: -log of 1 / sqrt(det C) is plus 1/2 log det C")
def with_the_other_sign(x, shares, means, covariances):
    return costs(x, shares, means, covariances, with_log_det=-1.0).min()


@mistake("max_mixture", "the shares are missing: -log share belongs to each component")
def without_shares(x, shares, means, covariances):
    return costs(x, shares, means, covariances, with_share=0.0).min()


@mistake("max_mixture", "this is -log of the sum: the mixture itself, which is no sum of squares")
def of_the_sum(x, shares, means, covariances):
    return -logsumexp(-costs(x, shares, means, covariances))


@mistake("max_mixture", "the squares have a half before them: 1/2 of Mahalanobis' distance squared")
def without_the_half(x, shares, means, covariances):
    return min(
        np.sum(solutions.whitened(x, mean, C) ** 2) + 0.5 * np.linalg.slogdet(C)[1] - np.log(share)
        for share, mean, C in zip(shares, means, covariances, strict=True)
    )


# line


def scene(seed, share, a, b):
    rng = np.random.default_rng(seed)
    x = np.linspace(0, 1, 30)
    y = a * x + b + 0.02 * rng.standard_normal(30)
    n = int(share * 30)
    off = rng.permutation(30)[:n] if seed % 2 else np.arange(30 - n, 30)  # anywhere, or at an end
    y[off] = a * x[off] + b + rng.uniform(2, 3, n)
    return x, y


CLEAN = [scene(1, 0.0, 0.7, -0.2), scene(2, 0.0, -1.0, 0.5)]
DIRTY = [
    (scene(seed, 0.3, a, b), (a, b))
    for seed, a, b in ((3, 0.5, 0.1), (4, -0.8, 1.0), (5, 1.5, -1.0), (6, 0.3, 0.0))
]


@check("line", points=1)
def finds_it_in_clean_points(line):
    """it finds a line without wrong points"""
    for (x, y), (a, b) in zip(CLEAN, ((0.7, -0.2), (-1.0, 0.5)), strict=True):
        equal(line(x, y), [a, b], "slope and offset", 0.05)


@check("line", points=2)
def finds_it_among_wrong_ones(line):
    """it finds it with three in ten points wrong, anywhere or all at one end"""
    for (x, y), (a, b) in DIRTY:
        equal(line(x, y), [a, b], "slope and offset", 0.05)


@mistake("line", "least squares believe every point: the far ones most")
def of_least_squares(x, y):
    return solutions.weighted(x, y, np.ones(len(x)))


@mistake(
    "line",
    "absolute values pull less than squares, but all far points at one end still turn the line",
)
def of_absolute_values(x, y):
    n = len(x)
    A = np.column_stack([x, np.ones(n)])
    found = linprog(
        np.r_[0, 0, np.ones(n)],
        A_ub=np.block([[A, -np.eye(n)], [-A, -np.eye(n)]]),
        b_ub=np.r_[y, -y],
        bounds=[(None, None)] * 2 + [(0, None)] * n,
    )
    return found.x[:2]


@mistake(
    "line",
    "this begins at the line of least squares, which is so far off that the kernel forgives the wrong points: begin elsewhere, or with a larger sigma",
)
def begun_at_least_squares(x, y):
    found = of_least_squares_line(x, y)
    for _ in range(50):
        s = ((y - found[0] * x - found[1]) / 0.1) ** 2
        found = solutions.weighted(x, y, 1 / (1 + s) ** 2)
    return found


def of_least_squares_line(x, y):
    return solutions.weighted(x, y, np.ones(len(x)))


@mistake("line", "offset and slope have changed places: the slope comes first")
def the_other_way_round(x, y):
    return solutions.line(x, y)[::-1]


@mistake("line", "a line through two of the points, or through the ends, believes these two")
def through_the_ends(x, y):
    a = (y[-1] - y[0]) / (x[-1] - x[0])
    return np.array([a, y[0] - a * x[0]])


@mistake("line", "a line through the origin has no offset: b is unknown as well")
def through_the_origin(x, y):
    return np.array([np.median(y[x > 0] / x[x > 0]), 0.0])
