"""Exercises of lecture 13 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


@variant(
    "unevenness",
    points=1,
    minutes=8,
    draw=lambda rng: {
        "MIDDLE": rounded(rng, -0.45, 0.45, digits=3),
        "WEIGHT": rounded(rng, 1.1, 4.9, digits=2),
    },
    arguments=lambda rng, numbers: (rng.standard_normal((4, 3)), np.array([1, 0, 2, 3])),
)
def unevenness(T: Array, opposite: Array, *, MIDDLE: float, WEIGHT: float) -> float:
    """|T - U(T)|^2, where U is the mirror at x = MIDDLE, and differences in x count WEIGHT times.

    That is: the square of a difference in x is multiplied by WEIGHT.

    T (N, 3) m; opposite (N,), the vertex on the other side of each -> a number, m^2
    """
    off = T - (T[opposite] * [-1, 1, 1] + [2 * MIDDLE, 0, 0])
    return float(np.sum(off**2 * [WEIGHT, 1, 1]))


@mistake("unevenness", "the mirror image of x at MIDDLE is 2 MIDDLE - x")
def unevenness_at_half(T, opposite, *, MIDDLE, WEIGHT):
    return unevenness.solution(T, opposite, MIDDLE=MIDDLE / 2, WEIGHT=WEIGHT)


@variant(
    "ridge",
    points=3,
    minutes=25,
    draw=lambda rng: {"PENALTIES": rounded(rng, 0.11, 4.9, count=3, digits=3)},
    arguments=lambda rng, numbers: (
        rng.standard_normal((6, 3)),
        rng.standard_normal((6, 4)),
        rng.standard_normal((4, 3)),
    ),
)
def ridge(F: Array, D: Array, earlier: Array, *, PENALTIES: list[float]) -> Array:
    """The P that is least in sum over j of |D_j - P F_j|^2, kept near to an earlier P.

    The sum over features i of PENALTIES[i] |P_i - earlier_i|^2 is added, P_i the columns.

    F (J, 3), the features of each mesh; D (J, m) m; earlier (m, 3) m -> (m, 3) m
    """
    W = np.diag(PENALTIES)
    return np.linalg.solve(F.T @ F + W, F.T @ D + W @ earlier.T).T


@mistake("ridge", "this pulls to zero, and not to the earlier P")
def ridge_to_zero(F, D, earlier, *, PENALTIES):
    return ridge.solution(F, D, 0 * earlier, PENALTIES=PENALTIES)
