"""Conjugate gradients within a trust region, on named arrays.

The step grows with every iteration (Steihaug 1983). It ends where it leaves the region, where the
residual is small enough, or where rounding leaves no curvature.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from workbench.training.estimate import Change

Operator = Callable[[Change], Change]


@dataclass(frozen=True, eq=False)
class Step:
    """A step of conjugate gradients.

    Attributes:
        change: the change of each name.
        length: the length of the step in the norm of the preconditioner.
        predicted: the decrease of the cost that the linear model predicts.
        iterations: the number of products.
        inside: whether the step is shorter than the trust region's radius.
    """

    change: Change
    length: float
    predicted: float
    iterations: int
    inside: bool


def solve(
    product: Operator,
    preconditioned: Operator,
    slope: Change,
    *,
    radius: float = inf,
    tolerance: float = 1e-10,
    most: int = 500,
) -> Step:
    """The step x that minimises -slope . x + x . A x / 2 within the radius.

    `tolerance` is on |r| / |slope| in the norm of the preconditioner, `most` on the iterations.
    """
    x = {name: np.zeros_like(g) for name, g in slope.items()}
    r = slope
    z = preconditioned(r)
    p = z
    rz = first = dot(r, z)
    xx, xp, pp = 0.0, 0.0, rz  # squared lengths in the preconditioner's norm
    predicted, iterations = 0.0, 0
    while iterations < most and rz > tolerance**2 * first and rz > 0:
        Ap = product(p)
        curvature = dot(p, Ap)
        if curvature <= 0:
            break
        alpha = rz / curvature
        ahead = xx + 2 * alpha * xp + alpha**2 * pp
        iterations += 1
        if ahead > radius**2:
            alpha = (-xp + sqrt(max(xp**2 + pp * (radius**2 - xx), 0.0))) / pp
            x = plus(x, p, alpha)
            predicted += alpha * rz - 0.5 * alpha**2 * curvature
            return Step(x, radius, predicted, iterations, inside=False)
        x, r = plus(x, p, alpha), plus(r, Ap, -alpha)
        predicted += 0.5 * alpha * rz
        z = preconditioned(r)
        rz, before = dot(r, z), rz
        beta = rz / before
        xx, xp, pp = ahead, beta * (xp + alpha * pp), rz + beta**2 * pp
        p = plus(z, p, beta)
    return Step(x, sqrt(xx), predicted, iterations, inside=True)


def dot(a: Change, b: Change) -> float:
    """The inner product of two changes."""
    return sum(float(np.vdot(a[name], b[name])) for name in a)


def plus(a: Change, b: Change, share: float) -> Change:
    """The change a + share b."""
    return {name: a[name] + share * b[name] for name in a}
