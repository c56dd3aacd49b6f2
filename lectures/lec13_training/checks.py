"""Checks of lecture 13, and the mistakes that they tell apart."""

import numpy as np
from scipy.spatial.transform import Rotation

from lectures.lec13_training import solutions
from workbench.course import check, equal, holds, mistake

RNG = np.random.default_rng(13)
A, B = Rotation.random(2, rng=RNG).as_matrix()
SHARE = RNG.uniform(0.1, 0.9, 8)[:, None, None]
BLENDS = SHARE * A + (1 - SHARE) * B  # (8, 3, 3)
MOVES = 0.3 * RNG.standard_normal((8, 3))
REST = 0.5 * RNG.standard_normal((8, 3))
POSED = np.einsum("nab,nb->na", BLENDS, REST) + MOVES


# unposed


@check("unposed", points=1)
def goes_back(unposed):
    """skinning takes the answer to what was seen"""
    T = unposed(BLENDS, MOVES, POSED)
    equal(np.einsum("nab,nb->na", BLENDS, T) + MOVES, POSED, "M_i t_i + m_i")
    equal(T, REST, "the rest vertices")


@check("unposed", points=1)
def is_linear(unposed):
    """it is linear in what was seen, and goes along with where the body stands"""
    aside = np.array([1.0, -2.0, 0.5])
    equal(unposed(BLENDS, MOVES + aside, POSED + aside), REST, "the same body 2 m further on")
    twice = unposed(BLENDS, 2 * MOVES, 2 * POSED)
    equal(twice, 2 * REST, "everything twice as large")


@mistake("unposed", "a blend of rotations is no rotation: its transpose is not its inverse")
def by_the_transpose(M, m, V):
    return np.einsum("nba,nb->na", M, V - m)


@mistake("unposed", "the translation m comes off first, then M is undone")
def with_the_translation_last(M, m, V):
    return np.linalg.solve(M, V[..., None])[..., 0] - m


@mistake("unposed", "this poses once more: M has to be undone")
def posed_again(M, m, V):
    return np.einsum("nab,nb->na", M, V) + m


@mistake("unposed", "the translation is still in it")
def without_the_translation(M, m, V):
    return np.linalg.solve(M, V[..., None])[..., 0]


# pose_blend_shapes

LESSONS = [(RNG.standard_normal((n, 5)), RNG.standard_normal((n, 4))) for n in (12, 3)]
PRICES = (1e-3, 0.5, 30.0)


@check("pose_blend_shapes", points=1)
def is_least(pose_blend_shapes):
    """no other P has a smaller sum, with fewer poses than features too"""
    for X, D in LESSONS:
        for price in PRICES:
            P = pose_blend_shapes(X, D, price)
            equal(X.T @ (X @ P - D) + price * P, np.zeros((5, 4)),
                  f"half the gradient of the sum, {len(X)} poses, price {price}")  # fmt: skip


@check("pose_blend_shapes", points=1)
def shrinks(pose_blend_shapes):
    """it shrinks as the price rises: to X'D over the price in the end"""
    for X, D in LESSONS:
        sizes = [np.linalg.norm(pose_blend_shapes(X, D, price)) for price in PRICES]
        holds(sizes[0] > sizes[1] > sizes[2], "|P| for rising prices", "falling", sizes)
        equal(
            1e9 * pose_blend_shapes(X, D, 1e9), X.T @ D, "price times P, for a price of 1e9", 1e-6
        )


@mistake("pose_blend_shapes", "there is no price in this: with few poses it learns the noise")
def for_nothing(X, D, price):
    return np.linalg.lstsq(X, D, rcond=None)[0]


@mistake("pose_blend_shapes", "the price stands beside X'X once, not squared")
def with_the_price_squared(X, D, price):
    return solutions.pose_blend_shapes(X, D, price**2)


@mistake(
    "pose_blend_shapes",
    "the features that were seen much are paid for like the others: the price times I, not times the "
    "diagonal of X'X",
)
def with_marquardts_price(X, D, price):
    A = X.T @ X
    return np.linalg.solve(A + price * np.diag(np.diag(A)), X.T @ D)


@mistake("pose_blend_shapes", "the sign: P adds what skinning gets wrong")
def taken_away(X, D, price):
    return -solutions.pose_blend_shapes(X, D, price)


