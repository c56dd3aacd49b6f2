"""Checks of lecture 1, and the mistakes that they tell apart."""

import numpy as np

from workbench.course import check, equal, holds, mistake
from workbench.lectures.lec01_function import solutions

RNG = np.random.default_rng(1)
CUBIC = np.array([2.0, -1.0, 0.5, 3.0])


# polynomial


@check("polynomial", points=1)
def is_the_sum_of_powers(polynomial):
    """it is w0 + w1 x + w2 x^2 + w3 x^3"""
    for x in (0.0, 1.0, -2.0, 0.3):
        expected = 2.0 - x + 0.5 * x**2 + 3.0 * x**3
        equal(polynomial(CUBIC, x), expected, f"w = {CUBIC}, x = {x}")
    equal(polynomial(np.array([4.0]), 7.0), 4, "a constant, w = [4]")


@mistake("polynomial", "the highest power comes last: w[0] is the constant")
def highest_first(w, x):
    return np.polyval(w, x)


@mistake(
    "polynomial",
    "every coefficient is used once; Body Models II (Pons-Moll and "
    "Swoboda, 2018) has w1 with x^3 as well as with x",
)
def as_in_body_models_ii(w, x):
    return sum(w[min(k, len(w) - 1)] * x**k for k in range(3)) + (w[1] * x**3 if len(w) > 3 else 0)


@mistake("polynomial", "the powers begin with x^0 = 1, and not with x")
def one_power_too_many(w, x):
    return x * solutions.polynomial(w, x)


# linear_fit

X = RNG.standard_normal((20, 3))
A, b = RNG.standard_normal((2, 3)), np.array([5.0, -4.0])


@check("linear_fit", points=1)
def finds_the_map_again(linear_fit):
    """if the examples come from such a map, it finds that map"""
    found, constant = linear_fit(X, X @ A.T + b)
    equal(found, A, "A")
    equal(constant, b, "b")


@check("linear_fit", points=1)
def is_nearest(linear_fit):
    """with noise, the errors are orthogonal to a constant and to x"""
    v = X @ A.T + b + 0.3 * np.sin(7 * X[:, :2])
    found, constant = linear_fit(X, v)
    errors = v - X @ found.T - constant
    equal(errors.sum(axis=0), [0, 0], "the sum of the errors", 1e-7)
    equal(errors.T @ X, np.zeros((2, 3)), "the errors times x", 1e-7)


@mistake("linear_fit", "without a constant, x = 0 is always taken to 0: add a column of ones")
def through_zero(x, v):
    return np.linalg.lstsq(x, v, rcond=None)[0].T, np.zeros(v.shape[1])


@mistake("linear_fit", "A is transposed: what is v = A x for columns is v = x A' for rows")
def transposed(x, v):
    found, constant = solutions.linear_fit(x, v)
    return found.T, constant


@mistake(
    "linear_fit",
    "b is not the mean of v: the mean of x is taken to the mean of v, but x = 0 is taken to b",
)
def with_the_mean_for_b(x, v):
    return solutions.linear_fit(x, v)[0], v.mean(axis=0)


# shortening


@check("shortening", points=1)
def is_that_of_the_mean(shortening):
    """it is the length of the mean of two unit vectors that are alpha apart"""
    for alpha in (0.0, 0.5, np.pi / 2, 2.0, np.pi):
        ends = np.array([[np.cos(a), np.sin(a)] for a in (0, alpha)])
        expected = np.linalg.norm(ends.mean(axis=0))
        equal(shortening(alpha), expected, f"the share of the length for alpha = {alpha:.3f}")


@mistake("shortening", "halfway through the turn the angle is half as large: cos(alpha / 2)")
def by_the_whole_angle(alpha):
    return np.cos(alpha)


@mistake(
    "shortening",
    "this is half of the distance between the two ends; the length is the distance from the joint",
)
def half_of_the_chord(alpha):
    return np.sin(alpha / 2)


@mistake(
    "shortening", "the length is not linear in the angle: for small angles hardly anything is lost"
)
def in_a_line(alpha):
    return 1 - alpha / np.pi


# parameter_count


@check("parameter_count", points=1)
def is_that_of_smpl(parameter_count):
    """SMPL's arrays hold 4,836,780 numbers"""
    found = parameter_count(6890, 24, 10)
    for name, n in solutions.parameter_count(6890, 24, 10).items():
        equal(found[name], n, f"the numbers of {name}")
    equal(sum(found.values()), 4_836_780, "the numbers of all")


@check("parameter_count", points=1)
def is_that_of_others(parameter_count):
    """it is right for bodies of other sizes, such as a hand"""
    for size in ((778, 16, 10), (4, 2, 1)):
        found = parameter_count(*size)
        for name, n in solutions.parameter_count(*size).items():
            equal(found[name], n, f"the numbers of {name} for N, K, B = {size}")


@mistake(
    "parameter_count", "the root is left out of the pose's features: 9 (K - 1) of them, not 9 K"
)
def with_the_root(N, K, B):
    return solutions.parameter_count(N, K, B) | {"posedirs": 3 * N * 9 * K}


@mistake(
    "parameter_count",
    "posedirs move every coordinate: the factor 3 is missing, as in Body "
    "Models II (Pons-Moll and Swoboda, 2018)",
)
def without_coordinates(N, K, B):
    return solutions.parameter_count(N, K, B) | {"posedirs": N * 9 * (K - 1)}


@mistake(
    "parameter_count",
    "the regressor has one weight for a vertex and a joint, not one for each pair of coordinates",
)
def with_a_free_regressor(N, K, B):
    return solutions.parameter_count(N, K, B) | {"J_regressor": 3 * N * 3 * (K - 1)}


