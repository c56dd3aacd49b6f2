"""Checks of lecture 5, and the mistakes that they tell apart."""

import numpy as np
from scipy.spatial.transform import Rotation

from lectures.lec05_blend_shapes import solutions
from workbench.course import check, equal, holds, mistake

RNG = np.random.default_rng(5)


def turns(n, seed=0, spread=0.8):
    """Rotations (n, 3, 3)."""
    vectors = spread * np.random.default_rng(seed).standard_normal((n, 3))
    return Rotation.from_rotvec(vectors).as_matrix()


# features


@check("features", points=1)
def is_zero_at_rest_and_local(features):
    """it is zero at rest, and one joint changes its own nine alone"""
    rest = np.tile(np.eye(3), (5, 1, 1))
    equal(features(rest), np.zeros(36), "the features at rest")
    for k in (1, 3):
        R = rest.copy()
        R[k] = turns(1)[0]
        f = features(R)
        others = np.delete(np.arange(36), np.arange(9 * (k - 1), 9 * k))
        equal(
            f[others], np.zeros(27), f"the features of all joints but {k}, which alone has turned"
        )
    R = rest.copy()
    R[0] = turns(1)[0]
    equal(features(R), np.zeros(36), "the features when the root alone has turned")


@check("features", points=1)
def goes_row_by_row(features):
    """entry 9 (k - 1) + 3 r + c is row r, column c of joint k"""
    R = turns(5, seed=1)
    f = features(R)
    for k, r, c in ((1, 0, 0), (1, 0, 1), (1, 2, 0), (2, 1, 2), (4, 2, 2)):
        equal(f[9 * (k - 1) + 3 * r + c], R[k, r, c] - (r == c), f"entry of joint {k}, [{r}, {c}]")


@mistake("features", "they are read column by column here; SMPL's files have them row by row")
def column_by_column(R):
    return (R[1:] - np.eye(3)).transpose(0, 2, 1).ravel()


@mistake("features", "I is missing: at rest R_k is I, and the features have to be zero")
def without_the_identity(R):
    return R[1:].ravel()


@mistake("features", "the root is not one of them: turning the whole body changes no skin")
def with_the_root(R):
    return (R - np.eye(3)).ravel()


@mistake("features", "the last joint was left out; it is the root, joint 0, that has no features")
def without_the_last(R):
    return (R[:-1] - np.eye(3)).ravel()


@mistake(
    "features", "the joints have to stay together: nine numbers of joint 1, then those of joint 2"
)
def elements_first(R):
    return (R[1:] - np.eye(3)).reshape(-1, 9).T.ravel()


@mistake("features", "this is I - R_k; it is R_k - I")
def the_other_way_round(R):
    return (np.eye(3) - R[1:]).ravel()


# shares

PLACES = np.array([[0.0, 0.0], [0.9, 0.1], [0.3, 1.1], [-0.8, 0.4]])


@check("shares", points=1)
def sums_to_one(shares):
    """they sum to one, and are as the kernels are to each other"""
    for theta in ([0.1, 0.2], [0.6, 0.6], [-0.4, 0.9]):
        theta = np.array(theta)
        found = shares(theta, PLACES, 0.7)
        equal(found.sum(), 1, f"the sum of the shares at {theta}")
        away = np.sum((theta - PLACES) ** 2, axis=1)
        for i in (1, 2, 3):
            equal(np.log(max(found[i], 1e-300) / max(found[0], 1e-300)), (away[0] - away[i]) / 0.49,
                  f"log of share {i} over share 0 at {theta}, for a width of 0.7")  # fmt: skip


@check("shares", points=1)
def is_the_nearest_far_away(shares):
    """far from all examples the nearest has it all"""
    for theta, nearest in (([80.0, 3.0], 1), ([-60.0, 0.0], 3), ([5.0, 90.0], 2)):
        found = shares(np.array(theta), PLACES, 0.7)
        equal(found, np.eye(4)[nearest], f"the shares at {np.array(theta)}", 1e-6)


@mistake("shares", "the kernels have yet to be divided by their sum. A slide has it so, too")
def not_divided(theta, places, width):
    return np.exp(-np.sum((theta - places) ** 2, axis=1) / width**2)


@mistake(
    "shares",
    "far away all kernels are zero in the computer, and this is 0 / 0: subtract the largest exponent "
    "from all first",
)
def zero_by_zero(theta, places, width):
    K = not_divided.answer(theta, places, width)
    return K / K.sum()


@mistake(
    "shares", "a small number added to the sum hides 0 / 0, and then they no longer sum to one"
)
def with_a_little_added(theta, places, width):
    K = not_divided.answer(theta, places, width)
    return K / (K.sum() + 1e-12)


@mistake("shares", "the distance is not squared")
def of_the_distance(theta, places, width):
    e = -np.linalg.norm(theta - places, axis=1) / width
    return np.exp(e - e.max()) / np.exp(e - e.max()).sum()


@mistake("shares", "there is no 2 below: K falls to 1 / e at one width")
def with_a_bells_two(theta, places, width):
    return solutions.shares(theta, places, np.sqrt(2) * width)


