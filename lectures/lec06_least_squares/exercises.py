"""Exercises of lecture 6, least squares.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
Angles are in radians, lengths in metres. Then

    workbench lecture check 6 lec06_least_squares.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray

UPPER, LOWER = 0.30, 0.25  # m, the two bones of the lecture's arm


def residual(x: Array, seen: Array) -> Array:
    """What the arm of the lecture says, minus what was seen.

    x (2,) rad, the angles a and b; seen (4,) m: elbow x, elbow y, wrist x, wrist y -> (4,) m
    """
    raise Unsolved("residual")


def jacobian(x: Array) -> Array:
    """The derivatives of that residual, worked out by hand: a row for each entry of the residual.

    x (2,) rad -> (4, 2) m/rad
    """
    raise Unsolved("jacobian")


def gradient(e: Array, J: Array) -> Array:
    """The gradient of the sum of squares F = e'e, from the residual and its Jacobian.

    e (m,), J (m, n) -> (n,)
    """
    raise Unsolved("gradient")


def numeric_jacobian(f, x: Array) -> Array:
    """The Jacobian of any function, from its values alone.

    Good to 1e-8 where f and its derivatives are of order one: forward differences will not do.

    f takes (n,) and answers (m,); x (n,) -> (m, n)
    """
    raise Unsolved("numeric_jacobian")


def gauss_newton_step(e: Array, J: Array) -> Array:
    """The p that is least in |e + J p|^2, good to seven digits also where columns are nearly alike.

    The condition of J'J is the square of that of J; NumPy can solve least squares without it.

    e (m,), J (m, n) with m >= n and independent columns -> (n,)
    """
    raise Unsolved("gauss_newton_step")


def left_out(x: Array, seen: Array) -> float:
    """How much of the curvature Gauss-Newton leaves out for one bone, over what it keeps.

    The bone is UPPER long and turns about the origin; the residual is its tip minus `seen`. With
    s = the sum of e_i times the second derivative of e_i: s / J'J, with its sign.

    x (1,) rad, the bone's angle; seen (2,) m -> a number
    """
    raise Unsolved("left_out")


def fit(f, J, x: Array) -> Array:
    """The x that is least in |f(x)|^2, from a start that may be far: any method that gets there.

    The gradient at your answer must be below 1e-6 in every entry. Full steps of Gauss and Newton
    are not always enough; nor are 100 steps of steepest descent.

    f (n,) -> (m,), J (n,) -> (m, n), both functions; x (n,) the start -> (n,)
    """
    raise Unsolved("fit")
