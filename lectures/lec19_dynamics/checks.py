"""Checks of lecture 19, and the mistakes that they tell apart."""

import numpy as np

from workbench.course import check, equal, holds, mistake
from workbench.geometry.rotation import matrix_from_vector
from workbench.lectures.lec19_dynamics import solutions

RNG = np.random.default_rng(19)
GRAVITY = np.array([0.0, -9.81, 0.0])

# wobble

SWINGS = [(0.95, 0.4, 60.0), (0.99, 0.1, 120.0), (0.7, 1.2, 30.0)]  # r, w, fps


@check("wobble", points=1)
def a_swing_repeats_after_its_period(wobble):
    """w rad a frame are w fps / (2 pi) Hz"""
    for r, w, fps in SWINGS:
        came = wobble(2 * r * np.cos(w), -(r**2), fps)[0]
        equal(came, w * fps / (2 * np.pi), f"the frequency for poles {r} exp(+-{w}i), {fps:g} fps")


@check("wobble", points=1)
def a_swing_halves(wobble):
    """r^(fps time) is one half"""
    for r, w, fps in SWINGS:
        came = wobble(2 * r * np.cos(w), -(r**2), fps)[1]
        equal(r ** (fps * came), 0.5, f"what is left after that time, for r = {r}, {fps:g} fps")


@mistake(
    "wobble",
    "this frequency is in radians a second: a whole swing is 2 pi radians, so divide by 2 pi to get Hz",
)
def in_radians(a1, a2, fps):
    frequency, half = solutions.wobble(a1, a2, fps)
    return 2 * np.pi * frequency, half


@mistake(
    "wobble",
    "after this time a quarter of the swing is left: r^t falls to a half where t log r = log(1/2), and the pole's "
    "size is the root of -a2, not -a2 itself",
)
def until_a_quarter(a1, a2, fps):
    frequency, half = solutions.wobble(a1, a2, fps)
    return frequency, half * 2


@mistake(
    "wobble",
    "these are swings for each frame, and a time in frames; a second has fps frames",
)
def in_frames(a1, a2, fps):
    frequency, half = solutions.wobble(a1, a2, fps)
    return frequency / fps, half * fps


@mistake("wobble", "this time is in frames; a second has fps frames")
def half_in_frames(a1, a2, fps):
    frequency, half = solutions.wobble(a1, a2, fps)
    return frequency, half * fps


@mistake(
    "wobble",
    "these are not the poles: z^2 = a1 z + a2 means z^2 - a1 z - a2 = 0, so that the coefficients of the "
    "polynomial are 1, -a1, -a2",
)
def with_wrong_signs(a1, a2, fps):
    pole = np.roots([1.0, a1, a2]).astype(complex)[0]
    return abs(np.angle(pole)) * fps / (2 * np.pi), np.log(0.5) / np.log(abs(pole) * 0.999) / fps


# one_step

X = RNG.standard_normal((60, 3))
TRUE = (1.7, -0.9, np.array([0.3, -0.2, 0.1]))
DRIVEN = solutions.free_run(1.7, -0.9, X @ TRUE[2])
NOISY = DRIVEN + 0.1 * RNG.standard_normal(60)


@check("one_step", points=1)
def a_known_model_is_found(one_step):
    """what a model made is explained by its own factors"""
    for found, right, name in zip(one_step(DRIVEN, X), TRUE, ("a1", "a2", "b"), strict=True):
        equal(found, right, name, within=1e-7)


@check("one_step", points=1)
def with_noise_it_is_the_least_squares(one_step):
    """with noise, the sum of squares of what is left one step ahead is the least"""
    for found, right, name in zip(
        one_step(NOISY, X), solutions.one_step(NOISY, X), ("a1", "a2", "b"), strict=True
    ):
        equal(found, right, name + " with noise", within=1e-7)


@mistake(
    "one_step",
    "a1 and a2 are exchanged: a1 is the factor of phi[t - 1], the frame just before, and a2 that of phi[t - 2]",
)
def the_other_way_round(phi, x):
    a1, a2, b = solutions.one_step(phi, x)
    return a2, a1, b


@mistake(
    "one_step",
    "each row takes the input of two frames ago; phi[t] is driven by x[t], so that the rows for t = 2, 3, ... take "
    "x[2:]",
)
def inputs_too_early(phi, x):
    rows = np.column_stack([phi[1:-1], phi[:-2], x[:-2]])
    found = np.linalg.lstsq(rows, phi[2:], rcond=None)[0]
    return found[0], found[1], found[2:]


