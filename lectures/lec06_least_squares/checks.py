"""Checks of lecture 6, and the mistakes that they tell apart."""

import numpy as np

from workbench.course import check, equal, holds, mistake
from workbench.lectures.lec06_least_squares import solutions
from workbench.lectures.lec06_least_squares.solutions import HAND, LOWER, UPPER

ANGLES = [
    np.array(x) for x in ([0.0, 0.0, 0.0], [0.9, 0.7, 0.3], [-0.4, 1.3, -0.5], [2.0, -0.6, 0.8])
]
SEEN = np.array([0.11, 0.29, -0.05, 0.43, -0.2, 0.5])


# residual


@check("residual", points=1)
def is_zero_at_the_truth(residual):
    """it is zero where the model agrees with what was seen"""
    for x in ANGLES:
        seen = solutions.residual(x, np.zeros(6))
        equal(residual(x, seen), np.zeros(6), f"the residual at the truth, x = {x}", 1e-12)


@check("residual", points=1)
def is_model_minus_seen(residual):
    """it is the model minus what was seen"""
    stretched = [UPPER, 0, UPPER + LOWER, 0, UPPER + LOWER + HAND, 0]
    equal(residual(np.zeros(3), np.zeros(6)), stretched, "the stretched arm, nothing seen")
    for x in ANGLES:
        equal(residual(x, SEEN), solutions.residual(x, SEEN), f"the residual for x = {x}")


@mistake(
    "residual", "this is what was seen minus the model: the sign of everything that follows changes"
)
def seen_minus_model(x, seen):
    return -solutions.residual(x, seen)


def placed(angles, start_over=False):
    """Elbow, wrist and tip of bones that point along these angles, (6,) m."""
    bones = np.array([UPPER, LOWER, HAND]) * [np.cos(angles), np.sin(angles)]
    return (bones if start_over else np.cumsum(bones, axis=1)).T.ravel()


@mistake("residual", "b is the angle at the elbow: the forearm points along a + b, not along b")
def without_the_upper_arms_angle(x, seen):
    return placed(x) - seen


@mistake("residual", "the hand points along a + b + c: the elbow's angle turns it too")
def with_a_hand_along_c_alone(x, seen):
    return placed([x[0], x[0] + x[1], x[2]]) - seen


@mistake("residual", "the hand points along a + b + c: the shoulder's angle turns it too")
def with_a_hand_along_b_and_c(x, seen):
    return placed([x[0], x[0] + x[1], x[1] + x[2]]) - seen


@mistake("residual", "each bone starts where the bone before it ends, not at the shoulder")
def without_the_elbow(x, seen):
    return placed(np.cumsum(x), start_over=True) - seen


# jacobian


@check("jacobian", points=1)
def leaves_the_elbow_to_the_shoulder(jacobian):
    """an angle moves only the points that come after it"""
    for x in ANGLES:
        J = jacobian(x)
        equal(J[:2, 1:], np.zeros((2, 2)), f"the elbow by b and c, for x = {x}")
        equal(J[2:4, 2], [0, 0], f"the wrist by c, for x = {x}")
        equal(J[:2, 0], solutions.jacobian(x)[:2, 0], f"the elbow by a, for x = {x}")


@check("jacobian", points=2)
def is_what_differences_say(jacobian):
    """it agrees with difference quotients"""
    for x in ANGLES:
        expected = solutions.numeric_jacobian(lambda y: solutions.residual(y, SEEN), x)
        equal(jacobian(x), expected, f"the Jacobian for x = {x}", 1e-8)


@mistake(
    "jacobian",
    "the angle a turns the forearm too: the derivative of the wrist by a contains both bones",
)
def forearm_left_behind(x):
    J = solutions.jacobian(x)
    J[2:4, 0] = J[4:, 0] = J[:2, 0]
    J[4:, 1] = J[2:4, 1]
    return J


@mistake("jacobian", "every angle moves the hand: the rows of the tip contain all three bones")
def hand_left_behind(x):
    J = solutions.jacobian(x)
    J[4:, :2] = J[2:4, :2]
    return J


@mistake("jacobian", "the derivative of cos is minus sin")
def with_the_sign_of_sin(x):
    J = solutions.jacobian(x)
    J[::2] *= -1
    return J


@mistake("jacobian", "the columns are in another order: the first is the derivative by a")
def columns_swapped(x):
    return solutions.jacobian(x)[:, ::-1]