@mistake("shares", "the width is squared, as the distance is")
def with_the_width_not_squared(theta, places, width):
    return solutions.shares(theta, places, np.sqrt(width))


@mistake("shares", "the sign: the kernel has to fall with the distance")
def growing(theta, places, width):
    e = np.sum((theta - places) ** 2, axis=1) / width**2
    return np.exp(e - e.max()) / np.exp(e - e.max()).sum()


# solved_shapes

SHAPES = RNG.standard_normal((4, 6))


@check("solved_shapes", points=1)
def meets_the_examples(solved_shapes):
    """blended with the kernels, they give every example exactly"""
    for width in (0.4, 0.9):
        Q = solved_shapes(PLACES, SHAPES, width)
        for i, place in enumerate(PLACES):
            K = np.exp(-np.sum((place - PLACES) ** 2, axis=1) / width**2)
            equal(K @ Q, SHAPES[i], f"the blend at example {i}, for a width of {width}", 1e-8)


@mistake(
    "solved_shapes", "these are the examples' own shapes: at an example its neighbours add theirs"
)
def as_they_are(places, shapes, width):
    return shapes


@mistake("solved_shapes", "this multiplies by the matrix of the kernels; it has to be solved")
def multiplied(places, shapes, width):
    away = places[:, None] - places
    return np.exp(-np.sum(away**2, axis=2) / width**2) @ shapes


@mistake("solved_shapes", "the kernels are not to be divided by their sum here")
def with_shares(places, shapes, width):
    K = np.array([solutions.shares(place, places, width) for place in places])
    return np.linalg.solve(K, shapes)


@mistake("solved_shapes", "the kernel is that of the lecture, with width^2 and no 2 below")
def with_twos(places, shapes, width):
    return solutions.solved_shapes(places, shapes, np.sqrt(2) * width)


# displacement

WEIGHTS = np.array([[1, 0, 0], [0.6, 0.4, 0], [0.2, 0.5, 0.3], [0.0, 0.1, 0.9]])
REST = RNG.standard_normal((4, 3))
POSED = RNG.standard_normal((4, 3))


@check("displacement", points=2)
def is_taken_there_by_skinning(displacement):
    """skinned, rest + displacement is the posed surface"""
    for seed in (1, 2):
        R = turns(3, seed=seed)
        M = np.einsum("ik,kab->iab", WEIGHTS, R)
        P = displacement(WEIGHTS, R, REST, POSED)
        equal(np.einsum("iab,ib->ia", M, REST + P), POSED, "M (rest + P)")


@mistake(
    "displacement",
    "this is what is missing in the pose; skinning will turn it: take it back to rest",
)
def as_seen(weights, R, rest, posed):
    M = np.einsum("ik,kab->iab", weights, R)
    return posed - np.einsum("iab,ib->ia", M, rest)


@mistake(
    "displacement",
    "a mean of rotations is no rotation: its inverse is not its transpose, which is the mean of the inverses",
)
def transposed(weights, R, rest, posed):
    M = np.einsum("ik,kab->iab", weights, R)
    return np.einsum("iba,ib->ia", M, posed) - rest


@mistake(
    "displacement", "this is the place at rest itself; the displacement is less the rest surface"
)
def the_place(weights, R, rest, posed):
    return solutions.displacement(weights, R, rest, posed) + rest


@mistake("displacement", "the sign: it is the place it should have less the one it has")
def with_the_other_sign(weights, R, rest, posed):
    return -solutions.displacement(weights, R, rest, posed)


# person

LENGTHS = np.array([0.8, 0.3])
TEMPLATE = RNG.standard_normal((5, 3))
DIRECTIONS = np.linalg.qr(RNG.standard_normal((15, 2)))[0].reshape(5, 3, 2) * LENGTHS
REGRESSOR = np.array([[0.5, 0.5, 0, 0, 0], [0, 0.2, 0.3, 0.5, 0], [0, 0, 0, 0.25, 0.75]])


@check("person", points=1)
def has_the_right_surface(person):
    """vertices are as far from the template as c is long"""
    equal(person(TEMPLATE, DIRECTIONS, REGRESSOR, LENGTHS, np.zeros(2))[0], TEMPLATE,
          "the vertices for c = 0")  # fmt: skip
    for c in ([0.8, 0.0], [0.4, -0.5]):
        v, _ = person(TEMPLATE, DIRECTIONS, REGRESSOR, LENGTHS, np.array(c))
        equal(np.linalg.norm(v - TEMPLATE), np.linalg.norm(c), f"|vertices - template| for c = {c}")
        equal(v, solutions.person(TEMPLATE, DIRECTIONS, REGRESSOR, LENGTHS, np.array(c))[0],
              f"the vertices for c = {c}")  # fmt: skip