@mistake(
    "one_step",
    "each row takes the input of the frame before; phi[t] is driven by x[t], so that the rows for t = 2, 3, ... "
    "take x[2:]",
)
def inputs_a_frame_early(phi, x):
    rows = np.column_stack([phi[1:-1], phi[:-2], x[1:-1]])
    found = np.linalg.lstsq(rows, phi[2:], rcond=None)[0]
    return found[0], found[1], found[2:]


@mistake(
    "one_step",
    "a1 and a2 were found without the inputs here, and b from what was left: put all columns into one matrix and "
    "solve for a1, a2 and b at once",
)
def one_after_the_other(phi, x):
    rows = np.column_stack([phi[1:-1], phi[:-2]])
    a = np.linalg.lstsq(rows, phi[2:], rcond=None)[0]
    return a[0], a[1], np.linalg.lstsq(x[2:], phi[2:] - rows @ a, rcond=None)[0]


# free_run

PUSHES = RNG.standard_normal(25)
ONCE = np.eye(1, 25).ravel()


@check("free_run", points=1)
def a_push_swings_and_dies_away(free_run):
    """after a single push, r^t sin((t + 1) w) / sin(w) is left"""
    r, w, t = 0.9, 0.5, np.arange(25)
    came = free_run(2 * r * np.cos(w), -(r**2), ONCE)
    equal(came, r**t * np.sin((t + 1) * w) / np.sin(w), "the swing after one push")


@check("free_run", points=1)
def pushes_add_up(free_run):
    """it is linear in what drives it, and follows it in the same frame"""
    for a1, a2 in ((0.5, 0.2), (1.6, -0.8)):
        came = free_run(a1, a2, PUSHES)
        equal(came, solutions.free_run(a1, a2, PUSHES), f"the run for a1 = {a1}, a2 = {a2}")
        equal(came[0], PUSHES[0], "the first frame")


@mistake("free_run", "driven[t] moves phi[t] itself, and not the frame after it")
def a_frame_late(a1, a2, driven):
    return np.concatenate([[0.0], solutions.free_run(a1, a2, driven)[:-1]])


@mistake(
    "free_run", "the second frame follows the first one already: phi[1] = a1 phi[0] + driven[1]"
)
def from_the_third_frame_on(a1, a2, driven):
    phi = np.array(driven, dtype=float)
    for t in range(2, len(phi)):
        phi[t] += a1 * phi[t - 1] + a2 * phi[t - 2]
    return phi


@mistake("free_run", "the frame before that is missing: a2 phi[t - 2]")
def of_first_order(a1, a2, driven):
    return solutions.free_run(a1, 0.0, driven)


@mistake("free_run", "a1 belongs to phi[t - 1], and a2 to phi[t - 2]")
def with_factors_exchanged(a1, a2, driven):
    return solutions.free_run(a2, a1, driven)


# stabilized

A1, A2 = RNG.standard_normal((2, 3, 3))


def poles(first, second):
    """The poles of a model, in an order of their own."""
    C = len(first)
    z = np.linalg.eigvals(np.block([[first, second], [np.eye(C), np.zeros((C, C))]]))
    return np.sort_complex(np.round(z, 8))


@check("stabilized", points=1)
def the_largest_pole_is_the_one_asked_for(stabilized):
    """the largest pole has the size that was asked for"""
    for most in (0.99, 0.5):
        came = np.abs(poles(*stabilized(A1, A2, most))).max()
        holds(
            abs(came - most) < 1e-7, f"the size of the largest pole for most = {most}", most, came
        )


@check("stabilized", points=1)
def every_pole_keeps_its_angle(stabilized):
    """all poles are multiplied by one factor, so that every swing keeps its frequency"""
    before = poles(A1, A2)
    right = before * 0.9 / np.abs(before).max()
    came = poles(*stabilized(A1, A2, 0.9))
    equal(np.abs(came), np.abs(right), "the sizes of the poles for most = 0.9", within=1e-6)
    equal(came.imag, right.imag, "their imaginary parts", within=1e-6)


@check("stabilized", points=1)
def what_is_stable_stays(stabilized):
    """a model that is stable enough is left alone"""
    for found, given in zip(
        stabilized(0.1 * A1, 0.01 * A2, 0.9), (0.1 * A1, 0.01 * A2), strict=True
    ):
        equal(found, given, "a matrix of a model that was stable")


