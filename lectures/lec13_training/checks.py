"""Checks of lecture 13, and the mistakes that they tell apart."""

import numpy as np
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from workbench.course import check, equal, holds, mistake
from workbench.lectures.lec13_training import solutions

RNG = np.random.default_rng(13)


# taught_by


@check("taught_by", points=1)
def is_the_right_way_round(taught_by):
    """each set teaches what it can show"""
    found, right = taught_by(), solutions.taught_by()
    for name in right:
        holds(found[name] == right[name], f"what teaches {name}", right[name], str(found[name]))


@mistake(
    "taught_by",
    "the two are exchanged, as in the notes SMPL and SMPLify: few people cannot show how people "
    "differ, nor one pose how an elbow bulges",
)
def exchanged():
    other = {"multi-pose": "multi-shape", "multi-shape": "multi-pose"}
    return {name: other[found] for name, found in solutions.taught_by().items()}


@mistake(
    "taught_by", "people in one pose do not show what moves their joints: J_regressor needs poses"
)
def regressor_from_shapes():
    return solutions.taught_by() | {"J_regressor": "multi-shape"}


@mistake(
    "taught_by", "a few people do not have the mean of all: the template comes from many people"
)
def template_from_poses():
    return solutions.taught_by() | {"template": "multi-pose"}


@mistake("taught_by", "a few people cannot show how people differ")
def all_from_poses():
    return dict.fromkeys(solutions.taught_by(), "multi-pose")


# unevenness

OPPOSITE = np.array([0, 2, 1, 4, 3, 5])
HALF = RNG.standard_normal((6, 3))
EVEN = HALF + HALF[OPPOSITE] * [-1, 1, 1]


@check("unevenness", points=1)
def is_zero_for_an_even_body(unevenness):
    """it is zero for a body that is alike on both sides"""
    equal(unevenness(EVEN, OPPOSITE), 0, "|T - U(T)|^2 of an even body", 1e-12)


@check("unevenness", points=1)
def counts_what_is_uneven(unevenness):
    """it counts what is not alike"""
    T = EVEN.copy()
    T[1, 1] += 0.3  # one vertex of a pair, up
    equal(unevenness(T, OPPOSITE), 2 * 0.09, "|T - U(T)|^2, one vertex of a pair 0.3 m up")
    T = EVEN + [0.2, 0, 0]  # the whole of it to the side
    equal(unevenness(T, OPPOSITE), 6 * 0.16, "|T - U(T)|^2, all six vertices 0.2 m to the side")


@mistake("unevenness", "a mirror also exchanges left and right vertices; x alone is not enough")
def sign_alone(T, opposite):
    return np.sum((T - T * [-1, 1, 1]) ** 2)


@mistake("unevenness", "the mirror also changes the sign of x; exchanging vertices is not enough")
def exchange_alone(T, opposite):
    return np.sum((T - T[opposite]) ** 2)


@mistake("unevenness", "left and right lie along x: it is x whose sign changes")
def of_z(T, opposite):
    return np.sum((T - T[opposite] * [1, 1, -1]) ** 2)


@mistake("unevenness", "the term is the square of the norm: there is no root")
def with_a_root(T, opposite):
    return np.sqrt(solutions.unevenness(T, opposite))


@mistake("unevenness", "this is the mean; the term is the sum over all coordinates")
def the_mean(T, opposite):
    return solutions.unevenness(T, opposite) / T.size


@mistake("unevenness", "both vertices of a pair are counted, so the sum is not halved")
def halved(T, opposite):
    return solutions.unevenness(T, opposite) / 2


# ridge

FEATURES = RNG.standard_normal((9, 4))
SHAPES = RNG.standard_normal((9, 6))


def slope(P, penalty):
    return (P @ FEATURES.T - SHAPES.T) @ FEATURES + penalty * P


@check("ridge", points=1)
def has_no_slope(ridge):
    """the gradient is zero there"""
    for penalty in (0.2, 3.0):
        P = ridge(FEATURES, SHAPES, penalty)
        equal(slope(P, penalty), np.zeros((6, 4)), f"half the gradient for penalty {penalty}", 1e-9)


