"""Checks of lecture 2, and the mistakes that they tell apart."""

import casadi as cs
import numpy as np
import scipy.linalg
from scipy.spatial.transform import Rotation
from scipy.special import gammaln

from workbench.course import check, equal, holds, mistake
from workbench.lectures.lec02_rotations import solutions

Z = np.array([0.0, 0.0, 1.0])
V = np.array([0.3, -0.5, 0.8])
RNG = np.random.default_rng(2)
VECTORS = [np.array([0.0, 0.0, 1.2]), np.array([0.4, -0.7, 0.2]), 2.5 * V / np.linalg.norm(V)]
MATRICES = [np.eye(3) + 0.2 * RNG.standard_normal((3, 3)) for _ in range(4)]


# hat


@check("hat", points=1)
def is_the_cross_product(hat):
    """hat(w) @ v is w x v"""
    for w in (Z, V, np.array([1.0, 2.0, 3.0])):
        for v in np.eye(3):
            equal(hat(w) @ v, np.cross(w, v), f"hat(w) @ v for w = {w}, v = {v}")


@mistake("hat", "this is v x w: the signs are those of the transpose")
def hat_transposed(w):
    return -solutions.hat(w)


@mistake(
    "hat",
    "this is symmetric; of each two entries that mirror each other one needs a minus, so that w x w = 0",
)
def hat_without_signs(w):
    return np.abs(solutions.hat(np.ones(3))) * np.array(
        [[0, w[2], w[1]], [w[2], 0, w[0]], [w[1], w[0], 0]]
    )


@mistake("hat", "x and z have changed places: column 0 of hat(w) is w x (1, 0, 0) = (0, z, -y)")
def hat_reversed(w):
    return solutions.hat(w[::-1])


# rodrigues


@check("rodrigues", points=1)
def keeps_lengths(rodrigues):
    """R'R = I, and no reflection: det R = 1"""
    for w in VECTORS:
        R = rodrigues(w)
        equal(R.T @ R, np.eye(3), f"R'R for w = {w}", 1e-7)
        equal(np.linalg.det(R), 1, f"det R for w = {w}", 1e-7)


@check("rodrigues", points=1)
def turns_the_right_way(rodrigues):
    """it is the matrix exponential of hat(w)"""
    equal(
        rodrigues(np.array([0.0, 0.0, np.pi / 2])) @ [1.0, 0.0, 0.0],
        [0, 1, 0],
        "a quarter turn about z, of (1, 0, 0)",
        1e-7,
    )
    for w in VECTORS:
        equal(rodrigues(w), scipy.linalg.expm(solutions.hat(w)), f"R for w = {w}", 1e-7)


@check("rodrigues", points=2)
def near_zero(rodrigues):
    """it is right at w = 0 and near it"""
    equal(rodrigues(np.zeros(3)), np.eye(3), "R for w = 0", 1e-15)
    for t in (1e-12, 1e-9, 1e-5):
        w = t * V
        off = np.abs(rodrigues(w) - np.eye(3) - solutions.hat(w)).max()
        holds(
            off <= t**2 + 1e-16,
            f"R - I - hat(w) for |w| about {t}",
            f"nothing above {t**2:.0e}: the next term is hat(w)^2 / 2",
            off,
        )
    w = 1e-3 * V
    equal(rodrigues(w), scipy.linalg.expm(solutions.hat(w)), f"R for w = {w}", 1e-15)


@mistake(
    "rodrigues",
    "the last term needs 1 - cos t, not cos t; the cosine alone is a misprint of the course notes "
    "'SMPL and SMPLify', and with it R is not I at t = 0",
)
def with_cos_for_one_minus_cos(w):
    t = np.linalg.norm(w)
    n = solutions.hat(w / t if t > 0 else w)  # NaN at 0 is another mistake, with its own hint
    return np.eye(3) + np.sin(t) * n + np.cos(t) * n @ n


@mistake(
    "rodrigues",
    "sin t and 1 - cos t stand beside the hat of the unit axis w / t; with hat(w) itself they are "
    "divided by t and t^2",
)
def with_an_axis_that_is_no_unit(w):
    t = np.linalg.norm(w)
    W = solutions.hat(w)
    return np.eye(3) + np.sin(t) * W + (1 - np.cos(t)) * W @ W


@mistake("rodrigues", "it turns backwards: R came out transposed, or hat(w) with the other signs")
def backwards(w):
    return solutions.rodrigues(-w)


@mistake("rodrigues", "the angle is in radians already; do not convert it from degrees")
def as_if_degrees(w):
    return solutions.rodrigues(np.radians(w))


