"""Exercises of lecture 6 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


@variant(
    "residual",
    points=2,
    minutes=15,
    draw=lambda rng: {
        "BONES": rounded(rng, 0.11, 0.45, count=3, digits=3),
        "BEND": rounded(rng, 0.11, 0.7, digits=3),
    },
    arguments=lambda rng, numbers: (rng.uniform(-2, 2, 3), rng.uniform(-0.5, 0.5, 6)),
)
def residual(x: Array, seen: Array, *, BONES: list[float], BEND: float) -> Array:
    """Where a bent arm with a hand has its points, minus where they were seen.

    It is the arm of the lecture with a hand, but its bones have the lengths BONES (3,) m, and its wrist is
    bent already: the hand points in the direction of the angle a + b + c + BEND.

    x (3,) rad, the angles a, b, c; seen (6,) m: x and y of elbow, wrist and tip -> (6,) m
    """
    along = np.cumsum(x) + [0, 0, BEND]
    bones = np.array(BONES) * [np.cos(along), np.sin(along)]
    return np.cumsum(bones, axis=1).T.ravel() - seen


@mistake("residual", "the model comes first: model minus observation")
def residual_the_other_way(x, seen, *, BONES, BEND):
    return -residual.solution(x, seen, BONES=BONES, BEND=BEND)


@mistake("residual", "the angles add up along the arm")
def residual_with_single_angles(x, seen, *, BONES, BEND):
    along = x + [0, 0, BEND]
    bones = np.array(BONES) * [np.cos(along), np.sin(along)]
    return np.cumsum(bones, axis=1).T.ravel() - seen


@variant(
    "jacobian",
    points=3,
    minutes=25,
    draw=lambda rng: {
        "ARM": rounded(rng, 0.11, 0.45, count=2, digits=3),
        "GEAR": rounded(rng, 0.31, 1.9, digits=3),
    },
    arguments=lambda rng, numbers: (rng.uniform(-2, 2, 2),),
    edges=lambda numbers: [(np.zeros(2),)],
)
def jacobian(x: Array, *, ARM: list[float], GEAR: float) -> Array:
    """The derivatives of the elbow and the wrist of a robot's arm by its two motors, as formulas.

    The upper bone of length ARM[0] points in the direction of the angle a, and the lower one of length
    ARM[1] in that of a + GEAR b: the second motor works through a gear.

    x (2,) rad, the motors' angles a, b -> (4, 2) m/rad, x and y of the elbow, then of the wrist
    """
    a, b = x[0], x[0] + GEAR * x[1]
    upper = ARM[0] * np.array([-np.sin(a), np.cos(a)])
    lower = ARM[1] * np.array([-np.sin(b), np.cos(b)])
    return np.column_stack([np.r_[upper, upper + lower], np.r_[0, 0, GEAR * lower]])


@mistake("jacobian", "the gear is missing in the derivative: the chain rule brings it to the front")
def jacobian_without_chain_rule(x, *, ARM, GEAR):
    return jacobian.solution(x, ARM=ARM, GEAR=GEAR) / [1, GEAR]


@variant(
    "gradient",
    points=2,
    minutes=10,
    draw=lambda rng: {"SIGMAS": rounded(rng, 0.21, 2.9, count=5, digits=3)},
    arguments=lambda rng, numbers: (rng.standard_normal(5), rng.standard_normal((5, 3))),
)
def gradient(e: Array, J: Array, *, SIGMAS: list[float]) -> Array:
    """The gradient of F = sum over i of (e_i / SIGMAS[i])^2, from the residual and its Jacobian.

    e (5,), J (5, n), both as they were measured -> (n,)
    """
    return 2 * J.T @ (e / np.array(SIGMAS) ** 2)


@mistake("gradient", "e and J are both divided by sigma, which makes sigma^2 below")
def gradient_divided_once(e, J, *, SIGMAS):
    return 2 * J.T @ (e / np.array(SIGMAS))


@mistake("gradient", "a factor is missing: F is no half of a sum")
def gradient_of_the_half(e, J, *, SIGMAS):
    return gradient.solution(e, J, SIGMAS=SIGMAS) / 2


@variant(
    "left_out",
    points=3,
    minutes=25,
    draw=lambda rng: {
        "SHOULDER": rounded(rng, -0.45, 0.45, count=2, digits=3),
        "LENGTH": rounded(rng, 0.21, 0.6, digits=3),
    },
    arguments=lambda rng, numbers: (rng.uniform(-3, 3, 1), rng.uniform(-1, 1, 2)),
)
def left_out(x: Array, seen: Array, *, SHOULDER: list[float], LENGTH: float) -> float:
    """The part of the curvature that Gauss-Newton leaves out, over the part that it keeps.

    A bone of length LENGTH turns about SHOULDER; the residual e is its tip minus `seen`. With s the sum of
    e_i times the second derivative of e_i, the answer is s / J'J, with its sign.

    x (1,) rad, the bone's angle; seen (2,) m -> a number
    """
    bone = LENGTH * np.array([np.cos(x[0]), np.sin(x[0])])
    return -(SHOULDER + bone - seen) @ bone / LENGTH**2


@mistake(
    "left_out",
    "the second derivative is that of the tip by the angle: minus the bone, without shoulder",
)
def left_out_with_shoulder(x, seen, *, SHOULDER, LENGTH):
    tip = SHOULDER + LENGTH * np.array([np.cos(x[0]), np.sin(x[0])])
    return -(tip - seen) @ tip / LENGTH**2
