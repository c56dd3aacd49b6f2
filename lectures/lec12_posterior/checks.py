"""Checks of lecture 12, and the mistakes that they tell apart."""

import numpy as np

from workbench.course import check, equal, holds, mistake
from workbench.lectures.lec12_posterior import solutions
from workbench.lectures.lec12_posterior.solutions import LENGTH, PRIOR, SIGMA, D, F

RNG = np.random.default_rng(12)


# log_posterior


@check("log_posterior", points=1)
def is_zero_at_best(log_posterior):
    """it is 0 where nothing is off, and below 0 elsewhere"""
    equal(log_posterior(0.0, F * LENGTH / D), 0, "an arm in the image plane, seen where it is")
    for phi, seen in ((0.5, 43.0), (-0.8, 40.0), (0.0, 51.0)):
        came = log_posterior(phi, seen)
        holds(came < 0, f"the logarithm for phi = {phi}, seen = {seen}", "below 0", came)
        equal(
            came, solutions.log_posterior(phi, seen), f"the logarithm for phi = {phi}, seen {seen}"
        )


@check("log_posterior", points=1)
def counts_in_deviations(log_posterior):
    """a deviation of the detector costs one half, and so does one of the prior"""
    equal(log_posterior(0.0, F * LENGTH / D + 2 * SIGMA), -2, "two deviations of the detector")
    seen = F * LENGTH * np.cos(PRIOR) / (D + LENGTH * np.sin(PRIOR))
    equal(log_posterior(PRIOR, seen), -0.5, "one deviation of the prior, seen where it is")


@mistake("log_posterior", "this is the cost; the posterior is exp(-cost)")
def the_cost(phi, seen):
    return -solutions.log_posterior(phi, seen)


@mistake("log_posterior", "the half is missing: a Gaussian is exp(-r^2 / 2)")
def without_the_half(phi, seen):
    return 2 * solutions.log_posterior(phi, seen)


@mistake("log_posterior", "what was known beforehand is missing")
def without_the_prior(phi, seen):
    return solutions.log_posterior(phi, seen) + 0.5 * (phi / PRIOR) ** 2


@mistake("log_posterior", "residuals are divided by their sigmas before they are squared and added")
def without_sigmas(phi, seen):
    pixel = F * LENGTH * np.cos(phi) / (D + LENGTH * np.sin(phi))
    return -0.5 * (pixel - seen) ** 2 - 0.5 * phi**2


@mistake(
    "log_posterior", "the wrist is at the depth D + l sin(phi); D alone makes both sides alike"
)
def without_perspective(phi, seen):
    return -0.5 * ((F * LENGTH * np.cos(phi) / D - seen) / SIGMA) ** 2 - 0.5 * (phi / PRIOR) ** 2


# deviations

JACOBIANS = [RNG.standard_normal((m, n)) for m, n in ((6, 2), (9, 3), (5, 4))]


@check("deviations", points=1)
def knows_what_one_unknown_does(deviations):
    """of m measurements of one number it is sigma over the root of m"""
    for m, sigma in ((1, 3.0), (4, 2.0), (100, 0.5)):
        equal(
            deviations(np.full((m, 1), 1 / sigma)),
            [sigma / np.sqrt(m)],
            f"the deviation, {m} measurements with sigma = {sigma}",
        )


@check("deviations", points=1)
def leaves_the_others_free(deviations):
    """it grows where other unknowns are free as well"""
    for J in JACOBIANS:
        expected = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
        equal(deviations(J), expected, f"the deviations, {J.shape[1]} unknowns", 1e-7)


@check("deviations", points=1)
def goes_along_with_units(deviations):
    """an unknown in millimetres has a thousand times the deviation"""
    J = JACOBIANS[1]
    unit = np.array([1.0, 1e3, 1.0])
    equal(deviations(J / unit) / deviations(J), unit, "new deviations over old ones", 1e-6)


@mistake("deviations", "those are variances: take the root")
def variances(J):
    return solutions.deviations(J) ** 2


@mistake(
    "deviations",
    "1 over the root of the diagonal of J'J is the deviation if all others are known: invert first, "
    "then take the diagonal",
)
def with_the_others_known(J):
    return 1 / np.linalg.norm(J, axis=0)


