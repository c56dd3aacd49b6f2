"""Checks of lecture 5, and the mistakes that they tell apart."""

import numpy as np
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from workbench.course import check, equal, holds, mistake
from workbench.lectures.lec05_blend_shapes import solutions

RNG = np.random.default_rng(5)
EXAMPLES = RNG.uniform(-1, 1, size=(5, 3))
PLACES = RNG.uniform(-1, 1, size=(4, 3))


# shares


@check("shares", points=1)
def sum_to_one(shares):
    """they sum to one, and far from all the nearest example has it all"""
    for x in PLACES:
        equal(np.sum(shares(x, EXAMPLES, 0.7)), 1, "the sum of the shares")
    far = EXAMPLES[2] * 8 / np.linalg.norm(EXAMPLES[2])
    nearest = np.argmin(np.linalg.norm(EXAMPLES - far, axis=1))
    equal(
        shares(far, EXAMPLES, 0.7)[nearest], 1, "the share of the nearest example, 8 rad off", 0.05
    )


@check("shares", points=1)
def fall_as_they_should(shares):
    """they fall with the square of the distance over that of the width"""
    line = np.array([[0.0], [1.0]])
    for x, width in ((0.3, 0.5), (0.3, 2.0), (-1.0, 0.8)):
        s = shares(np.array([x]), line, width)
        equal(
            np.log(s[0] / s[1]),
            ((x - 1) ** 2 - x**2) / width**2,
            f"the logarithm of the ratio of two shares, at {x} between 0 and 1, width {width}",
        )


@mistake(
    "shares",
    "these do not sum to one: divide by the sum of all kernels, as the lecture's formula for lambda does. Without "
    "that, everything fades away far from the examples",
)
def not_divided(x, examples, width):
    return solutions.kernels(x, examples, width)


@mistake("shares", "the width is squared, like the distance")
def width_not_squared(x, examples, width):
    return solutions.shares(x, examples, np.sqrt(width))


@mistake("shares", "the distance is squared: this has a kink at every example")
def distance_not_squared(x, examples, width):
    k = np.exp(-np.linalg.norm(x - examples, axis=1) / width)
    return k / k.sum()


@mistake("shares", "this is divided by the largest and not by the sum")
def over_the_largest(x, examples, width):
    k = solutions.kernels(x, examples, width)
    return k / k.max()


# exact


@check("exact", points=2)
def is_exact(exact):
    """at example i it is one for i and zero for all others"""
    for width in (0.5, 1.0):
        for x, expected in zip(EXAMPLES, np.eye(5), strict=True):
            equal(
                exact(x, EXAMPLES, width),
                expected,
                f"the coefficients at an example, width {width}",
                1e-7,
            )


@check("exact", points=1)
def is_made_of_kernels(exact):
    """elsewhere it is a sum of kernels"""
    for x in PLACES:
        expected = solutions.exact(x, EXAMPLES, 0.8)
        equal(exact(x, EXAMPLES, 0.8), expected, "the coefficients between examples", 1e-7)


@mistake(
    "exact",
    "these are the kernels themselves: at one example those of its neighbours are not zero. Solve for the matrix of kernels between examples",
)
def the_kernels(x, examples, width):
    return solutions.kernels(x, examples, width)


@mistake("exact", "shares sum to one, but at an example its neighbours have a share as well")
def the_shares(x, examples, width):
    return solutions.shares(x, examples, width)


@mistake("exact", "this multiplies with the matrix of kernels; it has to be solved")
def multiplied(x, examples, width):
    return solutions.kernels(examples, examples, width) @ solutions.kernels(x, examples, width)


# features

TURNS = Rotation.from_rotvec(RNG.standard_normal((4, 3))).as_matrix()


@check("features", points=1)
def are_nothing_at_rest(features):
    """nothing at rest, and nothing if the root turns alone"""
    R = np.tile(np.eye(3), (4, 1, 1))
    equal(features(R), np.zeros(27), "the features at rest")
    R[0] = TURNS[0]
    equal(features(R), np.zeros(27), "the features when the root turns")


