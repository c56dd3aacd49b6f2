"""Exercises of lecture 14 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


@variant(
    "frame",
    points=2,
    minutes=12,
    draw=lambda rng: {"POWER": rounded(rng, 0.61, 1.4, digits=3)},
    arguments=lambda rng, numbers: (rng.standard_normal((3, 3)),),
)
def frame(T: Array, *, POWER: float) -> Array:
    """The two edges e_0 = T_2 - T_0 and e_1 = T_1 - T_0, and a third axis n / |n|^POWER, as columns.

    n = e_1 x e_0. (The lecture has another power, so that the axis grows as the triangle does.)

    T (3, 3), a corner in each row -> (3, 3)
    """
    e0, e1 = T[2] - T[0], T[1] - T[0]
    n = np.cross(e1, e0)
    return np.column_stack([e0, e1, n / np.linalg.norm(n) ** POWER])


@mistake("frame", "n is e_1 x e_0, in this order")
def frame_from_below(T, *, POWER):
    return frame.solution(T, POWER=POWER) * [1, 1, -1]


@variant(
    "blend_volume",
    points=3,
    minutes=20,
    draw=lambda rng: {
        "BACK": rounded(rng, 0.21, 0.9, digits=3),
        "ALONG": rounded(rng, 0.6, 1.7, digits=3),
    },
    arguments=lambda rng, numbers: (rng.uniform(0.1, 0.9), rng.uniform(0.2, 3.0)),
    edges=lambda numbers: [(0.0, 1.0), (0.4, 0.0)],
)
def blend_volume(w: float, alpha: float, *, BACK: float, ALONG: float) -> float:
    """The determinant of a blend of two deformations about one axis.

    With the share w a rotation by alpha that also stretches along the axis by the factor ALONG; with the
    share 1 - w a rotation by BACK alpha the other way, which stretches nothing.

    w a share from 0 to 1, alpha rad -> a number
    """
    across = w * np.exp(1j * alpha) + (1 - w) * np.exp(-1j * BACK * alpha)
    return abs(across) ** 2 * (w * ALONG + 1 - w)


@mistake("blend_volume", "across the axis there are two directions: the area goes with the square")
def blend_volume_of_a_length(w, alpha, *, BACK, ALONG):
    right = blend_volume.solution(w, alpha, BACK=BACK, ALONG=1.0)
    return np.sqrt(right) * (w * ALONG + 1 - w)