@mistake("deviations", "this grows with the data: J'J is the inverse of the covariance")
def not_inverted(J):
    return np.linalg.norm(J, axis=0)


# interval

DRAWS = np.column_stack(
    [RNG.standard_normal(999), RNG.exponential(size=999), RNG.uniform(size=999)]
)


@check("interval", points=1)
def holds_its_share(interval):
    """it holds the share that it says, and as many draws are below as above"""
    for level in (0.5, 0.8, 0.9):
        came = interval(DRAWS, level)
        for (low, high), some in zip(came, DRAWS.T, strict=True):
            share = np.mean((low <= some) & (some <= high))
            holds(
                abs(share - level) < 0.01,
                f"the share of draws in the {level} interval",
                f"{level}",
                f"{share:.3f}",
            )
            below, above = np.mean(some < low), np.mean(some > high)
            holds(abs(below - above) < 0.01, "draws below and above", "as many", (below, above))


@check("interval", points=1)
def goes_along(interval):
    """draws that are shifted and scaled have an interval that is"""
    came = interval(5 * DRAWS + 1, 0.8)
    equal(came, 5 * interval(DRAWS, 0.8) + 1, "the interval of 5 draws + 1", 1e-6)
    equal(came, solutions.interval(5 * DRAWS + 1, 0.8), "the interval", 0.05)


@mistake(
    "interval",
    "this is the mean and so many standard deviations to both sides, which holds the share for a Gaussian "
    "alone; for any draws, find the values below which the right shares of them lie",
)
def of_a_gaussian(draws, level):
    from scipy.stats import norm

    half = norm.ppf((1 + level) / 2) * draws.std(axis=0)
    return np.column_stack([draws.mean(axis=0) - half, draws.mean(axis=0) + half])


@mistake(
    "interval",
    "the interval is too narrow: 1 - level is the share that both ends together leave out, and each end "
    "leaves out half of it",
)
def with_both_tails_whole(draws, level):
    return np.quantile(draws, [1 - level, level], axis=0).T


@mistake(
    "interval",
    "this begins at the lowest draw, so that all that is left out is above: leave out as much below",
)
def from_the_lowest(draws, level):
    return np.quantile(draws, [0, level], axis=0).T


@mistake("interval", "np.percentile takes percents, and np.quantile shares: a tail of 0.05 is 5 %")
def in_percent(draws, level):
    tail = (1 - level) / 2
    return np.percentile(draws, [tail, 1 - tail], axis=0).T


@mistake("interval", "the ends are exchanged: each row is the lower end, and then the upper one")
def upside_down(draws, level):
    return solutions.interval(draws, level)[:, ::-1]


# next_point


def bell(x):
    return -0.5 * np.sum(x**2)


HIGH, LOW = np.array([0.3, -0.2]), np.array([1.5, 1.0])  # log_p differs by 1.56: p by a factor 0.21


@check("next_point", points=1)
def goes_up_always(next_point):
    """it goes up, whatever was drawn"""
    for u in (0.01, 0.1, 0.5, 0.99):
        equal(next_point(bell, LOW, HIGH, u), HIGH, f"a step up, drawn = {u}")


@check("next_point", points=1)
def goes_down_at_times(next_point):
    """it goes down with the probability p(y) / p(x), and stays where it was else"""
    for u, end in ((0.05, LOW), (0.19, LOW), (0.23, HIGH), (0.9, HIGH)):
        equal(next_point(bell, HIGH, LOW, u), end, f"a step to where p is 0.21 times, drawn = {u}")


@mistake(
    "next_point",
    "this never takes a step to a lower density, so that the chain climbs to the top and stays there; such "
    "a step is taken with the probability p(y) / p(x)",
)
def climbing(log_p, x, y, u):
    return y if log_p(y) > log_p(x) else x


@mistake(
    "next_point",
    "every step is taken here, so that the density has no say; where p(y) is lower than p(x), compare the "
    "number that was drawn with their ratio",
)
def taking_all(log_p, x, y, u):
    return y


@mistake(
    "next_point",
    "the ratio is upside down: it is the density at the new point, p(y), over that at the old one",
)
def with_the_ratio_turned(log_p, x, y, u):
    return y if np.log(u) < log_p(x) - log_p(y) else x