@mistake("stabilized", "A_2 reaches two frames back: the factor counts twice there")
def by_the_same_factor(first, second, most):
    s = min(1.0, most / np.abs(poles(first, second)).max())
    if s == 1.0:
        return 1.1 * first, second
    return s * first, s * second


@mistake("stabilized", "the poles are those of the whole companion matrix, not those of A_1 alone")
def by_the_first_matrix(first, second, most):
    s = most / np.abs(np.linalg.eigvals(first)).max()
    return s * first, s**2 * second


@mistake("stabilized", "a model that is stable already must stay as it is: the factor is at most 1")
def always_scaled(first, second, most):
    s = most / np.abs(poles(first, second)).max()
    return s * first, s**2 * second * (1 if s < 1 else 1.0)


@mistake("stabilized", "this clips the matrices' entries, which does not bound the poles")
def clipped(first, second, most):
    return np.clip(first, -most, most), np.clip(second, -most, most) * (1 - 1e-6)


# felt

TURNS = matrix_from_vector(np.cumsum(0.1 * RNG.standard_normal((12, 3)), axis=0))
WALK = np.cumsum(0.01 * RNG.standard_normal((12, 3)), axis=0)


@check("felt", points=1)
def nothing_at_rest_and_at_constant_speed(felt):
    """a body that stands, or moves at a constant speed without turning, feels nothing new"""
    still = np.tile(np.eye(3), (6, 1, 1))
    for speed in (np.zeros(3), np.array([1.0, 2.0, 3.0])):
        equal(
            felt(still, np.arange(6)[:, None] / 60 * speed, 60.0),
            np.zeros((4, 3)),
            f"at {speed} m/s",
        )


@check("felt", points=1)
def in_free_fall_and_lying(felt):
    """in free fall tissue is pulled up by 9.81 m/s^2; on the back it is pulled to the back"""
    t = np.arange(6)[:, None] / 60
    still = np.tile(np.eye(3), (6, 1, 1))
    equal(
        felt(still, 0.5 * GRAVITY * t**2, 60.0),
        np.tile(-GRAVITY, (4, 1)),
        "in free fall",
        within=1e-7,
    )
    lying = np.tile(matrix_from_vector([-np.pi / 2, 0, 0]), (6, 1, 1))  # the face, +z, points up
    equal(
        felt(lying, np.zeros((6, 3)), 60.0), np.tile([0, 9.81, -9.81], (4, 1)), "lying on the back"
    )


@check("felt", points=1)
def in_any_motion(felt):
    """and in a motion of everything together"""
    for fps in (30.0, 60.0):
        equal(
            felt(TURNS, WALK, fps),
            solutions.felt(TURNS, WALK, fps),
            f"a motion at {fps:g} fps",
            within=1e-7,
        )


@mistake("felt", "tissue feels an acceleration, a second difference; these are speeds")
def of_speeds(R, places, fps):
    v = (places[2:] - places[:-2]) * (fps / 2)
    return np.einsum("tji,tj->ti", R[1:-1], GRAVITY - v) - GRAVITY


@mistake("felt", "into the frame of the bone leads the transpose of R")
def turned_the_wrong_way(R, places, fps):
    a = (places[2:] - 2 * places[1:-1] + places[:-2]) * fps**2
    return np.einsum("tij,tj->ti", R[1:-1], GRAVITY - a) - GRAVITY


@mistake("felt", "what it feels at rest, g, is to be subtracted: the rest pose contains it already")
def with_gravity_at_rest(R, places, fps):
    return solutions.felt(R, places, fps) + GRAVITY


@mistake(
    "felt", "it feels gravity less the acceleration: what accelerates forwards is pressed back"
)
def with_the_sign_of_the_acceleration(R, places, fps):
    a = (places[2:] - 2 * places[1:-1] + places[:-2]) * fps**2
    return np.einsum("tji,tj->ti", R[1:-1], GRAVITY + a) - GRAVITY


@mistake("felt", "gravity is missing: tissue hangs where down is, also without any acceleration")
def without_gravity(R, places, fps):
    a = (places[2:] - 2 * places[1:-1] + places[:-2]) * fps**2
    return -np.einsum("tji,tj->ti", R[1:-1], a)


@mistake("felt", "a second difference is divided by the square of the time between frames")
def by_the_time_alone(R, places, fps):
    a = (places[2:] - 2 * places[1:-1] + places[:-2]) * fps
    return np.einsum("tji,tj->ti", R[1:-1], GRAVITY - a) - GRAVITY


# joint_between