@mistake("parameter_count", "a weight is one number for a vertex and a joint, not three")
def with_three_to_a_weight(N, K, B):
    return solutions.parameter_count(N, K, B) | {"weights": 3 * N * K}


# is_linear

M = RNG.standard_normal((4, 3))
LINEAR = {
    "x -> M x": lambda x: M @ x,
    "x -> M x + 1": lambda x: M @ x + 1,
    "a constant": lambda x: np.ones(2),
}
CURVED = {
    "x -> x0 x1": lambda x: np.array([x[0] * x[1]]),
    "x -> |x|": lambda x: np.array([np.sqrt(x @ x + 1e-300)]),
    "x -> cos x0": lambda x: np.cos(x[:1]),
    "x -> x^3 - x": lambda x: x**3 - x,
}


@check("is_linear", points=1)
def says_yes(is_linear):
    """it says yes to linear functions, with a constant or without"""
    for name, f in LINEAR.items():
        equal(is_linear(f, 3), True, name)


@check("is_linear", points=2)
def says_no(is_linear):
    """it says no to all others"""
    for name, f in CURVED.items():
        equal(is_linear(f, 3), False, name)


@mistake("is_linear", "a constant is allowed: f(0) has to be taken off before anything is compared")
def without_the_constant(f, n):
    x, y = np.random.default_rng(0).standard_normal((2, n))
    return bool(np.allclose(f(x + y), f(x) + f(y)))


@mistake(
    "is_linear",
    "f(2 x) = 2 f(x) holds for |x| as well; linear means f(x + y) = f(x) + f(y) for any x and y",
)
def by_doubling(f, n):
    x = np.random.default_rng(0).standard_normal(n)
    return bool(np.allclose(f(2 * x) - f(0 * x), 2 * (f(x) - f(0 * x))))


@mistake(
    "is_linear",
    "points on the axes are not enough: x0 x1 is zero on all of them. Take random points",
)
def on_the_axes(f, n):
    at_zero = f(np.zeros(n))
    return all(np.allclose(f(3 * e) - at_zero, 3 * (f(e) - at_zero)) for e in np.eye(n))


@mistake(
    "is_linear",
    "the function x^3 - x is zero at +1, 0 and -1 and is not linear: take random points",
)
def at_three_points(f, n):
    at_zero = f(np.zeros(n))
    return all(
        np.allclose(f(e + g) - at_zero, f(e) + f(g) - 2 * at_zero)
        for e in np.eye(n)
        for g in -np.eye(n)
    )


@mistake("is_linear", "rounding makes the last digit differ: compare with a tolerance, not by ==")
def to_the_last_digit(f, n):
    x, y = np.random.default_rng(0).standard_normal((2, n))
    at_zero = f(np.zeros(n))
    return bool(np.array_equal(f(0.3 * x + y) - at_zero, 0.3 * (f(x) - at_zero) + f(y) - at_zero))


# predict

ANGLES = RNG.uniform([-1.0, 0.1], [1.5, 2.2], size=(40, 2))
ELSEWHERE = RNG.uniform(-3, 3, size=(20, 2))


def hand(x, upper=0.31, lower=0.27):
    a, b = np.asarray(x).T
    return np.column_stack(
        [
            0.2 + upper * np.cos(a) + lower * np.cos(a + b),
            1.4 + upper * np.sin(a) + lower * np.sin(a + b),
        ]
    )


def off(predict, new, **lengths):
    found = predict(ANGLES, hand(ANGLES, **lengths), new)
    return 1e3 * np.linalg.norm(found - hand(new, **lengths), axis=1).max()


@check("predict", points=1)
def is_right_among_the_examples(predict):
    """to within 1 mm between the examples"""
    between = (ANGLES[:20] + ANGLES[20:]) / 2
    found = off(predict, between)
    holds(
        found < 1,
        "the largest error, new angles between the given ones",
        "below 1 mm",
        f"{found:.3g} mm",
    )


@check("predict", points=2)
def is_right_everywhere(predict):
    """to within 1 mm everywhere, and also two turns further"""
    for name, new in (("elsewhere", ELSEWHERE), ("two turns further", ANGLES + 4 * np.pi)):
        found = off(predict, new, upper=0.28, lower=0.24)
        holds(found < 1, f"the largest error, {name}", "below 1 mm", f"{found:.3g} mm")


@mistake(
    "predict", "the position of the hand is not linear in the angles: take their cosines and sines"
)
def linear_in_the_angles(x, v, new):
    A, b = solutions.linear_fit(x, v)
    return new @ A.T + b


@mistake(
    "predict",
    "polynomials of the angles do not come back after a full turn, and they change the bones' lengths",
)
def cubic(x, v, new):
    def features(angles):
        a, b = angles.T
        return np.column_stack([a, b, a * a, a * b, b * b, a**3, a * a * b, a * b * b, b**3])

    A, b = solutions.linear_fit(features(x), v)
    return features(new) @ A.T + b


@mistake(
    "predict",
    "the elbow's angle is counted from the upper arm: the forearm points along a + b, so take cosine "
    "and sine of that",
)
def of_each_angle(x, v, new):
    def features(angles):
        return np.column_stack([np.cos(angles), np.sin(angles)])

    A, b = solutions.linear_fit(features(x), v)
    return features(new) @ A.T + b


@mistake("predict", "the shoulder is not at the origin: a constant is missing")
def without_the_shoulder(x, v, new):
    def features(angles):
        a, b = angles.T
        return np.column_stack([np.cos(a), np.sin(a), np.cos(a + b), np.sin(a + b)])

    return features(new) @ np.linalg.lstsq(features(x), v, rcond=None)[0]