@mistake(
    "rodrigues",
    "at w = 0 this divides 0 by 0: take a series there, or forms without the division (np.sinc)",
)
def divides_by_zero(w):
    t = np.linalg.norm(w)
    W = solutions.hat(w)
    return np.eye(3) + np.sin(t) / t * W + (1 - np.cos(t)) / t**2 * W @ W


@mistake(
    "rodrigues",
    "small is not zero: for |w| = 1e-9 the answer is I + hat(w), and with I its derivative is lost",
)
def identity_when_small(w):
    return np.eye(3) if np.linalg.norm(w) < 1e-6 else solutions.rodrigues(w)


@mistake(
    "rodrigues",
    "a small number added to the angle keeps the division alive, but R is then no rotation: take a "
    "series at 0, or np.sinc",
)
def with_a_little_added(w):
    t = np.linalg.norm(w + 1e-8)
    n = solutions.hat(w / t)
    return np.eye(3) + np.sin(t) * n + (1 - np.cos(t)) * n @ n


# angle_between


@check("angle_between", points=1)
def is_that_of_the_rotation_between(angle_between):
    """it is the angle that leads from A to B"""
    A = solutions.rodrigues(np.array([0.3, 1.1, -0.4]))
    for t in (0.5, 1.5, 3.0):
        B = A @ solutions.rodrigues(t * V / np.linalg.norm(V))
        equal(angle_between(A, B), t, f"the angle between A and A exp(w), |w| = {t}", 1e-9)
        equal(angle_between(B, A), t, "the angle from B to A", 1e-9)
    equal(angle_between(A, A), 0, "the angle between A and A", 1e-7)


@check("angle_between", points=1)
def is_good_near_zero(angle_between):
    """it keeps its digits where the angle is small"""
    A = solutions.rodrigues(np.array([0.3, 1.1, -0.4]))
    for t in (1e-3, 1e-6):
        B = A @ solutions.rodrigues(t * V / np.linalg.norm(V))
        holds(
            abs(angle_between(A, B) / t - 1) < 1e-8,
            f"a rotation by {t} rad",
            f"{t}",
            f"{angle_between(A, B):.12g}",
        )


@mistake(
    "angle_between",
    "cos is flat at 0, so arccos of a trace loses half of the digits there: ||A - B|| = "
    "2 sqrt(2) sin(angle / 2) does not",
)
def by_the_trace(A, B):
    return np.arccos(np.clip((np.trace(A.T @ B) - 1) / 2, -1, 1))


@mistake("angle_between", "the rotation from A to B is A' B, not A B")
def of_the_product(A, B):
    return np.arccos(np.clip((np.trace(A @ B) - 1) / 2, -1, 1))


@mistake("angle_between", "||A - B|| = 2 sqrt(2) sin(angle / 2): this is half of the angle")
def half_of_it(A, B):
    return solutions.angle_between(A, B) / 2


@mistake("angle_between", "degrees? It is asked for in radians")
def in_degrees(A, B):
    return np.degrees(solutions.angle_between(A, B))


@mistake(
    "angle_between",
    "||A - B|| / sqrt(2) is the chord 2 sin(angle / 2), not the angle: the two agree only where "
    "both are small",
)
def the_chord(A, B):
    return np.linalg.norm(A - B) / np.sqrt(2)


@mistake("angle_between", "this is the distance ||A - B||; the angle follows from it")
def the_distance(A, B):
    return np.linalg.norm(A - B)


# shorter


@check("shorter", points=1)
def is_the_same_rotation(shorter):
    """it is the same rotation"""
    for t in (0.5, 3.0, 3.5, 6.0, 9.0, 12.0, 20.0):
        w = t * V / np.linalg.norm(V)
        equal(
            solutions.rodrigues(shorter(w)),
            solutions.rodrigues(w),
            f"the rotation by the answer, for |w| = {t}",
        )


@check("shorter", points=1)
def is_half_a_turn_at_most(shorter):
    """its angle is at most pi, and w = 0 stays"""
    equal(shorter(np.zeros(3)), np.zeros(3), "the answer for w = 0")
    for t in (0.5, 3.5, 6.0, 9.0, 12.0, 20.0):
        w = t * V / np.linalg.norm(V)
        length = np.linalg.norm(shorter(w))
        holds(length <= np.pi + 1e-9, f"the angle of the answer, for |w| = {t}", "<= pi", length)


@mistake(
    "shorter",
    "a full turn is 2 pi of the angle |w|, along the axis; taking entries modulo 2 pi turns the "
    "axis too",
)
def each_entry_modulo(w):
    return (w + np.pi) % (2 * np.pi) - np.pi


@mistake("shorter", "this cuts the angle at pi, which is another rotation")
def cut_off(w):
    t = np.linalg.norm(w)
    return w if t <= np.pi else w * np.pi / t


@mistake("shorter", "one turn less is not enough for a w of several turns")
def one_turn_less(w):
    t = np.linalg.norm(w)
    return w if t <= np.pi else w * (1 - 2 * np.pi / t)


