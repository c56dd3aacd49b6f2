"""Exercises of lecture 6, least squares.

Write each answer in place of the line that raises `Unsolved`, and keep the names, arguments and shapes.
Angles are in radians, lengths in metres. This command grades the file:

    workbench lecture check 6 lec06_least_squares.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray

UPPER, LOWER, HAND = 0.30, 0.25, 0.18  # m; the arm of the lecture, with a hand at its end


def residual(x: Array, seen: Array) -> Array:
    """Where an arm with a hand has its points, minus where they were seen.

    It is the arm of the lecture with a third bone of length HAND, from the wrist to the fingertip. This
    bone points in the direction of the angle a + b + c.

    x (3,) rad, the angles a, b, c; seen (6,) m: x and y of elbow, wrist and tip -> (6,) m
    """
    raise Unsolved("residual")


def jacobian(x: Array) -> Array:
    """The derivatives of that residual, as formulas: a row for each entry of the residual.

    x (3,) rad -> (6, 3) m/rad
    """
    raise Unsolved("jacobian")


def gradient(e: Array, J: Array) -> Array:
    """The gradient of the sum of squares F = e'e, from the residual and its Jacobian.

    e (m,), J (m, n) -> (n,)
    """
    raise Unsolved("gradient")


def numeric_jacobian(f, x: Array) -> Array:
    """The Jacobian of any function, from its values alone.

    The error must be below 1e-8 if f and its derivatives are of order one. One-sided differences are not
    accurate enough.

    f takes an array (n,) and returns an array (m,); x (n,) -> (m, n)
    """
    raise Unsolved("numeric_jacobian")


def gauss_newton_step(e: Array, J: Array) -> Array:
    """The p with the least |e + J p|^2, to seven digits even if columns are nearly alike.

    The condition number of J'J is the square of that of J; NumPy can solve least squares without J'J.

    e (m,), J (m, n) with m >= n and independent columns -> (n,)
    """
    raise Unsolved("gauss_newton_step")


def left_out(x: Array, seen: Array) -> float:
    """The part of the curvature that Gauss-Newton leaves out, over the part that it keeps, for one bone.

    The bone has the length UPPER and turns about the origin; the residual e is its tip minus `seen`. If
    s is the sum of e_i times the second derivative of e_i, the answer is s / J'J, with its sign.

    x (1,) rad, the bone's angle; seen (2,) m -> a number
    """
    raise Unsolved("left_out")


def fit(f, J, x: Array) -> Array:
    """The x with the least |f(x)|^2, from a start that may be far away, by any method.

    The gradient at your answer must be below 1e-6 in every entry. Full Gauss-Newton steps do not always
    get there, and neither do 100 steps of steepest descent.

    f and J are functions, (n,) -> (m,) and (n,) -> (m, n); x (n,) is the start -> (n,)
    """
    raise Unsolved("fit")
