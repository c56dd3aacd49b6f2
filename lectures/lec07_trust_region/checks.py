"""Checks of lecture 7, and the mistakes that they tell apart."""

import numpy as np

from workbench.course import check, equal, holds, mistake
from workbench.lectures.lec07_trust_region import solutions

RNG = np.random.default_rng(7)
LINEAR = [(RNG.standard_normal(6), RNG.standard_normal((6, 3))) for _ in range(3)]
DAMPINGS = (1e-3, 0.3, 20.0)


# damped_step


@check("damped_step", points=1)
def is_least(damped_step):
    """no other step has a smaller |e + J p|^2 + damping |p|^2"""
    for e, J in LINEAR:
        for damping in DAMPINGS:
            p = damped_step(e, J, damping)
            equal(
                J.T @ (e + J @ p) + damping * p,
                np.zeros(3),
                f"half the gradient of that sum, damping {damping}",
            )


@check("damped_step", points=1)
def has_both_limits(damped_step):
    """it becomes Gauss-Newton's step without damping, -J'e / damping with much of it"""
    e, J = LINEAR[0]
    equal(damped_step(e, J, 1e-9), np.linalg.lstsq(J, -e, rcond=None)[0], "damping 1e-9", 1e-6)
    equal(1e9 * damped_step(e, J, 1e9), -J.T @ e, "damping times p, damping 1e9", 1e-6)


@check("damped_step", points=1)
def lives_without_rank(damped_step):
    """it has an answer where two columns are the same"""
    for e, J in LINEAR:
        twice = J[:, [0, 1, 0]]
        p = damped_step(e, twice, 0.5)
        equal(p[0], p[2], "two unknowns that do the same change by the same")
        equal(p, solutions.damped_step(e, twice, 0.5), "p")


@mistake("damped_step", "this goes uphill: -J'e is on the right")
def uphill(e, J, damping):
    return -solutions.damped_step(e, J, damping)


@mistake(
    "damped_step",
    "beside J in a tall matrix stands the root of the damping: the sum squares it again",
)
def with_the_root_forgotten(e, J, damping):
    return solutions.damped_step(e, J, damping**2)


@mistake(
    "damped_step",
    "there is no damping in this: it is Gauss-Newton's step, which lambda must shorten",
)
def without_damping(e, J, damping):
    return np.linalg.lstsq(J, -e, rcond=None)[0]


@mistake(
    "damped_step",
    "this is Marquardt's price, damping |J_i|^2 on the diagonal; |p|^2 has the same price for all",
)
def by_marquardt(e, J, damping):
    A = J.T @ J
    return np.linalg.solve(A + damping * np.diag(np.diag(A)), -J.T @ e)


@mistake(
    "damped_step",
    "shortening Gauss-Newton's step keeps its direction; damping changes each direction by its own "
    "share",
)
def shortened(e, J, damping):
    p = np.linalg.lstsq(J, -e, rcond=None)[0]
    return p / (1 + damping)


# gain


def wavy(x):
    return np.array([np.sin(x[0]) - 0.3, x[1] ** 2 - x[0], 1 + x[0] * x[1]])


def wavy_jacobian(x):
    return np.array([[np.cos(x[0]), 0], [-1, 2 * x[1]], [x[1], x[0]]])


PLACES = [
    (np.array([0.4, -1.1]), np.array([0.1, 0.2])),
    (np.array([1.5, 0.5]), np.array([-0.6, 0.1])),
]


def asked(gain, f, J, x, p):
    return gain(f, f(x), J(x), x, p)


@check("gain", points=1)
def is_one_where_it_is_linear(gain):
    """it is 1 where the model is right, whatever the step"""
    for e, J in LINEAR:
        for p in (np.array([0.1, 0.0, -0.2]), np.array([-1.0, 2.0, 0.5])):
            equal(
                gain(lambda y, e=e, J=J: e + J @ y, e, J, np.zeros(3), p),
                1,
                "the gain of a residual that is linear",
            )