@check("features", points=1)
def are_in_order(features):
    """entry 9 (k - 1) + 3 r + c is row r, column c of joint k"""
    for k in (1, 2, 3):
        R = np.tile(np.eye(3), (4, 1, 1))
        R[k] = TURNS[k]
        f = features(R)
        for r in range(3):
            for c in range(3):
                equal(
                    f[9 * (k - 1) + 3 * r + c],
                    TURNS[k][r, c] - (r == c),
                    f"entry {9 * (k - 1) + 3 * r + c}, when joint {k} turns",
                )


@mistake(
    "features", "column by column: row by row was asked. Trained shapes go with one order alone"
)
def column_by_column(R):
    return (R[1:] - np.eye(3)).transpose(0, 2, 1).ravel()


@mistake("features", "the identity has to be taken away, or there are blend shapes at rest")
def with_the_identity(R):
    return R[1:].ravel()


@mistake(
    "features", "the root is joint 0, the first; turning the whole body must not change its skin"
)
def without_the_last(R):
    return (R[:-1] - np.eye(3)).ravel()


@mistake(
    "features",
    "this is one joint less the joint before it; each joint is compared with the identity, its rotation at rest",
)
def from_joint_to_joint(R):
    return (R[1:] - R[:-1]).ravel()


# learn

F = RNG.standard_normal((12, 4))
D = RNG.standard_normal((12, 6))


@check("learn", points=1)
def has_no_slope(learn):
    """no other P is cheaper: the slope is zero there"""
    for ridge in (1e-3, 0.5, 20.0):
        P = learn(F, D, ridge)
        equal(
            F.T @ (F @ P - D) + ridge * P, np.zeros((4, 6)), f"half of the gradient, ridge {ridge}"
        )


@check("learn", points=1)
def is_bounded_where_examples_are_few(learn):
    """it has an answer with fewer poses than features, and a higher ridge makes it smaller"""
    sizes = [np.linalg.norm(learn(F[:2], D[:2], ridge)) for ridge in (1e-2, 1.0, 100.0)]
    equal(
        sizes,
        [np.linalg.norm(solutions.learn(F[:2], D[:2], p)) for p in (1e-2, 1.0, 100.0)],
        "the size of P, from two poses, for the ridges 0.01, 1 and 100",
        1e-7,
    )


@mistake(
    "learn",
    "the ridge is missing: this is the P of least |F P - D|^2 alone. Add ridge times the identity to F'F before "
    "you solve",
)
def without_the_ridge(F, D, ridge):
    return np.linalg.lstsq(F, D, rcond=None)[0]


@mistake(
    "learn",
    "the ridge is squared here. It is a factor of |P|^2, and so it stands in F'F + ridge I as it is; rows of "
    "sqrt(ridge) I below F would do the same",
)
def with_the_ridge_squared(F, D, ridge):
    return solutions.learn(F, D, ridge**2)


@mistake(
    "learn",
    "this is the minimum of the *mean* of the squares plus ridge |P|^2; the task sums the squares, so that the "
    "ridge is not multiplied by the number of poses",
)
def of_the_mean(F, D, ridge):
    return solutions.learn(F, D, ridge * len(F))


@mistake(
    "learn",
    "the sign of the ridge: the second term is a penalty on large P, so the ridge is added to F'F",
)
def with_the_other_sign(F, D, ridge):
    return np.linalg.solve(F.T @ F - ridge * np.eye(F.shape[1]), F.T @ D)


# directions

BASIS = np.linalg.qr(RNG.standard_normal((9, 4)))[0]
PEOPLE = RNG.standard_normal((15, 4)) * [3, 2, 1, 0.2] @ BASIS.T + RNG.standard_normal(9)


def betas_of(people, mean, S):
    return np.linalg.lstsq(S, (people - mean).T, rcond=None)[0].T


@check("directions", points=1)
def explain_most(directions):
    """the mean is the mean, and no k directions leave less"""
    for k in (1, 2, 3):
        mean, S = directions(PEOPLE, k)
        equal(mean, PEOPLE.mean(axis=0), "the mean person")
        left = np.linalg.norm(PEOPLE - mean - betas_of(PEOPLE, mean, S) @ S.T)
        least = np.sqrt(
            np.sum(np.linalg.svd(PEOPLE - PEOPLE.mean(axis=0), compute_uv=False)[k:] ** 2)
        )
        equal(left, least, f"what {k} directions leave of all people", 1e-7)