TRANSPOSED = "this is the transpose: a row belongs to a residual, a column to an unknown"


@mistake("jacobian", TRANSPOSED)
def jacobian_transposed(x):
    return solutions.jacobian(x).T


# gradient


@check("gradient", points=1)
def is_the_slope_of_f(gradient):
    """it is what a difference quotient of F says"""
    for x in ANGLES[1:]:
        e, J = solutions.residual(x, SEEN), solutions.jacobian(x)

        def F(y):
            return np.atleast_1d(np.sum(solutions.residual(y, SEEN) ** 2))

        equal(
            gradient(e, J), solutions.numeric_jacobian(F, x)[0], f"the gradient for x = {x}", 1e-8
        )


@mistake(
    "gradient",
    "the factor 2 is missing: the derivative of e^2 is 2 e e'. Body Models II (Pons-Moll and "
    "Swoboda, 2018) omits it as well; without the 2, "
    "this is the gradient of F / 2",
)
def without_the_two(e, J):
    return J.T @ e


@mistake("gradient", "this points downhill; the gradient points uphill")
def downhill(e, J):
    return -2 * J.T @ e


@mistake("gradient", "the mean is not the sum: F is not divided by the number of residuals")
def of_the_mean(e, J):
    return 2 * J.T @ e / len(e)


# numeric_jacobian


def wavy(x):
    return np.array([np.sin(x[0] * x[1]), x[0] ** 2 - x[2], np.exp(0.3 * x[2]), x[1] ** 3])


def wavy_jacobian(x):
    c = np.cos(x[0] * x[1])
    return np.array(
        [
            [c * x[1], c * x[0], 0],
            [2 * x[0], 0, -1],
            [0, 0, 0.3 * np.exp(0.3 * x[2])],
            [0, 3 * x[1] ** 2, 0],
        ]
    )


@check("numeric_jacobian", points=1)
def has_its_shape_and_sign(numeric_jacobian):
    """it is right to 1e-4, and a row belongs to a residual"""
    for x in (np.array([0.4, -1.1, 0.9]), np.array([1.0, 0.5, -0.3])):
        equal(numeric_jacobian(wavy, x), wavy_jacobian(x), f"the Jacobian at x = {x}", 1e-4)


def bent(x):
    """Near its lowest point: differences from both sides are exact there, from one they are not."""
    return np.array([x[0] ** 2 + x[0] * x[1], x[1] ** 2, x[2] ** 2 - x[0] * x[2], x[1] * x[2]])


def bent_jacobian(x):
    return np.array(
        [
            [2 * x[0] + x[1], x[0], 0],
            [0, 2 * x[1], 0],
            [-x[2], 0, 2 * x[2] - x[0]],
            [0, x[2], x[1]],
        ]
    )


@check("numeric_jacobian", points=1)
def is_good_to_eight_digits(numeric_jacobian):
    """it is right to 1e-8"""
    x = np.array([0.004, -0.003, 0.002])
    equal(numeric_jacobian(bent, x), bent_jacobian(x), f"the Jacobian of a parabola at {x}", 1e-8)
    for x in (np.array([0.4, -1.1, 0.9]), np.array([1.0, 0.5, -0.3])):
        equal(numeric_jacobian(wavy, x), wavy_jacobian(x), f"the Jacobian at x = {x}", 1e-8)


def from_one_side(h):
    def answer(f, x):
        return np.column_stack([(f(x + h * one) - f(x)) / h for one in np.eye(len(x))])

    return answer


def from_both_sides(h):
    def answer(f, x):
        ways = [(f(x + h * one) - f(x - h * one)) / (2 * h) for one in np.eye(len(x))]
        return np.column_stack(ways)

    return answer


one_sided = mistake(
    "numeric_jacobian",
    "one-sided differences are off by h times the curvature: take f(x + h) - f(x - h), over 2 h",
)
one_sided_by_1e4, one_sided_by_1e5 = one_sided(from_one_side(1e-4)), one_sided(from_one_side(1e-5))
one_sided_by_1e6, one_sided_by_1e7 = one_sided(from_one_side(1e-6)), one_sided(from_one_side(1e-7))
one_sided_by_1e8, one_sided_by_root = (
    one_sided(from_one_side(1e-8)),
    one_sided(from_one_side(np.sqrt(np.finfo(float).eps))),
)