@check("gain", points=1)
def is_right_where_it_is_not(gain):
    """it is right where the residual bends, and below 0 for a step that goes up against the promise"""
    for x, p in PLACES:
        expected = asked(solutions.gain, wavy, wavy_jacobian, x, p)
        equal(asked(gain, wavy, wavy_jacobian, x, p), expected, f"the gain at x = {x}, p = {p}")
    x = np.array([1.5, 0.5])
    p = 4 * solutions.cauchy_point(wavy(x), wavy_jacobian(x)) / 2.2
    equal(
        asked(gain, wavy, wavy_jacobian, x, p),
        asked(solutions.gain, wavy, wavy_jacobian, x, p),
        "the gain of a step that is long",
    )


@mistake("gain", "upside down: what came stands above, what was promised below")
def upside_down(f, e, J, x, p):
    return 1 / solutions.gain(f, e, J, x, p)


@mistake("gain", "a fall is the cost before less the cost after: above and below the same sign")
def with_a_rise(f, e, J, x, p):
    return -solutions.gain(f, e, J, x, p)


@mistake(
    "gain",
    "the promise is that of the slope alone, -(J'e)'p; the model |e + J p|^2 / 2 bends by |J p|^2 / 2",
)
def by_the_slope(f, e, J, x, p):
    after = f(x + p)
    return 0.5 * (e @ e - after @ after) / -(J.T @ e @ p)


@mistake("gain", "one fall is of half the sum of squares, and the other is of the sum itself")
def with_a_lost_half(f, e, J, x, p):
    return 2 * solutions.gain(f, e, J, x, p)


@mistake("gain", "costs are compared, not lengths: square the residuals")
def of_lengths(f, e, J, x, p):
    before, after, linear = (np.linalg.norm(r) for r in (e, f(x + p), e + J @ p))
    return (before - after) / (before - linear)


# cauchy_point


@check("cauchy_point", points=1)
def goes_downhill(cauchy_point):
    """it points straight downhill"""
    for e, J in LINEAR:
        p, g = cauchy_point(e, J), J.T @ e
        equal(p / np.linalg.norm(p), -g / np.linalg.norm(g), "its direction")


@check("cauchy_point", points=1)
def ends_at_the_least(cauchy_point):
    """the model does not fall any further along it"""
    for e, J in LINEAR:
        p = cauchy_point(e, J)
        equal((J @ p) @ (e + J @ p), 0, "p'J'(e + J p), the slope of the model along p")


@mistake("cauchy_point", "this goes uphill")
def cauchy_uphill(e, J):
    return -solutions.cauchy_point(e, J)


@mistake("cauchy_point", "the gradient is a direction; how far the model falls, |J g| has to say")
def the_gradient_itself(e, J):
    return -J.T @ e


@mistake("cauchy_point", "both norms are squared: |g|^2 / |J g|^2")
def without_squares(e, J):
    g = J.T @ e
    return -np.linalg.norm(g) / np.linalg.norm(J @ g) * g


@mistake("cauchy_point", "J is missing below: along g the model bends by |J g|^2, not by |g|^2")
def with_a_sign_for_each(e, J):
    return -np.sign(J.T @ e)


@mistake("cauchy_point", "this is the Gauss-Newton step: it is not along the gradient")
def gauss_newton_instead(e, J):
    return np.linalg.lstsq(J, -e, rcond=None)[0]


# dogleg_step

NEWTON, CAUCHY = np.array([2.0, -1.0, 0.5]), np.array([0.4, -0.5, 0.2])
LEGS = [
    (NEWTON, CAUCHY),
    (np.array([1.0, 3.0]), np.array([0.9, 0.1])),
    (np.array([-1.0, 0.2]), np.array([-0.3, 0.3])),
]


@check("dogleg_step", points=1)
def stays_inside(dogleg_step):
    """it is as long as the radius, and Gauss-Newton's step where that is inside"""
    for newton, cauchy in LEGS:
        for share in (0.1, 0.6, 0.95):
            radius = share * np.linalg.norm(newton)
            equal(np.linalg.norm(dogleg_step(newton, cauchy, radius)), radius, "its length")
        equal(
            dogleg_step(newton, cauchy, 1.5 * np.linalg.norm(newton)),
            newton,
            "the step of a large radius",
        )