@check("directions", points=1)
def are_in_standard_deviations(directions):
    """betas of the people have variance 1, and are not correlated with each other"""
    mean, S = directions(PEOPLE, 3)
    covariance = np.cov(betas_of(PEOPLE, mean, S).T)
    equal(covariance, np.eye(3), "the covariance of the betas", 1e-7)


@mistake(
    "directions",
    "these columns have the length one, so that betas are in metres: multiply each by the standard deviation of "
    "people along it, s / sqrt(n - 1), and betas are in standard deviations",
)
def of_length_one(people, k):
    mean = people.mean(axis=0)
    return mean, np.linalg.svd(people - mean, full_matrices=False)[2][:k].T


@mistake(
    "directions",
    "the decomposition was made of the people as they are, so that its first direction leads from zero to the "
    "mean person: subtract the mean first",
)
def not_centred(people, k):
    _, s, Vt = np.linalg.svd(people, full_matrices=False)
    return people.mean(axis=0), Vt[:k].T * s[:k] / np.sqrt(len(people) - 1)


@mistake(
    "directions",
    "the columns are too long by the root of n - 1: a singular value is the root of a *sum* of squares over all "
    "people, and a standard deviation that of their mean",
)
def by_the_singular_values(people, k):
    mean, S = solutions.directions(people, k)
    return mean, S * np.sqrt(len(people) - 1)


@mistake("directions", "these are the last directions, in which people differ least")
def the_last_ones(people, k):
    mean = people.mean(axis=0)
    _, s, Vt = np.linalg.svd(people - mean, full_matrices=False)
    return mean, Vt[::-1][:k].T * s[::-1][:k] / np.sqrt(len(people) - 1)


# regressor


def crowd(n, seed):
    """People of 40 vertices around a joint, and the joint itself: a mean of five of them."""
    shared = np.random.default_rng(50)
    template = shared.uniform(-0.1, 0.1, size=(40, 3))
    modes = 0.03 * shared.standard_normal((6, 40, 3))
    true = np.zeros(40)
    true[shared.choice(40, 5, replace=False)] = shared.dirichlet(3 * np.ones(5))
    rng = np.random.default_rng(seed)
    people = template + np.einsum("nb,bvi->nvi", rng.standard_normal((n, 6)), modes)
    people = people + rng.uniform(-1, 1, size=(n, 1, 3)) + 0.005 * rng.standard_normal((n, 40, 3))
    return people, np.einsum("v,nvi->ni", true, people)


KNOWN, JOINTS = crowd(10, 1)
JOINTS = JOINTS + 0.001 * np.random.default_rng(2).standard_normal(JOINTS.shape)
STRANGERS, THEIRS = crowd(20, 3)


@check("regressor", points=1)
def is_a_mean(regressor):
    """weights are not negative, and sum to one"""
    w = regressor(KNOWN, JOINTS)
    holds(w.min() >= -1e-9, "the smallest weight", "not negative", w.min())
    equal(w.sum(), 1, "the sum of the weights", 1e-6)


@check("regressor", points=2)
def finds_joints_of_strangers(regressor):
    """joints of people who were not among them are right to 3 mm"""
    w = regressor(KNOWN, JOINTS)
    off = 1e3 * np.linalg.norm(np.einsum("v,nvi->ni", w, STRANGERS) - THEIRS, axis=1).mean()
    holds(
        off <= 3, "the mean distance from the joints of 20 others", "at most 3 mm", f"{off:.1f} mm"
    )


@mistake(
    "regressor",
    "this is least squares without conditions. There are fewer equations than vertices, so that it meets the noise "
    "exactly, with weights of both signs, and fails for other people; ask for weights that are not negative",
)
def of_least_squares(people, joints):
    A = people.transpose(0, 2, 1).reshape(-1, people.shape[1])
    return np.linalg.lstsq(A, joints.ravel(), rcond=None)[0]


@mistake(
    "regressor",
    "the weights are not negative, but their sum is not one, so that the joint lags behind when a person moves: add "
    "the sum as one more equation, with a large factor",
)
def without_the_sum(people, joints):
    A = people.transpose(0, 2, 1).reshape(-1, people.shape[1])
    return nnls(A, joints.ravel())[0]