@check("ridge", points=1)
def shrinks(ridge):
    """it shrinks as the penalty grows, and works with fewer meshes than features"""
    sizes = [np.linalg.norm(ridge(FEATURES, SHAPES, one)) for one in (0.01, 1.0, 100.0, 1e4)]
    holds(
        np.all(np.diff(sizes) < 0),
        "|P| for penalties 0.01, 1, 100, 10000",
        "falling",
        ", ".join(f"{size:.3g}" for size in sizes),
    )
    few = ridge(FEATURES[:2], SHAPES[:2], 0.5)
    expected = solutions.ridge(FEATURES[:2], SHAPES[:2], 0.5)
    equal(few, expected, "P from two meshes, for penalty 0.5", 1e-8)


@mistake("ridge", "the penalty is missing: this is least squares of the data alone")
def without_the_penalty(F, D, penalty):
    return np.linalg.lstsq(F, D, rcond=None)[0].T


@mistake("ridge", "the penalty has the wrong sign: it is added to F'F")
def rewarded(F, D, penalty):
    return solutions.ridge(F, D, -penalty)


@mistake("ridge", "the penalty stands in the cost as it is; it is not squared")
def squared(F, D, penalty):
    return solutions.ridge(F, D, penalty**2)


@mistake(
    "ridge", "this is the transpose: a row of P belongs to a displacement, a column to a feature"
)
def ridge_transposed(F, D, penalty):
    return solutions.ridge(F, D, penalty).T


@mistake("ridge", "the sum over meshes is no mean: F'F is not divided by their number")
def of_the_mean(F, D, penalty):
    return solutions.ridge(F, D, len(F) * penalty)


@mistake("ridge", "both terms have the same factor 2 in their gradients: it drops out")
def with_half_the_penalty(F, D, penalty):
    return solutions.ridge(F, D, penalty / 2)


@mistake(
    "ridge",
    "adding the penalty to F'F shrinks some directions more than others; this shrinks all alike",
)
def scaled(F, D, penalty):
    return without_the_penalty.answer(F, D, penalty) / (1 + penalty)


# shape_space

PEOPLE = 2 + RNG.standard_normal((14, 3)) @ np.diag([3, 1, 0.2]) @ RNG.standard_normal((3, 8))


@check("shape_space", points=1)
def has_betas_of_variance_one(shape_space):
    """betas have mean zero and variance one, and directions are at right angles"""
    mean, S = shape_space(PEOPLE, 2)
    betas = (PEOPLE - mean) @ np.linalg.pinv(S).T
    equal(betas.mean(axis=0), np.zeros(2), "the mean of the people's betas")
    equal(np.cov(betas.T), np.eye(2), "the covariance of the people's betas (n - 1 below)", 1e-8)
    lengths = np.linalg.norm(S, axis=0)
    equal(S[:, 0] @ S[:, 1] / lengths.prod(), 0, "the cosine between the directions", 1e-8)


@check("shape_space", points=1)
def leaves_least(shape_space):
    """no two directions leave less of the people"""
    for B in (1, 2):
        mean, S = shape_space(PEOPLE, B)
        away = PEOPLE - mean
        left = np.sum((away - away @ S @ np.linalg.pinv(S)) ** 2)
        true, _ = solutions.shape_space(PEOPLE, B)
        s = np.linalg.svd(PEOPLE - true, compute_uv=False)
        equal(left, np.sum(s[B:] ** 2), f"what {B} of the directions leave, m^2", 1e-7)


@mistake(
    "shape_space",
    "the directions have length one: betas are then in metres, not standard deviations",
)
def of_length_one(people, B):
    mean, S = solutions.shape_space(people, B)
    return mean, S / np.linalg.norm(S, axis=0)


@mistake("shape_space", "the singular values have yet to be divided by sqrt(n - 1)")
def not_divided(people, B):
    mean, S = solutions.shape_space(people, B)
    return mean, S * np.sqrt(len(people) - 1)