too_long = mistake(
    "numeric_jacobian",
    "this h is too large: the error of central differences grows with h^2. Try 1e-5",
)
too_long_by_1e2, too_long_by_1e3 = too_long(from_both_sides(1e-2)), too_long(from_both_sides(1e-3))


@mistake("numeric_jacobian", TRANSPOSED)
def numeric_jacobian_transposed(f, x):
    return solutions.numeric_jacobian(f, x).T


@mistake("numeric_jacobian", "the two points are at a distance of 2 h: divide by 2 h")
def over_h(f, x):
    return 2 * solutions.numeric_jacobian(f, x)


@mistake(
    "numeric_jacobian",
    "this h is too small: f(x + h) and f(x - h) agree in most digits, and rounding errors are divided "
    "by h",
)
def with_too_short_a_step(f, x):
    return from_both_sides(1e-11)(f, x)


@mistake(
    "numeric_jacobian",
    "the sign is wrong: subtract f(x - h) from f(x + h), not the other way round",
)
def with_the_other_sign(f, x):
    return -solutions.numeric_jacobian(f, x)


# gauss_newton_step

RNG = np.random.default_rng(6)
LINEAR = [(RNG.standard_normal(7), RNG.standard_normal((7, 3))) for _ in range(3)]


@check("gauss_newton_step", points=1)
def is_least(gauss_newton_step):
    """no other step has a smaller |e + J p|"""
    for e, J in LINEAR:
        p = gauss_newton_step(e, J)
        equal(J.T @ (e + J @ p), np.zeros(3), "J'(e + J p), the gradient of the linear model")


@check("gauss_newton_step", points=1)
def does_not_square_the_condition(gauss_newton_step):
    """it finds an exact solution if there is one, even if columns are nearly dependent"""
    J = LINEAR[0][1].copy()
    J[:, 2] = J[:, 0] + 1e-6 * J[:, 2]
    p = np.array([1.0, -2.0, 0.5])
    equal(gauss_newton_step(-J @ p, J), p, "p, of a residual that is -J p exactly", 1e-7)


@mistake("gauss_newton_step", "this goes uphill: the normal equations have -J'e on the right")
def uphill(e, J):
    return -solutions.gauss_newton_step(e, J)


@mistake("gauss_newton_step", "this is a step of steepest descent: J'J is missing")
def steepest(e, J):
    return -J.T @ e


@mistake("gauss_newton_step", "the factor 2 belongs to both sides of the equations, or to none")
def twice_as_long(e, J):
    return 2 * solutions.gauss_newton_step(e, J)


@mistake(
    "gauss_newton_step",
    "the condition number of J'J is the square of that of J, so twice as many digits are lost: solve "
    "the least-squares problem itself (np.linalg.lstsq, or QR)",
)
def by_the_normal_equations(e, J):
    return np.linalg.solve(J.T @ J, -J.T @ e)


# left_out


@check("left_out", points=1)
def is_the_law_at_the_best_angle(left_out):
    """at the best angle it is rho / UPPER - 1"""
    for share in (1.5, 0.5, 1.0, 2.5):
        seen = share * UPPER * np.array([np.cos(0.7), np.sin(0.7)])
        equal(
            left_out(np.array([0.7]), seen),
            share - 1,
            f"what is left out over what is kept, for rho = {share} UPPER",
        )


@check("left_out", points=1)
def is_right_elsewhere(left_out):
    """it is right at other angles too"""
    for x in (0.0, 1.0, 2.5):
        x = np.array([x])
        expected = solutions.left_out(x, SEEN[:2])
        equal(left_out(x, SEEN[:2]), expected, f"what is left out over what is kept, at {x}")


@mistake(
    "left_out",
    "the sign is wrong: the second derivative of (cos, sin) is minus (cos, sin), and the number is "
    "negative if the point is nearer than the bone is long",
)
def with_the_other_curvature(x, seen):
    return -solutions.left_out(x, seen)


@mistake(
    "left_out",
    "the sign is missing: the number is negative if the point is nearer than the bone is long",
)
def without_its_sign(x, seen):
    return abs(solutions.left_out(x, seen))


@mistake("left_out", "J'J is the square of the bone's length; this is divided by its length")
def over_the_length(x, seen):
    return solutions.left_out(x, seen) * UPPER


@mistake(
    "left_out",
    "rho / UPPER - 1 holds only at the best angle; elsewhere it depends on the angle between bone and "
    "point",
)
def the_law_everywhere(x, seen):
    return np.linalg.norm(seen) / UPPER - 1