@check("person", points=1)
def has_its_own_joints(person):
    """joints are the regressor's of this person's own vertices"""
    for c in ([0.8, 0.0], [0.4, -0.5]):
        _, joints = person(TEMPLATE, DIRECTIONS, REGRESSOR, LENGTHS, np.array(c))
        expected = solutions.person(TEMPLATE, DIRECTIONS, REGRESSOR, LENGTHS, np.array(c))[1]
        equal(joints, expected, f"the joints for c = {c}")
        moved = person(TEMPLATE + [0, 2, 0], DIRECTIONS, REGRESSOR, LENGTHS, np.array(c))[1]
        equal(moved, joints + [0, 2, 0], "the joints when everybody is moved by 2 m")


@mistake("person", "c is in metres and betas in standard deviations: beta_m = c_m / |S_m|")
def as_if_betas(template, shapedirs, regressor, lengths, c):
    vertices = template + shapedirs @ c
    return vertices, regressor @ vertices


@mistake("person", "beta_m = c_m / |S_m|: this multiplies by the lengths")
def times_the_lengths(template, shapedirs, regressor, lengths, c):
    return as_if_betas.answer(template, shapedirs, regressor, lengths, c * lengths)


@mistake("person", "a length is divided by once, not squared")
def divided_twice(template, shapedirs, regressor, lengths, c):
    return as_if_betas.answer(template, shapedirs, regressor, lengths, c / lengths**2)


@mistake("person", "these are the mean person's joints; this person's are elsewhere")
def on_the_means_joints(template, shapedirs, regressor, lengths, c):
    vertices = template + shapedirs @ (c / lengths)
    return vertices, regressor @ template


@mistake("person", "the template is missing: the directions are displacements")
def without_the_template(template, shapedirs, regressor, lengths, c):
    vertices = shapedirs @ (c / lengths)
    return vertices, regressor @ vertices


# predict

BONES = RNG.standard_normal((9, 12)) * 0.01
POSES = np.column_stack(
    [RNG.uniform(-1, 1, 40), 0.3 * RNG.standard_normal(40), RNG.uniform(0, 2, 40)]
)
NEW = np.column_stack(
    [RNG.uniform(-1, 1, 15), 0.3 * RNG.standard_normal(15), RNG.uniform(0, 2, 15)]
)


def elements(vectors):
    return (Rotation.from_rotvec(vectors).as_matrix() - np.eye(3)).reshape(-1, 9)


def true_shapes(vectors):
    """Linear in R - I, and a little that is not, (n, 12) m."""
    f = elements(vectors)
    return f @ BONES + 2e-4 * (f[:, :1] ** 2)


@check("predict", points=1)
def is_zero_at_rest(predict):
    """it is zero at rest"""
    found = predict(POSES, true_shapes(POSES), np.zeros((1, 3)))
    equal(found, np.zeros((1, 12)), "the shape at rest, m", 1e-6)


@check("predict", points=1)
def knows_a_full_turn(predict):
    """all vectors of one rotation have one shape"""
    t = np.linalg.norm(NEW, axis=1, keepdims=True)
    found = predict(POSES, true_shapes(POSES), NEW)
    for turn in (-1, 1):
        other = predict(POSES, true_shapes(POSES), NEW * (1 + turn * 2 * np.pi / t))
        equal(other, found, f"the shapes {turn:+d} full turn further, m", 1e-6)


@check("predict", points=2)
def is_near_the_truth(predict):
    """it is off by a tenth at most, in unseen poses"""
    found, true = predict(POSES, true_shapes(POSES), NEW), true_shapes(NEW)
    off = np.sqrt(np.mean((found - true) ** 2) / np.mean(true**2))
    holds(
        off <= 0.1, "rms error over the rms of the shapes, in 15 unseen poses", "at most 0.1", off
    )


@mistake(
    "predict", "linear in theta: a full turn further, or round the other way, it is another shape"
)
def linear_in_theta(poses, shapes, asked):
    return asked @ np.linalg.lstsq(poses, shapes, rcond=None)[0]


@mistake("predict", "this is the nearest example; between examples and at rest it is off")
def the_nearest(poses, shapes, asked):
    away = np.linalg.norm(asked[:, None] - poses, axis=2)
    return shapes[away.argmin(axis=1)]


@mistake(
    "predict", "shares of the examples: distances of vectors do not know that rotations repeat"
)
def by_shares(poses, shapes, asked):
    return np.array([solutions.shares(one, poses, 0.4) for one in asked]) @ shapes


@mistake(
    "predict", "with a constant beside the features, or the mean taken off, it is not zero at rest"
)
def with_a_constant(poses, shapes, asked):
    A = np.column_stack([np.ones(len(poses)), poses])
    return np.column_stack([np.ones(len(asked)), asked]) @ np.linalg.lstsq(A, shapes, rcond=None)[0]


@mistake("predict", "that is the mean of the examples, whatever is asked")
def the_mean(poses, shapes, asked):
    return np.tile(shapes.mean(axis=0), (len(asked), 1))


@mistake("predict", "no blend shape at all is zero at rest, and no more than that")
def nothing(poses, shapes, asked):
    return np.zeros((len(asked), shapes.shape[1]))
