"""Exercises of lecture 2, rotations.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
Angles are in radians, rotation vectors w = angle times axis. Then

    workbench lecture check 2 lec02_rotations.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def hat(w: Array) -> Array:
    """The matrix of the cross product: hat(w) @ v is w x v, for every v.

    w (3,) -> (3, 3)
    """
    raise Unsolved("hat")


def rodrigues(w: Array) -> Array:
    """The rotation matrix exp(hat(w)) of a rotation vector, by Rodrigues' formula.

    It has to be right for every w: also for w = 0, and for |w| = 1e-9 rad.

    w (3,) rad -> (3, 3)
    """
    raise Unsolved("rodrigues")


def angle_between(A: Array, B: Array) -> float:
    """The angle, in [0, pi] rad, of the rotation that leads from A to B.

    It has to be good to nine digits, also where A and B are only 1e-6 rad apart.

    A, B (3, 3), rotations -> a number
    """
    raise Unsolved("angle_between")


def shorter(w: Array) -> Array:
    """The rotation vector of the same rotation whose angle is at most pi.

    Think of w that are several turns long, and of w = 0.

    w (3,) rad -> (3,) rad
    """
    raise Unsolved("shorter")


def nearest_rotation(M: Array) -> Array:
    """The rotation nearest to a matrix: least in the sum of squared differences of entries.

    A reflection is no rotation: det R = +1, whatever M is.

    M (3, 3) -> (3, 3)
    """
    raise Unsolved("nearest_rotation")


def mean_rotation(rotations: Array) -> Array:
    """A mean: the rotation R that is least in the sum over n of ||R - R_n||^2 (Frobenius).

    How you find it is up to you: a formula, a search, the exercise above.

    rotations (n, 3, 3), within a quarter turn of each other -> (3, 3)
    """
    raise Unsolved("mean_rotation")


def third(s: float) -> Array:
    """(t - sin t) / t^3 as a function of s = t^2: its value, first and second derivative by s.

    It stands beside sin t / t and (1 - cos t) / t^2 when rotations are added up over time. All three
    have to be right to 1e-6 for every s from 0 to 40, at s = 0 and near it too. CasADi can
    differentiate for you, wherever the expression neither divides 0 by 0 nor cancels digits.

    s, a number, rad^2 -> (3,)
    """
    raise Unsolved("third")