@mistake(
    "shorter",
    "a full turn is 2 pi, not pi: half a turn less is another rotation",
)
def modulo_half_a_turn(w):
    t = np.linalg.norm(w)
    return w * (t % np.pi) / t if t > 0 else w


@mistake("shorter", "at w = 0 this divides 0 by 0: a w that is short enough can stay as it is")
def shorter_dividing_by_zero(w):
    t = np.linalg.norm(w)
    return w / t * ((t + np.pi) % (2 * np.pi) - np.pi)


@mistake(
    "shorter",
    "beyond half a turn the shorter way is by 2 pi - t about -w; here the axis has the other sign",
)
def the_wrong_way_round(w):
    t = np.linalg.norm(w)
    return w if t <= np.pi else -solutions.shorter(w)


# nearest_rotation


def is_one(R, within, what):
    """Every matrix is near to itself: what is no rotation is not compared with rotations."""
    off = max(np.abs(R.T @ R - np.eye(3)).max(), abs(np.linalg.det(R) - 1))
    told = f"R'R is off by up to {np.abs(R.T @ R - np.eye(3)).max():.1g}, det R = "
    holds(
        off <= within,
        f"{what} is not a rotation, so its distance was not compared",
        "R'R = I and det R = 1",
        f"{told}{np.linalg.det(R):.6g}",
    )


@check("nearest_rotation", points=1)
def is_a_rotation(nearest_rotation):
    """the answer is a rotation, for reflections too"""
    for M in (*MATRICES, np.diag([1.0, 1.0, -0.5]), -np.eye(3) + 0.1 * MATRICES[0]):
        R = nearest_rotation(M)
        equal(R.T @ R, np.eye(3), "R'R", 1e-9)
        equal(np.linalg.det(R), 1, f"det R, for a matrix with determinant {np.linalg.det(M):.2f}")


@check("nearest_rotation", points=1)
def none_is_nearer(nearest_rotation):
    """no other rotation is nearer"""
    others = Rotation.random(500, rng=np.random.default_rng(0)).as_matrix()
    for M in (*MATRICES, np.diag([1.0, 0.7, -0.1]), -MATRICES[0]):
        R = nearest_rotation(M)
        is_one(R, 1e-6, "the answer")
        near = [R @ solutions.rodrigues(1e-3 * v) for v in (*np.eye(3), *-np.eye(3))]
        found = np.linalg.norm(R - M)
        least = np.linalg.norm([*others, *near] - M, axis=(1, 2)).min()
        holds(
            found <= least + 1e-9,
            "the distance ||R - M||",
            f"at most {least:.6g}, at which there is another rotation",
            found,
        )


@mistake("nearest_rotation", "det R = -1 for a reflection: turn the last column of U around then")
def without_the_determinant(M):
    U, _, Vt = np.linalg.svd(M)
    return U @ Vt


@mistake(
    "nearest_rotation",
    "the sign belongs to the smallest singular value, the last: turning the first around costs most",
)
def with_the_wrong_sign_changed(M):
    U, _, Vt = np.linalg.svd(M)
    return U @ np.diag([np.linalg.det(U @ Vt), 1, 1]) @ Vt


@mistake("nearest_rotation", "NumPy's svd answers U, s, V': its third is transposed already")
def with_v_for_its_transpose(M):
    U, _, Vt = np.linalg.svd(M)
    return U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt.T


@mistake("nearest_rotation", "this is M as it came: it is no rotation unless it was one before")
def as_it_came(M):
    return M


@mistake(
    "nearest_rotation",
    "-R turns all three directions of a reflection around; turn only the one with the smallest "
    "singular value",
)
def with_all_signs_changed(M):
    U, _, Vt = np.linalg.svd(M)
    return U @ Vt * np.linalg.det(U @ Vt)


q_of_a_factorisation = mistake(
    "nearest_rotation",
    "the Q of a QR factorisation is orthogonal, but not the nearest, and its signs are left open",
)


@q_of_a_factorisation
def q_of_qr(M):
    return np.linalg.qr(M)[0]


@q_of_a_factorisation
def q_of_qr_made_proper(M):
    Q, _ = np.linalg.qr(M)
    return Q * np.linalg.det(Q)


@mistake("nearest_rotation", "columns of length 1 are not yet at right angles to each other")
def columns_of_length_one(M):
    return M / np.linalg.norm(M, axis=0)


@mistake(
    "nearest_rotation",
    "columns made orthogonal one after the other favour the first; the nearest treats them alike",
)
def column_by_column(M):
    Q, R = np.linalg.qr(M)
    Q = Q * np.sign(np.diag(R))
    Q[:, 2] *= np.linalg.det(Q)
    return Q