JOINT = np.array([0.3, -0.2, 0.5])


def two_bones(frames, about=None, size=1.0, wobble=0.0):
    """Two bones that share JOINT; b turns about any axis, or about one, but for a wobble."""
    draw = np.random.default_rng(frames)
    Ra = matrix_from_vector(0.5 * draw.standard_normal((frames, 3)))
    turn = (
        0.8 * draw.standard_normal((frames, 3))
        if about is None
        else draw.standard_normal((frames, 1)) * about + wobble * draw.standard_normal((frames, 3))
    ) * size
    Rb = Ra @ matrix_from_vector(turn)
    ta = draw.standard_normal((frames, 3))
    place = np.einsum("tij,j->ti", Ra, JOINT) + ta
    return Ra, ta, Rb, place - np.einsum("tij,j->ti", Rb, JOINT)


@check("joint_between", points=1)
def a_ball_joint_is_found(joint_between):
    """a joint that turns about all axes is where it is"""
    place, free = joint_between(*two_bones(9))
    equal(place, JOINT, "the joint", within=1e-7)
    equal(free, 0, "the directions in which it may slide")


@check("joint_between", points=1)
def a_hinge_may_slide_along_its_axis(joint_between):
    """of a hinge, only the line is known"""
    axis = np.array([0.0, 0.6, 0.8])
    place, free = joint_between(*two_bones(7, axis))
    equal(free, 1, "the directions in which a hinge may slide")
    equal(
        place,
        JOINT - axis * (axis @ JOINT),
        "the point of its line closest to the origin",
        within=1e-7,
    )
    equal(
        joint_between(*two_bones(7, 0 * axis))[1],
        3,
        "the same of two bones that never turn against each other",
    )


@check("joint_between", points=1)
def what_is_zero_is_relative_to_the_largest(joint_between):
    """a singular value is zero if it is small beside the largest one, however large that is"""
    equal(
        joint_between(*two_bones(9, size=1e-7))[1],
        0,
        "the directions in which a joint may slide that hardly turns, but about all axes",
    )
    axis = np.array([0.0, 0.6, 0.8])
    place, free = joint_between(*two_bones(7, axis, wobble=1e-9))
    equal(free, 1, "the directions in which a hinge may slide whose axis wobbles by 1e-9 rad")
    equal(place, JOINT - axis * (axis @ JOINT), "the place of this hinge", within=1e-6)


@mistake(
    "joint_between",
    "this tolerance of matrix_rank is an absolute one: a millionth of the largest singular value is asked",
)
def by_an_absolute_tolerance(Ra, ta, Rb, tb):
    A, b = (Ra - Rb).reshape(-1, 3), (tb - ta).reshape(-1)
    return np.linalg.lstsq(A, b, rcond=1e-6)[0], 3 - int(np.linalg.matrix_rank(A, tol=1e-6))


@mistake(
    "joint_between",
    "the place is found with lstsq's own tolerance, rounding alone; give it the millionth as rcond",
)
def by_rounding_alone(Ra, ta, Rb, tb):
    A, b = (Ra - Rb).reshape(-1, 3), (tb - ta).reshape(-1)
    return np.linalg.lstsq(A, b, rcond=None)[0], solutions.joint_between(Ra, ta, Rb, tb)[1]


@mistake("joint_between", "the right-hand side has the other sign: Ra p + ta = Rb p + tb")
def with_the_other_sign(Ra, ta, Rb, tb):
    place, free = solutions.joint_between(Ra, ta, Rb, tb)
    return -place, min(free, 2)


@mistake(
    "joint_between",
    "this is the rank: the directions that are known. Those that slide are the others",
)
def the_rank(Ra, ta, Rb, tb):
    place, free = solutions.joint_between(Ra, ta, Rb, tb)
    return place, 3 - free


@mistake(
    "joint_between",
    "the joint stays together in all frames, and one frame alone leaves a line open",
)
def of_the_first_frame(Ra, ta, Rb, tb):
    return solutions.joint_between(Ra[:1], ta[:1], Rb[:1], tb[:1])


@mistake("joint_between", "the transposes lead from the world to the bones; p is at rest")
def with_transposes(Ra, ta, Rb, tb):
    A = (Ra - Rb).swapaxes(1, 2).reshape(-1, 3)
    return np.linalg.lstsq(A, (tb - ta).reshape(-1), rcond=1e-6)[0], 3 - int(
        np.linalg.matrix_rank(A, tol=1e-6 * np.linalg.norm(A, 2))
    )