@check("dogleg_step", points=2)
def is_on_the_path(dogleg_step):
    """it is on the first leg for a small radius, and on the second for a larger one"""
    for newton, cauchy in LEGS:
        short, long = np.linalg.norm(cauchy), np.linalg.norm(newton)
        equal(dogleg_step(newton, cauchy, 0.5 * short), 0.5 * cauchy, "half of the first leg")
        p = dogleg_step(newton, cauchy, 0.5 * (short + long))
        leg, way = newton - cauchy, p - cauchy
        share = way @ leg / (leg @ leg)
        equal(way - share * leg, np.zeros(len(leg)), "how far it is off the second leg")
        holds(0 <= share <= 1, "its share of the second leg", "between 0 and 1", share)


@mistake(
    "dogleg_step", "this shortens Gauss-Newton's step; a shorter step should turn to the gradient"
)
def cut_short(newton, cauchy, radius):
    return newton * min(1, radius / np.linalg.norm(newton))


@mistake("dogleg_step", "the ball is missing: beyond the radius the model is not believed")
def without_a_ball(newton, cauchy, radius):
    return newton


@mistake("dogleg_step", "this never leaves the first leg: beyond the Cauchy point the path turns")
def along_the_gradient(newton, cauchy, radius):
    if np.linalg.norm(newton) <= radius:
        return newton
    return cauchy * radius / np.linalg.norm(cauchy)


@mistake(
    "dogleg_step",
    "the second leg starts from the Cauchy point and ends at Gauss-Newton's: its direction is their "
    "difference",
)
def with_a_leg_from_the_origin(newton, cauchy, radius):
    if np.linalg.norm(newton) <= radius:
        return newton
    if np.linalg.norm(cauchy) >= radius:
        return cauchy * radius / np.linalg.norm(cauchy)
    a, b, c = newton @ newton, cauchy @ newton, cauchy @ cauchy - radius**2
    return cauchy + newton * (-b + np.sqrt(b * b - a * c)) / a


@mistake(
    "dogleg_step",
    "lengths do not add up along a bent path: solve |cauchy + share leg| = radius, a quadratic "
    "equation",
)
def with_lengths_added(newton, cauchy, radius):
    short, long = np.linalg.norm(cauchy), np.linalg.norm(newton)
    if long <= radius:
        return newton
    if short >= radius:
        return cauchy * radius / short
    return cauchy + (newton - cauchy) * (radius - short) / (long - short)


@mistake("dogleg_step", "of the two roots this is the other one, which goes back beyond the ball")
def with_the_other_root(newton, cauchy, radius):
    if np.linalg.norm(newton) <= radius:
        return newton
    if np.linalg.norm(cauchy) >= radius:
        return cauchy * radius / np.linalg.norm(cauchy)
    leg = newton - cauchy
    a, b, c = leg @ leg, cauchy @ leg, cauchy @ cauchy - radius**2
    return cauchy + leg * (-b - np.sqrt(b * b - a * c)) / a


# damping_for


@check("damping_for", points=1)
def makes_the_step_that_long(damping_for):
    """the step with this damping is as long as the radius"""
    for e, J in LINEAR:
        whole = np.linalg.norm(np.linalg.lstsq(J, -e, rcond=None)[0])
        for share in (0.03, 0.5, 0.99):
            damping = damping_for(e, J, share * whole)
            holds(damping > 0, f"the damping for {share} of the longest step", "above 0", damping)
            equal(
                np.linalg.norm(solutions.damped_step(e, J, damping)) / whole,
                share,
                "the length of the step, over Gauss-Newton's",
                1e-6,
            )


@check("damping_for", points=1)
def is_zero_inside(damping_for):
    """it is 0 where Gauss-Newton's step is inside, and right where the columns are of all sizes"""
    e, J = LINEAR[1]
    whole = np.linalg.norm(np.linalg.lstsq(J, -e, rcond=None)[0])
    equal(damping_for(e, J, 1.7 * whole), 0, "the damping for a radius that is large enough")
    steep = J * [1.0, 10.0, 100.0]
    whole = np.linalg.norm(np.linalg.lstsq(steep, -e, rcond=None)[0])
    for share in (0.1, 0.9):
        right = solutions.damping_for(e, steep, share * whole)
        equal(
            damping_for(e, steep, share * whole) / right, 1, "the damping over the right one", 1e-6
        )


