"""Checks of lecture 11, and the mistakes that they tell apart."""

import numpy as np

from workbench.course import check, equal, holds, mistake
from workbench.lectures.lec11_solvers import solutions

INF = np.inf
TIMES = np.array(
    [
        [10.0, 20, 40],
        [INF, 300, 100],
        [7, 7, 14],
        [50, INF, INF],
        [INF, INF, INF],
        [90, 30, 45],
    ]
)
ALPHAS = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 100.0])


# target


@check("target", points=1)
def is_the_start_or_the_best(target):
    """tau = 1 is the start, tau = 0 the best"""
    for start, best in ((10.0, 2.0), (0.5, 0.0), (3.0, -4.0)):
        equal(target(start, best, 1.0), start, f"the target for tau = 1, from {start} to {best}")
        equal(target(start, best, 0.0), best, f"the target for tau = 0, from {start} to {best}")


@check("target", points=1)
def goes_along_with_the_zero(target):
    """a constant added to all costs is added to the target"""
    for tau in (0.1, 1e-3):
        for start, best in ((10.0, 2.0), (0.5, 0.0), (1e3, 40.0)):
            gone = target(start + 7, best + 7, tau) - target(start, best, tau)
            equal(gone, 7, "by how much the target moves when all costs rise by 7")
            equal(target(start, best, tau), best + tau * (start - best), "the target")


@mistake("target", "the share is of the way from the start to the best, not of the start's cost")
def of_the_start(start, best, tau):
    return best + tau * start


@mistake(
    "target", "best times 1 + tau is no target where the best cost is 0, and forgets the start"
)
def above_the_best(start, best, tau):
    return best * (1 + tau)


@mistake("target", "tau is the share of the way that is left, not the share that is done")
def of_the_way_done(start, best, tau):
    return start - tau * (start - best)


# effort_until

COSTS = np.array([9.0, 4.0, 1.0, 2.0, 0.5, 0.5])
EFFORTS = np.array([1.0, 5.0, 8.0, 20.0, 21.0, 40.0])


@check("effort_until", points=1)
def is_the_first(effort_until):
    """it is the effort at the first point that is low enough"""
    for goal, expected in ((9.5, 1), (4.0, 5), (3.0, 8), (1.5, 8), (0.7, 21)):
        equal(effort_until(COSTS, EFFORTS, goal), expected, f"the effort until {goal}")


@check("effort_until", points=1)
def is_infinite_if_never(effort_until):
    """a run that never gets there needed infinitely much"""
    for goal in (0.4, -1.0):
        came = effort_until(COSTS, EFFORTS, goal)
        holds(came == INF, f"the effort until {goal}, which is never met", "inf", came)
    equal(effort_until(COSTS[:4], EFFORTS[:4], 1.0), 8, "the effort until 1, which is met exactly")


@mistake(
    "effort_until", "this is the whole effort; the run may have been there long before its end"
)
def of_the_whole_run(costs, efforts, goal):
    return efforts[-1] if costs.min() <= goal else INF


@mistake(
    "effort_until",
    "a run that never gets there has infinite effort; otherwise it pays to give up early",
)
def as_if_met(costs, efforts, goal):
    below = np.flatnonzero(costs <= goal)
    return efforts[below[0]] if len(below) else efforts[-1]


@mistake("effort_until", "this is the last point above the goal; a run may rise again")
def after_the_last_above(costs, efforts, goal):
    above = np.flatnonzero(costs > goal)
    k = above[-1] + 1 if len(above) else 0
    return efforts[k] if k < len(costs) else INF


@mistake("effort_until", "to be at the goal is to have met it: at most, not below")
def strictly_below(costs, efforts, goal):
    below = np.flatnonzero(costs < goal)
    return efforts[below[0]] if len(below) else INF


# ratios


def as_told(came, expected, what):
    finite = np.isfinite(expected)
    holds(
        (np.isfinite(came) == finite).all(),
        what + ": infinite where a solver failed",
        expected,
        came,
    )
    equal(np.where(finite, came, 0), np.where(finite, expected, 0), what + ", infinite ones as 0")


@check("ratios", points=1)
def is_one_for_the_best(ratios):
    """the best of each problem has 1, all others more"""
    for times in (TIMES[:4], TIMES[[0, 2, 5]], TIMES[[0, 2, 5]] * 3.0):
        as_told(ratios(times), solutions.ratios(times), "the ratios")


@check("ratios", points=1)
def has_problems_that_nobody_solves(ratios):
    """where all fail, all are infinite"""
    as_told(ratios(TIMES), solutions.ratios(TIMES), "the ratios")


@mistake("ratios", "the least is that of the problem, over solvers: a row, not a column")
def by_solver(times):
    return solutions.ratios(times.T).T


@mistake("ratios", "this is the least of all problems; each problem has its own")
def over_the_least_of_all(times):
    return times / times.min()


@mistake("ratios", "upside down: the slower a solver, the larger its ratio")
def upside_down(times):
    with np.errstate(invalid="ignore"):
        return np.where(np.isfinite(times), 1 / solutions.ratios(times), INF)


@mistake("ratios", "where nobody arrives nobody is the best: infinity over infinity is not 1 there")
def with_ties_of_failures(times):
    return np.where(np.isfinite(times).any(axis=1, keepdims=True), solutions.ratios(times), 1.0)


# profile


@check("profile", points=1)
def begins_with_the_quickest(profile):
    """at alpha = 1 it is how often a solver is the quickest, ties for both"""
    equal(profile(TIMES, ALPHAS[:1]), [[3 / 6, 2 / 6, 1 / 6]], "the profiles at 1")
    equal(profile(TIMES[:4], ALPHAS[:1]), [[3 / 4, 1 / 4, 1 / 4]], "the profiles at 1")