# taught_by


@check("taught_by", points=1)
def poses_teach_poses(taught_by):
    """what has to do with pose is taught by many poses"""
    came = taught_by()
    for key in "PWJ":
        holds(came[key] == "multi-pose", f"who teaches {key}", "multi-pose", came[key])


@check("taught_by", points=1)
def people_teach_shape(taught_by):
    """what has to do with people is taught by many people"""
    came = taught_by()
    for key in "TS":
        holds(came[key] == "multi-shape", f"who teaches {key}", "multi-shape", came[key])


@mistake(
    "taught_by",
    "one of the sources prints this, and has it the wrong way round: in one pose the features have "
    "rank 1, whoever stands there",
)
def the_wrong_way_round():
    right = solutions.taught_by()
    other = {"multi-pose": "multi-shape", "multi-shape": "multi-pose"}
    return {key: other[value] for key, value in right.items()}


@mistake("taught_by", "few people show few shape directions, at most one less than they are")
def all_by_poses():
    return dict.fromkeys("PWJTS", "multi-pose")


@mistake(
    "taught_by", "one pose shows one combination of pose blend shapes, and no joint that moves"
)
def all_by_people():
    return dict.fromkeys("PWJTS", "multi-shape")


# shape_directions

PEOPLE = 1.7 + RNG.standard_normal((9, 12)) * np.linspace(0.01, 0.1, 12)


@check("shape_directions", points=1)
def makes_up_the_covariance(shape_directions):
    """all of them together make up the covariance"""
    S = shape_directions(PEOPLE, 8)
    equal(S.T @ S, np.cov(PEOPLE.T), "the sum of s s' over all directions s", 1e-9)


@check("shape_directions", points=1)
def are_the_main_ones(shape_directions):
    """they are at right angles, the longest first, and as long as a deviation"""
    for k in (1, 3):
        S = shape_directions(PEOPLE, k)
        right = np.linalg.norm(solutions.shape_directions(PEOPLE, k), axis=1)
        equal(S @ S.T, np.diag(right**2), "products of directions with each other", 1e-9)
        along = (PEOPLE - PEOPLE.mean(axis=0)) @ S[0] / np.linalg.norm(S[0])
        equal(np.linalg.norm(S[0]), along.std(ddof=1), "the length of the first", 1e-9)


@mistake(
    "shape_directions", "the mean has to be taken off: the first direction is where everybody is"
)
def about_zero(people, k):
    _, s, Vt = np.linalg.svd(people, full_matrices=False)
    return s[:k, None] * Vt[:k] / np.sqrt(len(people) - 1)


@mistake("shape_directions", "these have length 1: a beta of 1 is to be one standard deviation")
def of_length_one(people, k):
    return np.linalg.svd(people - people.mean(axis=0), full_matrices=False)[2][:k]


@mistake("shape_directions", "these are as long as a variance; take a standard deviation")
def as_long_as_a_variance(people, k):
    _, s, Vt = np.linalg.svd(people - people.mean(axis=0), full_matrices=False)
    return s[:k, None] ** 2 * Vt[:k] / (len(people) - 1)


@mistake("shape_directions", "singular values grow with the number of people: over sqrt(P - 1)")
def of_all_people_together(people, k):
    return np.sqrt(len(people) - 1) * solutions.shape_directions(people, k)


# joint_shares


def crowd(S, seed, inside=True):
    """People (S, 20, 3) m, and a joint of each: a mean of some of their vertices, with noise."""
    rng = np.random.default_rng(seed)
    base = 0.1 * rng.standard_normal((20, 3)) + [0.4, 1.2, 0.0]
    V = base + 0.03 * rng.standard_normal((S, 20, 3))
    w = np.zeros(20)
    w[[2, 5, 11, 17]] = [0.4, 0.3, 0.2, 0.1]
    joints = np.einsum("n,sna->sa", w, V)
    return V, joints + (0.002 * rng.standard_normal((S, 3)) if inside else [0.0, 0.6, 0.0])


CROWDS = [crowd(12, 0), crowd(3, 1), crowd(6, 2, inside=False)]


@check("joint_shares", points=1)
def are_shares(joint_shares):
    """none is below 0, and they sum to 1"""
    for V, joints in CROWDS:
        w = joint_shares(V, joints)
        holds(w.min() > -1e-9, "the smallest share", "0 or more", w.min())
        equal(w.sum(), 1, "the sum of the shares", 1e-6)


