"""Exercises of lecture 7 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


def linear(rng: np.random.Generator, rows: int = 6) -> tuple[Array, Array]:
    return rng.standard_normal(rows), rng.standard_normal((rows, 3))


@variant(
    "damped_step",
    points=3,
    minutes=20,
    draw=lambda rng: {"YARDSTICKS": rounded(rng, 0.23, 2.9, count=3, digits=3)},
    arguments=lambda rng, numbers: (*linear(rng), 10 ** rng.uniform(-1.5, 1)),
    edges=lambda numbers: [(np.ones(3), np.ones((3, 3)), 0.7)],
)
def damped_step(e: Array, J: Array, damping: float, *, YARDSTICKS: list[float]) -> Array:
    """The p that is least in |e + J p|^2 + damping sum over i of (p_i / YARDSTICKS[i])^2.

    The three unknowns have different units; a yardstick is a change of one that matters. Columns of J may
    depend on each other.

    e (m,), J (m, 3), damping > 0 -> (3,)
    """
    tall = np.concatenate([J, np.sqrt(damping) * np.diag(1 / np.array(YARDSTICKS))])
    return np.linalg.lstsq(tall, -np.concatenate([e, np.zeros(3)]), rcond=None)[0]


@mistake("damped_step", "p_i is divided by its yardstick, and not multiplied")
def damped_step_times(e, J, damping, *, YARDSTICKS):
    return damped_step.solution(e, J, damping, YARDSTICKS=[1 / y for y in YARDSTICKS])


@mistake("damped_step", "the yardsticks are squared with p_i")
def damped_step_without_squares(e, J, damping, *, YARDSTICKS):
    return damped_step.solution(e, J, damping, YARDSTICKS=[np.sqrt(y) for y in YARDSTICKS])


@variant(
    "gain",
    points=2,
    minutes=15,
    draw=lambda rng: {"SIGMAS": rounded(rng, 0.21, 1.9, count=4, digits=3)},
    arguments=lambda rng, numbers: (
        *rng.standard_normal((2, 4)),
        rng.standard_normal((4, 2)),
        rng.standard_normal(2),
    ),
    within=1e-6,
)
def gain(e: Array, after: Array, J: Array, p: Array, *, SIGMAS: list[float]) -> float:
    """The actual fall of the cost over the fall that the linear model e + J p promised.

    The cost is half the sum of squares of the whitened residual: row i of every residual has the standard
    deviation SIGMAS[i]. `after` is the residual where the step p leads.

    e (4,), after (4,), J (4, 2), p (2,), none of them whitened -> a number
    """
    s = np.array(SIGMAS)
    before, then, model = (np.sum((r / s) ** 2) for r in (e, after, e + J @ p))
    return (before - then) / (before - model)


@mistake("gain", "the residuals are to be divided by their standard deviations")
def gain_without_sigmas(e, after, J, p, *, SIGMAS):
    return gain.solution(e, after, J, p, SIGMAS=[1.0] * 4)


@mistake("gain", "upside down: what came stands above, what was promised below")
def gain_upside_down(e, after, J, p, *, SIGMAS):
    return 1 / gain.solution(e, after, J, p, SIGMAS=SIGMAS)


@variant(
    "cauchy_point",
    points=2,
    minutes=20,
    draw=lambda rng: {"SCALES": rounded(rng, 0.23, 2.9, count=3, digits=3)},
    arguments=lambda rng, numbers: linear(rng),
)
def cauchy_point(e: Array, J: Array, *, SCALES: list[float]) -> Array:
    """The step along the steepest descent at which |e + J p| is least, if lengths are scaled.

    Of all p of the same length sqrt(sum over i of (p_i / SCALES[i])^2), the direction of steepest
    descent is that in which the cost falls fastest at p = 0. It is not -J'e.

    e (m,), J (m, 3) -> (3,)
    """
    direction = -(np.array(SCALES) ** 2) * (J.T @ e)
    along = J @ direction
    return -(e @ along) / (along @ along) * direction


@mistake("cauchy_point", "the scales are squared: once for the gradient, and once for the step")
def cauchy_point_without_squares(e, J, *, SCALES):
    return cauchy_point.solution(e, J, SCALES=[np.sqrt(y) for y in SCALES])


@variant(
    "dogleg_step",
    points=3,
    minutes=25,
    draw=lambda rng: {"AXES": rounded(rng, 0.41, 2.4, count=2, digits=3)},
    arguments=lambda rng, numbers: (
        np.array([2.0, 2.5]) + rng.uniform(-0.4, 0.4, 2),
        np.array([0.8, 0.1]) + rng.uniform(-0.1, 0.1, 2),
        rng.uniform(0.2, 2.0),
    ),
    edges=lambda numbers: [(np.array([2.0, 1.0]), np.array([0.4, 0.1]), 50.0)],
)
def dogleg_step(newton: Array, cauchy: Array, radius: float, *, AXES: list[float]) -> Array:
    """The step of Powell's dogleg, where the trust region is an ellipse.

    It is where the path 0 - cauchy - newton leaves the set of all p with
    sqrt(sum over i of (p_i / AXES[i])^2) <= radius, or `newton`, if that is inside.

    newton (2,), cauchy (2,), which is the shorter in this measure, radius > 0 -> (2,)
    """
    y = np.array(AXES)
    n, c = newton / y, cauchy / y
    if np.linalg.norm(n) <= radius:
        return newton
    if np.linalg.norm(c) >= radius:
        return cauchy * radius / np.linalg.norm(c)
    leg = n - c
    a, b, d = leg @ leg, c @ leg, c @ c - radius**2
    return y * (c + leg * (-b + np.sqrt(b * b - a * d)) / a)


@mistake("dogleg_step", "this measures with a plain length; the radius is that of an ellipse")
def dogleg_step_in_a_ball(newton, cauchy, radius, *, AXES):
    return dogleg_step.solution(newton, cauchy, radius, AXES=[1.0, 1.0])