@check("profile", points=1)
def ends_with_the_surest(profile):
    """far to the right it is how often a solver arrives, of all problems"""
    equal(profile(TIMES, np.array([1e9])), [[4 / 6, 4 / 6, 4 / 6]], "the profiles at 1e9")
    equal(profile(TIMES[:4], np.array([1e9])), [[3 / 4, 3 / 4, 3 / 4]], "the profiles at 1e9")


@check("profile", points=1)
def is_right_between(profile):
    """it is right between, and never falls"""
    came = profile(TIMES, ALPHAS)
    holds((np.diff(came, axis=0) >= 0).all(), "a profile never falls as alpha grows", "", came)
    equal(came, solutions.profile(TIMES, ALPHAS), "the profiles")


@mistake(
    "profile",
    "the share is of all problems: one that a solver fails on, or that all do, counts against it",
)
def of_the_solved(times, alphas):
    r = solutions.ratios(times)
    return np.array([(r <= a).sum(axis=0) / np.isfinite(r).sum(axis=0) for a in alphas])


@mistake("profile", "a ratio of alpha is within alpha: at most, not below")
def strictly(times, alphas):
    r = solutions.ratios(times)
    return np.array([np.mean(r < a, axis=0) for a in alphas])


@mistake("profile", "this is the share of problems that took longer; a profile counts the others")
def of_the_longer(times, alphas):
    return 1 - solutions.profile(times, alphas)


@mistake("profile", "alpha is a factor on the best of each problem; this takes it for an effort")
def by_effort(times, alphas):
    return np.array([np.mean(times <= a, axis=0) for a in alphas])


# wilson


@check("wilson", points=1)
def is_within_zero_and_one(wilson):
    """it lies within 0 and 1 and is no point, also where all or none succeed"""
    for k, n in ((0, 10), (10, 10), (1, 3), (16, 16)):
        low, high = wilson(k, n)
        holds(
            -1e-12 <= low < high - 0.05 and high <= 1 + 1e-12,
            f"{k} of {n}",
            "0 <= low < high <= 1, and not next to each other",
            (low, high),
        )
        equal(wilson(n - k, n), (1 - high, 1 - low), f"the interval of failures, for {k} of {n}")


@check("wilson", points=1)
def has_known_values(wilson):
    """it has the values of Wilson's formula, and becomes narrow"""
    for k, n in ((7, 10), (3, 40), (12, 16)):
        equal(wilson(k, n), solutions.wilson(k, n), f"the interval of {k} of {n}", 1e-4)
    low, high = wilson(5000, 10_000)
    equal((high - low) / 2, 0.0098, "half its length for 5000 of 10000", 1e-4)


@mistake(
    "wilson",
    "this is p plus and minus z standard errors: with no successes, or with nothing else, it is a "
    "point, and near these it reaches below 0 or above 1",
)
def by_the_standard_error(successes, trials):
    p = successes / trials
    half = 1.96 * np.sqrt(p * (1 - p) / trials)
    return p - half, p + half


@mistake("wilson", "the division by 1 + z^2 / n is missing")
def not_divided(successes, trials):
    low, high = solutions.wilson(successes, trials)
    return low * (1 + 1.96**2 / trials), high * (1 + 1.96**2 / trials)


@mistake("wilson", "the middle is not p, but p + z^2 / (2 n), divided by 1 + z^2 / n")
def about_the_share(successes, trials):
    low, high = solutions.wilson(successes, trials)
    p = successes / trials
    return p - (high - low) / 2, p + (high - low) / 2


@mistake("wilson", "low comes first, then high")
def high_first(successes, trials):
    return solutions.wilson(successes, trials)[::-1]


# turned_round


@check("turned_round", points=3)
def turns_the_order(turned_round):
    """A leads B among three, and B leads A without C"""
    times = turned_round()
    fair = np.isfinite(times).all() and (times > 0).all()
    holds(fair, "all efforts are finite and above 0", "", times)
    holds(
        all(len(set(row)) == 3 for row in times),
        "no two efforts on one problem are equal",
        "",
        times,
    )
    a, b, c = np.bincount(times.argmin(axis=1), minlength=3)
    holds(
        a > b,
        "how often A, B and C are the quickest, among three",
        "A more often than B",
        f"{a}, {b} and {c}",
    )
    a, b = np.bincount(times[:, :2].argmin(axis=1), minlength=2)
    holds(
        b > a,
        "how often A and B are the quickest, without C",
        "B more often than A",
        f"{a} and {b}",
    )


@mistake(
    "turned_round", "A is always ahead of B here: C's leaving must give B more than it gives A"
)
def always_ahead():
    return np.array([[1.0, 2, 3]] * 3 + [[2.0, 3, 1]] * 2)


@mistake(
    "turned_round",
    "without C the order is right; among three B leads too. C has to take problems from B, on which B "
    "is second",
)
def never_ahead():
    return np.array([[2.0, 1, 3]] * 3 + [[1.0, 2, 3]] * 2)


@mistake(
    "turned_round", "ties hide who is the quickest: no two efforts on one problem may be equal"
)
def with_ties():
    return np.array([[1.0, 2, 3], [1, 2, 3], [3, 1, 1], [3, 1, 1], [2, 1, 3]])


@mistake("turned_round", "the columns are A, B, C: here A and B have changed places")
def with_columns_swapped():
    return solutions.turned_round()[:, [1, 0, 2]]