@mistake("damping_for", "|J'e| / damping is the length for much damping only; this is an estimate")
def for_much_damping(e, J, radius):
    whole = np.linalg.norm(np.linalg.lstsq(J, -e, rcond=None)[0])
    return np.linalg.norm(J.T @ e) / radius if whole > radius else 0.0


@mistake("damping_for", "damping and radius go opposite ways: a small ball takes much damping")
def the_radius_itself(e, J, radius):
    return radius


@mistake("damping_for", "the answer is the damping, not its root")
def the_root(e, J, radius):
    return np.sqrt(solutions.damping_for(e, J, radius))


# fit


def arm(reach):
    """The arm of the lecture, and a point at that share of its length."""
    seen = reach * 0.55 * np.array([np.cos(0.7), np.sin(0.7)])

    def f(x):
        a, b = x[0], x[0] + x[1]
        return (
            np.array([0.3 * np.cos(a) + 0.25 * np.cos(b), 0.3 * np.sin(a) + 0.25 * np.sin(b)])
            - seen
        )

    def J(x):
        a, b = x[0], x[0] + x[1]
        by_b = 0.25 * np.array([-np.sin(b), np.cos(b)])
        return np.column_stack([0.3 * np.array([-np.sin(a), np.cos(a)]) + by_b, by_b])

    return f, J


def valley():
    return (
        lambda x: np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]),
        lambda x: np.array([[-20 * x[0], 10.0], [-1.0, 0.0]]),
    )


def ends(fit, problem, start, what):
    f, J = problem
    x = fit(f, J, np.array(start))
    slope = np.abs(J(x).T @ f(x)).max()
    holds(slope < 1e-6, f"the gradient at the end, {what}", "below 1e-6", f"{slope:.1e}")
    before, after = np.sum(f(np.array(start)) ** 2), np.sum(f(x) ** 2)
    holds(after <= before, f"the sum of squares, {what}", f"not above {before:.4g}", f"{after:.4g}")


@check("fit", points=1)
def ends_where_halving_does(fit):
    """it ends for a point in reach, and in Rosenbrock's valley"""
    ends(fit, arm(0.7), [0.2, 0.3], "for a point in reach")
    ends(fit, valley(), [-1.2, 1.0], "in Rosenbrock's valley")


@check("fit", points=2)
def ends_beyond_reach(fit):
    """it ends for points that the arm cannot reach"""
    ends(fit, arm(1.3), [0.2, 0.3], "for a point at 1.3 times the arm's length")
    ends(fit, arm(2.0), [-0.8, 1.5], "for a point at twice the arm's length")


@mistake("fit", "one step is not the end of it: linearize again where it led to")
def one_step(f, J, x):
    return x + solutions.damped_step(f(x), J(x), 1e-3)


@mistake(
    "fit",
    "halving keeps the direction, which is useless where J is nearly singular: damp instead, or turn "
    "to the gradient",
)
def halving(f, J, x):
    for _ in range(60):
        e, here = f(x), J(x)
        p, length = np.linalg.lstsq(here, -e, rcond=None)[0], 1.0
        while length > 0.1 and np.sum(f(x + length * p) ** 2) > e @ e:
            length /= 2
        x = x + length * p
    return x


@mistake(
    "fit",
    "these are full steps of Gauss-Newton: ask what a step gains before you take it",
)
def full_steps(f, J, x):
    for _ in range(60):
        x = x + np.linalg.lstsq(J(x), -f(x), rcond=None)[0]
    return x


@mistake(
    "fit",
    "with the same damping throughout it creeps: lower it where the gain is good, raise it where not",
)
def with_constant_damping(f, J, x):
    for _ in range(250):
        x = x + solutions.damped_step(f(x), J(x), 100.0)
    return x