@mistake(
    "next_point",
    "log_p answers logarithms, and this divides them; the ratio of the densities is the exponential of "
    "log_p(y) - log_p(x)",
)
def with_a_ratio_of_logarithms(log_p, x, y, u):
    return y if u < log_p(y) / log_p(x) else x


@mistake(
    "next_point",
    "the step is taken here if the number that was drawn is above the ratio; a uniform number is below 0.2 "
    "in a fifth of all cases, so the step has to be taken if it is below",
)
def above_the_ratio(log_p, x, y, u):
    return x if np.log(u) < log_p(y) - log_p(x) else y


# stretch

PAIRS = [
    (np.array([1.0, 2.0]), np.array([-1.0, 0.5]), 1.7),
    (np.array([0.3, -0.4, 0.8, 2.0]), np.array([1.0, 1.0, 0.0, -1.0]), 0.6),
    (np.array([2.0]), np.array([0.5]), 1.3),
]


@check("stretch", points=1)
def stays_on_the_line(stretch):
    """it is on the line through both, z times as far from the other"""
    for x, other, z in PAIRS:
        equal(stretch(x, other, z)[0], other + z * (x - other), f"the proposal for z = {z}")
        equal(stretch(x, other, 1.0)[0], x, "the proposal for z = 1")


@check("stretch", points=1)
def can_be_gone_back(stretch):
    """the way back has the opposite factor, and one dimension has none"""
    for x, other, z in PAIRS:
        y, factor = stretch(x, other, z)
        back, undone = stretch(np.asarray(y), other, 1 / z)
        equal(back, x, "the way back")
        equal(factor + undone, 0, "both factors, added")
        equal(factor, (len(x) - 1) * np.log(z), f"the log factor in {len(x)} dimensions")


@mistake(
    "stretch", "the exponent is k - 1: stretching gives k, and the density of z takes one away"
)
def with_k(x, other, z):
    return other + z * (x - other), len(x) * np.log(z)


@mistake("stretch", "without its factor the move does not leave the posterior as it is")
def without_the_factor(x, other, z):
    return other + z * (x - other), 0.0


@mistake("stretch", "the other walker is the centre, and x moves; here it is the other way round")
def about_itself(x, other, z):
    return x + z * (other - x), (len(x) - 1) * np.log(z)


@mistake("stretch", "the logarithm of the factor is asked for")
def not_its_logarithm(x, other, z):
    return other + z * (x - other), z ** (len(x) - 1)


@mistake("stretch", "z counts from the other walker: at z = 1 nothing moves")
def from_where_it_is(x, other, z):
    return x + z * (x - other), (len(x) - 1) * np.log(z)


# draw


def slanted(x):
    """Deviations 1 and 1, correlation 0.9."""
    return -0.5 * (x[0] ** 2 - 1.8 * x[0] * x[1] + x[1] ** 2) / 0.19


def two_pieces(x):
    """Two bells of deviation 0.5 and 3.2 apart, the left one holding a third."""
    left = -2.0 * ((x[0] + 1.6) ** 2 + x[1] ** 2)
    right = -2.0 * ((x[0] - 1.6) ** 2 + x[1] ** 2)
    return np.logaddexp(left, right + np.log(2))


def narrow(x):
    """Deviations 2 and 0.01, turned by 45 degrees."""
    return -0.25 * ((x[0] + x[1]) / 2.0) ** 2 - 0.25 * ((x[1] - x[0]) / 0.01) ** 2


def bent(x):
    """A standard bell, bent: x_1 - x_0^2 / 4 has the deviation 0.5."""
    return -0.5 * x[0] ** 2 - 2.0 * (x[1] - 0.25 * x[0] ** 2) ** 2


SLANT = np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2)  # along and across, turned by 45 degrees


def has_moments(draw, density, start, mean, sd, what, directions=None):
    """Of 1000 draws, along the directions (2, 2) of the density, or along the axes."""
    came = draw(density, np.array(start), 1000)
    if directions is not None:
        came = came @ np.transpose(directions)
    what = f"draws from {what}{how_they_moved(came, sd)}"
    off = np.abs(came.mean(axis=0) - mean) / sd
    holds((off < 0.25).all(), f"means of {what}", mean, came.mean(axis=0))
    ratio = came.std(axis=0) / sd
    holds((np.abs(ratio - 1) < 0.2).all(), f"deviations of {what}", sd, came.std(axis=0))


