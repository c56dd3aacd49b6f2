"""Exercises of lecture 17 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


@variant(
    "smooth_residual",
    points=2,
    minutes=15,
    draw=lambda rng: {
        "STEPS": rounded(rng, 0.011, 0.09, count=5, digits=4),
        "SIGMA": rounded(rng, 0.21, 1.9, digits=3),
    },
    arguments=lambda rng, numbers: (rng.standard_normal((6, 2)),),
)
def smooth_residual(x: Array, *, STEPS: list[float], SIGMA: float) -> Array:
    """How much the speed changes in a film of six frames that are not equally far apart, in sigmas.

    STEPS[t] is the time from frame t to frame t + 1. The speed in between is the difference over the time; a
    residual is a speed minus the one before it, over SIGMA: all numbers of the first, then of the second...

    x (6, n), a row for each frame; STEPS s; SIGMA in the unit of x over s -> (4 n,)
    """
    speeds = np.diff(x, axis=0) / np.array(STEPS)[:, None]
    return np.diff(speeds, axis=0).ravel() / SIGMA


@mistake("smooth_residual", "a speed is a difference over the time that it took")
def smooth_residual_of_differences(x, *, STEPS, SIGMA):
    return np.diff(x, 2, axis=0).ravel() / SIGMA


@variant(
    "worth",
    points=2,
    minutes=15,
    draw=lambda rng: {"CORRELATION": rounded(rng, 0.31, 0.95, digits=3)},
    arguments=lambda rng, numbers: (int(rng.integers(5, 200)),),
    edges=lambda numbers: [(1,), (2,)],
)
def worth(T: int, *, CORRELATION: float) -> float:
    """How many independent frames have a mean that is known as well as that of T frames of your film.

    Errors that are k frames apart have the correlation CORRELATION^k.

    T frames -> a number
    """
    k = np.arange(1, T)
    return T / (1 + 2 * np.sum((1 - k / T) * CORRELATION**k))


@mistake("worth", "T frames have T - k pairs that are k apart: a factor 1 - k / T is missing")
def worth_of_a_long_film(T, *, CORRELATION):
    return T / (1 + 2 * np.sum(CORRELATION ** np.arange(1, T)))


@variant(
    "carried",
    points=3,
    minutes=20,
    draw=lambda rng: {"ALONG": rounded(rng, 0.11, 0.9, digits=3)},
    arguments=lambda rng, numbers: (*rng.standard_normal((2, 3, 3)), rng.standard_normal(3)),
)
def carried(rest: Array, posed: Array, marker: Array, *, ALONG: float) -> Array:
    """Where a marker is that is fixed to three vertices of the skin, when these have moved.

    The vertices a, b, c define a frame of axes of length 1. Its origin is on the edge, at
    (1 - ALONG) a + ALONG b; the first axis points from a to b, the third is along (b - a) x (c - a), and the
    second is the third x the first. The marker keeps its coordinates in this frame, in metres.

    rest, posed (3, 3) m, a row for each vertex; marker (3,) m, at rest -> (3,) m
    """

    def axes(corners):
        a, b, c = corners
        first, third = b - a, np.cross(b - a, c - a)
        first, third = first / np.linalg.norm(first), third / np.linalg.norm(third)
        return np.column_stack([first, np.cross(third, first), third])

    old, new = ((1 - ALONG) * corners[0] + ALONG * corners[1] for corners in (rest, posed))
    return new + axes(posed) @ axes(rest).T @ (marker - old)


@mistake("carried", "the origin is not a, but a point on the edge from a to b")
def carried_from_a(rest, posed, marker, *, ALONG):
    return carried.solution(rest, posed, marker, ALONG=0.0)