@mistake("shape_space", "with n in place of n - 1 below, betas vary a little too much")
def over_n(people, B):
    mean, S = solutions.shape_space(people, B)
    return mean, S * np.sqrt((len(people) - 1) / len(people))


@mistake(
    "shape_space", "the mean has to be taken off first: the first direction is the mean otherwise"
)
def without_the_mean(people, B):
    _, s, Vt = np.linalg.svd(people, full_matrices=False)
    return people.mean(axis=0), (Vt[:B] * s[:B, None] / np.sqrt(len(people) - 1)).T


@mistake("shape_space", "these are the last directions: eigh sorts variances from small to large")
def the_last(people, B):
    mean = people.mean(axis=0)
    variances, V = np.linalg.eigh(np.cov(people.T))
    return mean, V[:, :B] * np.sqrt(np.abs(variances[:B]) + 1e-12)


@mistake("shape_space", "these are the variances; a direction is as long as one standard deviation")
def by_variance(people, B):
    mean, S = solutions.shape_space(people, B)
    return mean, S * np.linalg.norm(S, axis=0)


# weights_of


def scene(seed, noise):
    """Where four bones take a vertex in six poses, and where it was seen."""
    rng = np.random.default_rng(seed)
    reached = rng.standard_normal((6, 4, 3))
    w = np.array([[0.7, 0.3, 0, 0], [0.0, 0.25, 0.0, 0.75], [1.0, 0, 0, 0]])[seed % 3]
    return reached, np.einsum("jka,k->ja", reached, w) + noise * rng.standard_normal((6, 3)), w


def left(w, reached, seen):
    return np.sum((np.einsum("jka,k->ja", reached, w) - seen) ** 2)


@check("weights_of", points=1)
def are_shares(weights_of):
    """no weight is below zero, and they sum to one"""
    for seed in range(6):
        reached, seen, _ = scene(seed, 1.2)
        w = weights_of(reached, seen)
        holds(w.min() >= -1e-6, f"the least weight, in scene {seed}", "not below 0", w.min())
        equal(w.sum(), 1, f"the sum of the weights, in scene {seed}", 1e-4)


@check("weights_of", points=1)
def finds_the_true_ones(weights_of):
    """without noise it finds the true weights"""
    for seed in range(3):
        reached, seen, w = scene(seed, 0.0)
        equal(weights_of(reached, seen), w, f"the weights in scene {seed}, without noise", 1e-3)


@check("weights_of", points=2)
def no_shares_are_better(weights_of):
    """with noise no other shares leave less"""
    for seed in range(6):
        reached, seen, _ = scene(seed, 1.2)
        found = left(weights_of(reached, seen), reached, seen)
        best = left(solutions.weights_of(reached, seen), reached, seen)
        equal(found, best, f"the sum of squares, in scene {seed}", 1e-4)


def free_weights(reached, seen):
    A = reached.transpose(0, 2, 1).reshape(-1, reached.shape[1])
    return np.linalg.lstsq(A, seen.ravel(), rcond=None)[0]


@mistake("weights_of", "least squares alone: weights come out below zero, and do not sum to one")
def free(reached, seen):
    return free_weights(reached, seen)


@mistake(
    "weights_of",
    "what was below zero was cut and the rest scaled: that has the right form, and is not "
    "the least",
)
def cut_and_scaled(reached, seen):
    w = free_weights(reached, seen).clip(0)
    return w / w.sum()


@mistake(
    "weights_of",
    "non-negative least squares, scaled afterwards, is not least with sum one: the sum has "
    "to be in the problem",
)
def scaled_afterwards(reached, seen):
    A = reached.transpose(0, 2, 1).reshape(-1, reached.shape[1])
    w, _ = nnls(A, seen.ravel())
    return w / w.sum()


@mistake("weights_of", "the sum is right, and some weights are below zero")
def with_the_sum_alone(reached, seen):
    A = reached.transpose(0, 2, 1).reshape(-1, reached.shape[1])
    K = A.shape[1]
    system = np.block([[A.T @ A, np.ones((K, 1))], [np.ones((1, K)), np.zeros((1, 1))]])
    return np.linalg.solve(system, np.append(A.T @ seen.ravel(), 1.0))[:K]