@check("joint_shares", points=2)
def give_the_joints(joint_shares):
    """no other shares come nearer to the joints"""
    for V, joints in CROWDS:
        off = np.einsum("n,sna->sa", joint_shares(V, joints), V) - joints
        least = np.einsum("n,sna->sa", solutions.joint_shares(V, joints), V) - joints
        came, best = np.sum(off**2), np.sum(least**2)
        holds(
            came <= best * (1 + 1e-6) + 1e-12,
            "the sum of squares, m^2",
            f"{best:.7g}",
            f"{came:.7g}",
        )
        equal(joint_shares(V, joints).min(), max(0, joint_shares(V, joints).min()),
              "the smallest share, which is not below 0")  # fmt: skip


@mistake("joint_shares", "plain least squares knows nothing of shares: some come out below 0")
def by_least_squares(V, joints):
    A = V.transpose(0, 2, 1).reshape(-1, V.shape[1])
    return np.linalg.lstsq(A, joints.ravel(), rcond=None)[0]


@mistake(
    "joint_shares",
    "cutting off what is below 0 afterwards is not the least: the others were found to go with it",
)
def cut_off_afterwards(V, joints):
    w = by_least_squares.answer(V, joints).clip(0)
    return w / w.sum()


@mistake(
    "joint_shares",
    "0 or more is not enough: the sum has to be 1 while it is sought, else the joint stays behind when "
    "the body moves",
)
def without_the_sum(V, joints):
    from scipy.optimize import nnls

    A = V.transpose(0, 2, 1).reshape(-1, V.shape[1])
    return nnls(A, joints.ravel(), maxiter=5000)[0]


@mistake("joint_shares", "the mean of all vertices is a guess, and not yet the least")
def all_alike(V, joints):
    return np.full(V.shape[1], 1 / V.shape[1])


# shape_of


def scanned(S, noise, seed):
    rng = np.random.default_rng(seed)
    T = rng.standard_normal((15, 3)) * [0.5, 0.3, 0.2]
    T -= T.mean(axis=0)
    R = Rotation.random(S, rng=rng).as_matrix()
    errors = noise * rng.standard_normal((S, 15, 3))
    return T, T @ R.transpose(0, 2, 1) + errors - errors.mean(axis=1, keepdims=True)


def left(T, scans):
    """The sum of squares with every rotation at its best."""
    return sum(np.sum((T @ solutions.nearest(V.T @ T).T - V) ** 2) for V in scans)


@check("shape_of", points=1)
def is_the_thing(shape_of):
    """without noise the distances between its points are those of the thing"""
    T, scans = scanned(6, 0.0, 0)
    came = shape_of(scans)
    equal(came @ came.T, T @ T.T, "products of its points with each other", 1e-6)
    det = np.sign(np.linalg.det(came[:3])) * np.sign(np.linalg.det(T[:3]))
    holds(det > 0, "which way round it is", "as it is", "mirrored")


@check("shape_of", points=2)
def is_the_least(shape_of):
    """with noise no other shape fits the scans better"""
    for S, noise, seed in ((8, 0.02, 1), (5, 0.05, 2)):
        _, scans = scanned(S, noise, seed)
        came, best = left(shape_of(scans), scans), left(solutions.shape_of(scans), scans)
        holds(came <= best * 1.0001, "the sum of squares, m^2", f"{best:.6g}", f"{came:.6g}")


@mistake(
    "shape_of", "the mean of scans that are turned every way shrinks to nothing: turn them back"
)
def the_mean(scans):
    return scans.mean(axis=0)


@mistake("shape_of", "this is one scan with its noise: the mean of all, turned back, has less")
def the_first(scans):
    return scans[0]


@mistake("shape_of", "the rotation back is from the other side: T R' = V, so V R = T")
def turned_further(scans):
    T = scans[0]
    for _ in range(20):
        T = np.mean([scan @ solutions.nearest(scan.T @ T).T for scan in scans], axis=0)
    return T


@mistake("shape_of", "this is mirrored: a rotation has the determinant +1")
def mirrored(scans):
    return solutions.shape_of(scans) * [1, 1, -1]