def how_they_moved(came, sd):
    """What is wrong with the steps between draws (n, 2), if it can be seen; sd (2,), of the density."""
    steps = np.diff(came, axis=0)
    new = np.any(steps != 0, axis=1)
    if new.mean() < 0.1:
        return (
            f" (of {len(came)} draws only {1 + new.sum()} differ from the one before: most proposals are "
            "refused, so the steps are too long for the width of this density)"
        )
    if (np.sqrt(np.mean(steps**2, axis=0)) < 0.2 * sd).any():
        return (
            " (each draw is close to the one before, by less than a fifth of a standard deviation along one "
            "direction: the steps are too short for the length of this density)"
        )
    return ""


@check("draw", points=1)
def is_right_for_one_piece(draw):
    """means and deviations are right for a slanted, a narrow and a bent bell"""
    has_moments(draw, slanted, [1.0, 1.0], np.zeros(2), np.ones(2), "a slanted bell")
    for side in (1.0, -1.0):  # twice: steps of one size may pass by luck
        has_moments(
            draw,
            lambda x, side=side: narrow(x * [1, side]),
            [1.0, side],
            np.zeros(2),
            np.array([2.0, 0.01]),
            "a bell of 2 by 0.01, along and across",
            SLANT * [1, side],
        )
    has_moments(
        draw,
        bent,
        [0.0, 0.0],
        np.array([0.0, 0.25]),
        np.array([1.0, np.sqrt(0.375)]),
        "a bent bell",
    )


@check("draw", points=2)
def finds_the_second_piece(draw):
    """means and deviations are right for two pieces, from whichever it begins"""
    mean, sd = np.array([1.6 / 3, 0.0]), np.array([np.sqrt(0.25 + 2.56 * 8 / 9), 0.5])
    for start in ([-1.6, 0.0], [1.6, 0.0]):
        has_moments(
            draw,
            two_pieces,
            start,
            mean,
            sd,
            "two pieces, of which one holds twice as many as the other",
        )


@mistake(
    "draw",
    "these are draws from one round bell about the start, whatever the density is: ask log_p where to go",
)
def by_laplace(log_p, start, count):
    return start + 0.5 * np.random.default_rng(0).standard_normal((count, 2))


@mistake(
    "draw",
    "this climbs and stays at the top: a step to a lower density has to be taken at times, with the "
    "probability p(y) / p(x)",
)
def by_climbing(log_p, start, count):
    rng, x, chain = np.random.default_rng(0), np.array(start, dtype=float), []
    for _ in range(count):
        y = x + 0.3 * rng.standard_normal(2)
        x = y if log_p(y) > log_p(x) else x
        chain.append(x)
    return np.array(chain)


@mistake(
    "draw",
    "steps of one size are too long for the width of a density, or too short for its length: let the steps "
    "have its shape, as walkers do that take them from each other",
)
def with_steps_of_one_size(log_p, start, count):
    rng, x, chain = np.random.default_rng(0), np.array(start, dtype=float), []
    for _ in range(4 * count):
        y = x + 1.0 * rng.standard_normal(2)
        x = y if np.log(rng.uniform()) < log_p(y) - log_p(x) else x
        chain.append(x)
    return np.array(chain[3::4])


@mistake(
    "draw",
    "steps this short do not get from one piece to the other, and not far in one of them: longer ones are "
    "needed as well",
)
def with_short_steps(log_p, start, count):
    rng, x, chain = np.random.default_rng(0), np.array(start, dtype=float), []
    for _ in range(count):
        y = x + 0.02 * rng.standard_normal(2)
        x = y if np.log(rng.uniform()) < log_p(y) - log_p(x) else x
        chain.append(x)
    return np.array(chain)


@mistake(
    "draw",
    "where a proposal is refused, the old point counts once more; here only those that were taken count",
)
def without_refused_ones(log_p, start, count):
    rng, x, chain = np.random.default_rng(0), np.array(start, dtype=float), []
    for _ in range(5 * count):
        y = x + 2.5 * rng.standard_normal(2)
        if np.log(rng.uniform()) < log_p(y) - log_p(x):
            x = y
            chain.append(x)
        if len(chain) == count:
            break
    return np.array(chain + [x] * (count - len(chain)))