# mean_rotation


def crowd(spread, n=7, seed=0):
    centre = np.array([0.4, -1.9, 1.6])
    turns = spread * np.random.default_rng(seed).standard_normal((n, 3))
    R = solutions.rodrigues(centre)
    return np.array([R @ solutions.rodrigues(w) for w in turns])


@check("mean_rotation", points=1)
def is_one_and_goes_along(mean_rotation):
    """the mean is a rotation, and turns along when all of them are turned"""
    rotations, Q = crowd(0.4), solutions.rodrigues(np.array([2.0, 1.0, -1.0]))
    R = mean_rotation(rotations)
    equal(R.T @ R, np.eye(3), "R'R of the mean", 1e-7)
    equal(mean_rotation(Q @ rotations), Q @ R, "the mean of Q R_n, which is Q times the mean", 1e-6)


@check("mean_rotation", points=2)
def is_least(mean_rotation):
    """no rotation near it has a smaller sum of squares"""
    for seed in (1, 2):
        rotations = crowd(0.4, seed=seed)
        R = mean_rotation(rotations)
        is_one(R, 1e-6, "the mean")
        found = ((R - rotations) ** 2).sum()
        near = [R @ solutions.rodrigues(1e-2 * v) for v in (*np.eye(3), *-np.eye(3))]
        least = min(((one - rotations) ** 2).sum() for one in near)
        best = ((solutions.mean_rotation(rotations) - rotations) ** 2).sum()
        holds(found <= min(least, best) + 1e-6, "the sum of squares", f"{best:.8g}", f"{found:.8g}")


@mistake(
    "mean_rotation",
    "the mean of matrices is no rotation: it has yet to be brought back to one",
)
def of_the_entries(rotations):
    return np.mean(rotations, axis=0)


@mistake(
    "mean_rotation",
    "the mean of rotation vectors depends on where they are counted from: it does not go along "
    "when all are turned",
)
def of_the_vectors(rotations):
    return Rotation.from_rotvec(
        Rotation.from_matrix(rotations).as_rotvec().mean(axis=0)
    ).as_matrix()


@mistake("mean_rotation", "the product of all is where they lead one after the other, not a mean")
def of_all_in_turn(rotations):
    return np.linalg.multi_dot(rotations)


# third


def in_casadi(expression):
    """A wrong answer from its expression in s."""

    def answer(s):
        x = cs.SX.sym("s")
        return solutions.with_derivatives(expression(x), x, s)

    return answer


def by_the_series(s):
    """All three from the power series, which has no trouble up to s = 40."""
    n = np.arange(40.0)
    c = (-1) ** n * np.exp(-gammaln(2 * n + 4))
    powers = [c * s**n, (c * n)[1:] * s ** (n[1:] - 1), (c * n * (n - 1))[2:] * s ** (n[2:] - 2)]
    return np.array([np.sum(one) for one in powers])


@check("third", points=1)
def is_right_away_from_zero(third):
    """it is (t - sin t) / t^3, for t of a radian and more"""
    for s in (1.0, 4.0, 39.0):
        equal(third(s), by_the_series(s), f"value and two derivatives at s = {s}", 1e-6)


@check("third", points=1)
def is_right_at_zero(third):
    """value and derivatives are right at zero and near it"""
    for s in (0.0, 1e-16, 1e-8, 1e-3):
        equal(third(s), by_the_series(s), f"value and two derivatives at s = {s}", 1e-6)


@mistake("third", "as it is written it divides 0 by 0: near zero take the series in s")
@in_casadi
def third_as_written(s):
    t = cs.sqrt(s)
    return (t - cs.sin(t)) / t**3


constant_there = mistake(
    "third",
    "a constant at zero, or near it, has the right value there and no derivatives: take the series",
)


@constant_there
@in_casadi
def third_unguarded(s):
    t = cs.sqrt(s)
    return cs.if_else(s == 0, 1 / 6, (t - cs.sin(t)) / t**3)


@mistake("third", "a few terms of the series are right near zero alone: t goes up to 2 pi here")
@in_casadi
def third_by_a_short_series(s):
    return 1 / 6 - s / 120 + s**2 / 5040


@constant_there
@in_casadi
def third_constant_near_zero(s):
    t = cs.sqrt(cs.if_else(s < 0.01, 1, s))
    return cs.if_else(s < 0.01, 1 / 6, (t - cs.sin(t)) / t**3)


@mistake("third", "t is the root of s: this takes s for the angle")
def third_of_the_square(s):
    return solutions.third(s**2)


@mistake("third", "a small number added to s keeps the division alive; digits cancel all the same")
@in_casadi
def third_with_a_little_added(s):
    t = cs.sqrt(s + 1e-16)
    return (t - cs.sin(t)) / t**3
