"""Exercises of lecture 7, trust regions.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
The cost is F = e'e / 2, so its gradient is J'e. Then

    workbench lecture check 7 lec07_trust_region.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def damped_step(e: Array, J: Array, damping: float) -> Array:
    """The p that is least in |e + J p|^2 + damping |p|^2.

    Columns of J may depend on each other: with damping above 0 there is one answer all the same.

    e (m,), J (m, n), damping > 0 -> (n,)
    """
    raise Unsolved("damped_step")


def gain(f, e: Array, J: Array, x: Array, p: Array) -> float:
    """The actual fall of the cost over the fall that the linear model e + J p promised.

    f answers the residual at any point: f(x) is e, f(x + p) is where the step leads. The cost is half
    the sum of squares.

    f takes (n,) and answers (m,); e (m,), J (m, n), x (n,), p (n,) -> a number
    """
    raise Unsolved("gain")


def cauchy_point(e: Array, J: Array) -> Array:
    """The step along the steepest descent -J'e at which |e + J p| is least.

    e (m,), J (m, n) -> (n,)
    """
    raise Unsolved("cauchy_point")


def dogleg_step(newton: Array, cauchy: Array, radius: float) -> Array:
    """The step of Powell's dogleg: where the path 0 - cauchy - newton leaves the ball |p| <= radius.

    The Gauss-Newton step itself, if that is inside.

    newton (n,), cauchy (n,) with |cauchy| <= |newton|, radius > 0 -> (n,)
    """
    raise Unsolved("dogleg_step")


def damping_for(e: Array, J: Array, radius: float) -> float:
    """The damping whose step is as long as the radius; 0 if Gauss-Newton's step is inside already.

    To six digits of the damping. The columns of J are independent.

    e (m,), J (m, n), radius > 0 -> a number, 0 or more
    """
    raise Unsolved("damping_for")


def fit(f, J, x: Array) -> Array:
    """The x that is least in |f(x)|^2, by Levenberg-Marquardt, a dogleg, or what you like better.

    The gradient J'f at your answer must be below 1e-6 in every entry, and the sum of squares not above
    that of the start. Gauss-Newton with halved steps is not enough: columns of J can become dependent
    on the way, and the residual need not vanish.

    f takes (n,) and answers (m,), J takes (n,) and answers (m, n); x (n,) -> (n,)
    """
    raise Unsolved("fit")
