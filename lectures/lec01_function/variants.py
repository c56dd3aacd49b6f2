"""Exercises of lecture 1 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


@variant(
    "polynomial",
    points=1,
    minutes=8,
    draw=lambda rng: {"CENTRE": rounded(rng, 0.31, 1.97, digits=3)},
    arguments=lambda rng, numbers: (rng.uniform(-2, 2, size=5), rng.uniform(-2, 2)),
)
def polynomial(w: Array, x: float, *, CENTRE: float) -> float:
    """The value at x of a polynomial in powers of x - CENTRE, in which the highest power comes last.

    w (d + 1,): w[0] + w[1] (x - CENTRE) + w[2] (x - CENTRE)^2 + ...; x a number -> a number
    """
    value = 0.0
    for coefficient in w[::-1]:
        value = value * (x - CENTRE) + coefficient
    return value


@mistake("polynomial", "the powers are of x - CENTRE, and not of x + CENTRE")
def polynomial_on_the_other_side(w, x, *, CENTRE):
    return sum(c * (x + CENTRE) ** k for k, c in enumerate(w))


@mistake("polynomial", "the highest power comes last: w[0] is the constant")
def polynomial_backwards(w, x, *, CENTRE):
    return np.polyval(w, x - CENTRE)


@variant(
    "shortening",
    points=3,
    minutes=15,
    draw=lambda rng: {"SHARE": rounded(rng, 0.12, 0.43, digits=3)},
    arguments=lambda rng, numbers: (rng.uniform(0.3, 3.1),),
    edges=lambda numbers: [(0.0,), (np.pi,)],
)
def shortening(alpha: float, *, SHARE: float) -> float:
    """How long a bone of length 1 becomes if its end is not put halfway between two places.

    The bone turns by alpha about one of its ends. The other end is put at SHARE times where it is after
    the turn, plus 1 - SHARE times where it was before.

    alpha rad, in [0, pi] -> a number, the new length over the true one
    """
    return np.sqrt(1 - 4 * SHARE * (1 - SHARE) * np.sin(alpha / 2) ** 2)


@mistake(
    "shortening", "the end is put in a share of the way, and is not turned by a share of the angle"
)
def shortening_by_a_share_of_the_angle(alpha, *, SHARE):
    return np.cos(SHARE * alpha)


@mistake("shortening", "this is the square of the length")
def shortening_squared(alpha, *, SHARE):
    return 1 - 4 * SHARE * (1 - SHARE) * np.sin(alpha / 2) ** 2


@variant(
    "parameter_count",
    points=2,
    minutes=12,
    draw=lambda rng: {
        "FEATURES": int(rng.integers(3, 9)),
        "EXPRESSIONS": int(rng.integers(5, 60)),
    },
    arguments=lambda rng, numbers: tuple(
        int(n) for n in (rng.integers(100, 9000), rng.integers(5, 60), rng.integers(2, 30))
    ),
)
def parameter_count(N: int, K: int, B: int, *, FEATURES: int, EXPRESSIONS: int) -> dict[str, int]:
    """How many numbers the arrays of a body hold, zeros included, that has a face.

    It has the form of SMPL, but with FEATURES features of each joint's rotation in place of 9 (none of
    the root's), and with EXPRESSIONS directions of facial expression beside its B shape directions.

    N vertices, K joints with the root among them, B shape directions
    -> template, shapedirs, expressions, posedirs, weights, J_regressor, each with its count
    """
    return {
        "template": 3 * N,
        "shapedirs": 3 * N * B,
        "expressions": 3 * N * EXPRESSIONS,
        "posedirs": 3 * N * FEATURES * (K - 1),
        "weights": N * K,
        "J_regressor": K * N,
    }


@mistake("parameter_count", "the root has no features: there are FEATURES (K - 1) of them")
def parameter_count_with_the_root(N, K, B, *, FEATURES, EXPRESSIONS):
    right = parameter_count.solution(N, K, B, FEATURES=FEATURES, EXPRESSIONS=EXPRESSIONS)
    return right | {"posedirs": 3 * N * FEATURES * K}