A_ROW = mistake(
    "weights_of",
    "a row of ones finds the best shares only if the target is zero: first subtract `seen` from where "
    "each bone takes the vertex, and divide by the sum at the end",
)


@A_ROW
def with_a_row_of_ones(reached, seen):
    A = reached.transpose(0, 2, 1).reshape(-1, reached.shape[1])
    w, _ = nnls(np.vstack([A, np.ones(A.shape[1])]), np.append(seen.ravel(), 1.0))
    return w


@A_ROW
def with_a_row_of_ones_and_scaled(reached, seen):
    w = with_a_row_of_ones.answer(reached, seen)
    return w / w.sum()


@mistake("weights_of", "this is the one bone that comes nearest; blending has several")
def the_nearest(reached, seen):
    away = np.sum((reached - seen[:, None]) ** 2, axis=(0, 2))
    return np.eye(reached.shape[1])[away.argmin()]


@mistake("weights_of", "shares by distance are not what least squares asks for")
def by_distance(reached, seen):
    w = 1 / (1e-9 + np.sum((reached - seen[:, None]) ** 2, axis=(0, 2)))
    return w / w.sum()


# rest_shape


def seen_often(noise, turn, n=6, seed=0):
    rng = np.random.default_rng(seed)
    T = rng.standard_normal((7, 3)) * [1.0, 0.5, 0.3]
    R = Rotation.from_rotvec(turn * rng.standard_normal((n, 3))).as_matrix()
    V = T @ R.transpose(0, 2, 1) + rng.standard_normal((n, 1, 3))
    return T, V + noise * rng.standard_normal(V.shape)


def distance(T, V):
    """Sum of squares after the best rigid motion of one onto the other."""
    centred = T - T.mean(axis=0)
    return np.sum((solutions.aligned(centred, V) - centred) ** 2)


@check("rest_shape", points=1)
def is_the_true_shape(rest_shape):
    """without noise it is the true shape, but for a rigid motion"""
    for turn in (0.4, 2.0):
        T, V = seen_often(0.0, turn)
        gap = np.sqrt(distance(rest_shape(V), T))
        holds(
            gap < 1e-5,
            "distance to the true shape after the best rigid motion",
            "below 1e-5 m (turn each mesh back onto T before the mean, by R', and not further away by R)",
            f"{gap:.2g} m",
        )


@check("rest_shape", points=2)
def leaves_least_of_all(rest_shape):
    """with noise no shape leaves less"""
    for seed in (1, 2):
        _, V = seen_often(0.25, 1.0, seed=seed)
        found, best = (
            sum(distance(T, one) for one in V) for T in (rest_shape(V), solutions.rest_shape(V))
        )
        what = f"the sum of squares, in scene {seed} (take turns until nothing changes)"
        equal(found, min(found, best), what, 1e-6)


@mistake(
    "rest_shape", "the mean of meshes that are turned differently shrinks: turn them back first"
)
def the_plain_mean(meshes):
    return meshes.mean(axis=0)


@mistake("rest_shape", "moved mean onto mean, they are still turned: the mean of them shrinks")
def the_centred_mean(meshes):
    return (meshes - meshes.mean(axis=1, keepdims=True)).mean(axis=0)


@mistake("rest_shape", "that is one of the meshes, with all of its noise")
def the_first(meshes):
    return meshes[0]


@mistake(
    "rest_shape",
    "one round is not enough: align all meshes to the mean that came out, and repeat until it stays",
)
def one_round(meshes):
    return np.mean([solutions.aligned(meshes[0], V) for V in meshes], axis=0)


@mistake("rest_shape", "R is transposed: it turns meshes further away instead of back")
def turned_away(meshes):
    T = meshes[0] - meshes[0].mean(axis=0)
    found = []
    for V in meshes:
        b = V - V.mean(axis=0)
        U, _, Vt = np.linalg.svd(T.T @ b)
        found.append(b @ (U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt))
    return np.mean(found, axis=0)