@mistake("left_out", "this is the whole Hessian over J'J; subtract 1 for the part that was kept")
def of_the_whole(x, seen):
    return 1 + solutions.left_out(x, seen)


# fit


def named(name, f, J):
    """A problem whose name is told when an answer to it is not one: `fit(the_arm, ...)`."""
    f.__name__, J.__name__ = name, "its_derivatives"
    return f, J


def decay(y):
    t = np.arange(8) / 2.0
    return named(
        "the_decay",
        lambda x: x[0] * np.exp(-x[1] * t) - y,
        lambda x: np.column_stack([np.exp(-x[1] * t), -x[0] * t * np.exp(-x[1] * t)]),
    )


def valley():
    return named(
        "rosenbrocks_valley",
        lambda x: np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]),
        lambda x: np.array([[-20 * x[0], 10.0], [-1.0, 0.0]]),
    )


def arm():
    """Without our answers, because these functions are handed out: the derivative is that of a
    step along the imaginary axis, exact to all digits.
    """

    def J(x):
        return np.transpose([placed(np.cumsum(x + 1e-30j * one)).imag / 1e-30 for one in np.eye(3)])

    return named("the_arm", lambda x: placed(np.cumsum(x)) - SEEN, J)


def bone(share):
    return named(
        "one_bone",
        lambda x: np.array([np.cos(x[0]) - share, np.sin(x[0])]),
        lambda x: np.array([[-np.sin(x[0])], [np.cos(x[0])]]),
    )


NOISE = np.array([0.02, -0.01, 0.03, -0.02, 0.01, 0.0, -0.02, 0.01])


def ends(fit, f, J, start, what):
    x = fit(f, J, np.array(start))
    slope = np.abs(2 * J(x).T @ f(x)).max()
    holds(
        slope < 1e-6,
        f"the gradient at the end, {what}",
        "below 1e-6 (steepest descent takes too long for this: take Gauss-Newton steps, and "
        "halve those that do not help)",
        f"{slope:.1e}",
    )
    at_start, at_end = np.sum(f(np.array(start)) ** 2), np.sum(f(x) ** 2)
    holds(
        at_end <= at_start,
        f"the sum of squares, {what}",
        f"below the start's {at_start:.4g}",
        f"{at_end:.4g}",
    )


@check("fit", points=1)
def ends_where_it_is_easy(fit):
    """it finds the angles of the arm, and an exponential decay through noisy points"""
    ends(fit, *arm(), [0.5, 0.5, 0.5], "for the arm")
    times = np.arange(8) / 2.0
    ends(fit, *decay(2 * np.exp(-0.8 * times) + NOISE), [1.0, 0.3], "for the decay")


@check("fit", points=2)
def ends_where_full_steps_do_not(fit):
    """it finds the minimum of Rosenbrock's function, and one from which full steps lead away"""
    ends(fit, *valley(), [-1.2, 1.0], "for Rosenbrock's function")
    ends(fit, *bone(2.6), [0.6], "for a bone and a point at 2.6 times its length")


@mistake("fit", "one step is not enough: linearize again at the new point, until J'e is small")
def one_step(f, J, x):
    return x + solutions.gauss_newton_step(f(x), J(x))


def descended(s, n):
    def answer(f, J, x):
        for _ in range(n):
            x = x - s * 2 * J(x).T @ f(x)
        return x

    return answer


descent = mistake(
    "fit",
    "these are steps of steepest descent of a fixed length: short ones creep along valleys, and long "
    "ones diverge to NaN. Take Gauss-Newton steps",
)
descent_short, descent_longer = descent(descended(1e-3, 100)), descent(descended(1e-2, 100))
descent_long, descent_creeping = descent(descended(0.1, 100)), descent(descended(1e-3, 1000))
descent_on_and_on, descent_off = descent(descended(1e-2, 1000)), descent(descended(0.1, 1000))
descent_half, descent_half_on = descent(descended(5e-3, 1000)), descent(descended(0.05, 1000))


@mistake(
    "fit",
    "full steps lead away where the residual is large: halve the step until the sum of squares "
    "falls",
)
def full_steps(f, J, x):
    for _ in range(100):
        x = x + solutions.gauss_newton_step(f(x), J(x))
    return x


@mistake("fit", "this is the start: nothing was done")
def nothing(f, J, x):
    return x