@mistake(
    "regressor",
    "these are the weights of least squares, divided by their sum afterwards: the sum is right, but weights of both signs "
    "still meet the noise; ask for weights that are not negative",
)
def of_least_squares_with_the_sum(people, joints):
    w = of_least_squares(people, joints)
    return w / w.sum()


@mistake(
    "regressor",
    "these are equal weights, which give the middle of all vertices and not the joint: solve for the weights with "
    "which the mean is the joint of each of these people",
)
def the_mean_of_all(people, joints):
    return np.full(people.shape[1], 1 / people.shape[1])


@mistake(
    "regressor",
    "this takes the nearest vertex alone, which lies on the skin; a joint lies inside, and is a mean of several "
    "vertices around it",
)
def the_nearest_vertex(people, joints):
    off = np.linalg.norm(people - joints[:, None], axis=2).mean(axis=0)
    return np.eye(len(off))[off.argmin()]


# mixed

SMALL = RNG.standard_normal((12, 3)) * [1.0, 0.5, 0.2] + [0.0, 1.0, 2.0]
LARGE = RNG.standard_normal((28, 3)) * [0.3, 0.9, 0.4] + [2.0, 0.5, 1.0]


def spread(people):
    return people.mean(axis=0), np.cov(people.T, ddof=0)


@check("mixed", points=1)
def is_one_group_at_the_ends(mixed):
    """with all people in one group it is that group, and it does not matter which is the first"""
    first, second = spread(SMALL), spread(LARGE)
    for share, expected in ((1.0, first), (0.0, second)):
        mean, C = mixed(*first, *second, share)
        equal(mean, expected[0], f"the mean, share {share}")
        equal(C, expected[1], f"the covariance, share {share}")
    mean, C = mixed(*first, *second, 0.2)
    other_mean, other_C = mixed(*second, *first, 0.8)
    equal(other_mean, mean, "the mean with the groups exchanged, share 0.8 for 0.2")
    equal(other_C, C, "the covariance with the groups exchanged, share 0.8 for 0.2")


@check("mixed", points=1)
def is_that_of_everybody(mixed):
    """12 people and 28 people are 40 people"""
    mean, C = mixed(*spread(SMALL), *spread(LARGE), 0.3)
    expected_mean, expected = spread(np.vstack([SMALL, LARGE]))
    equal(mean, expected_mean, "the mean of all 40")
    equal(C, expected, "the covariance of all 40")


def pooled(mean_1, C_1, mean_2, C_2, share):
    """The common mean, and the covariance within the groups."""
    return share * mean_1 + (1 - share) * mean_2, share * C_1 + (1 - share) * C_2


@mistake(
    "mixed",
    "the means differ, and that is variance too: what is missing is the difference between the groups",
)
def without_the_difference(mean_1, C_1, mean_2, C_2, share):
    return pooled(mean_1, C_1, mean_2, C_2, share)


@mistake(
    "mixed",
    "one fourth is right for groups of one size alone: the factor is q (1 - q), where q is the share",
)
def always_a_fourth(mean_1, C_1, mean_2, C_2, share):
    mean, C = pooled(mean_1, C_1, mean_2, C_2, share)
    return mean, C + np.outer(mean_2 - mean_1, mean_2 - mean_1) / 4


@mistake("mixed", "the share is that of the first group: this gives it to the second")
def of_the_other_group(mean_1, C_1, mean_2, C_2, share):
    return solutions.mixed(mean_1, C_1, mean_2, C_2, 1 - share)


@mistake("mixed", "the mean of everybody is nearer to the larger group: means are weighted as well")
def with_the_plain_mean(mean_1, C_1, mean_2, C_2, share):
    return (mean_1 + mean_2) / 2, solutions.mixed(mean_1, C_1, mean_2, C_2, share)[1]


@mistake("mixed", "d d' needs its factor: each group is off the common mean by a part of d only")
def with_the_whole_difference(mean_1, C_1, mean_2, C_2, share):
    mean, C = pooled(mean_1, C_1, mean_2, C_2, share)
    return mean, C + np.outer(mean_2 - mean_1, mean_2 - mean_1)
