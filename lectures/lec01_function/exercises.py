"""Exercises of lecture 1, a body model is a function.

Write each answer in place of the line that raises `Unsolved`, and keep the names, arguments and shapes.
Angles are in radians, lengths in metres. This command grades the file:

    workbench lecture check 1 lec01_function.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def polynomial(w: Array, x: float) -> float:
    """The value at x of the polynomial with the coefficients w, in which the highest power comes last.

    w (d + 1,): w[0] + w[1] x + w[2] x^2 + ...; x a number -> a number
    """
    raise Unsolved("polynomial")


def linear_fit(x: Array, v: Array) -> tuple[Array, Array]:
    """The map x -> A x + b with the least sum of squared errors over all examples.

    x (n, d), v (n, m), one example in each row, n > d -> A (m, d), b (m,)
    """
    raise Unsolved("linear_fit")


def shortening(alpha: float) -> float:
    """How long a bone of length 1 becomes if positions are averaged over the two ends of a turn.

    The bone turns by alpha about one of its ends. The other end is put halfway between where it was
    before the turn and where it is after it.

    alpha rad, in [0, pi] -> a number, the new length over the true one
    """
    raise Unsolved("shortening")


def parameter_count(N: int, K: int, B: int) -> dict[str, int]:
    """How many numbers the arrays of a body in SMPL's form hold, zeros included.

    N vertices, K joints with the root among them, B shape directions
    -> template, shapedirs, posedirs, weights, J_regressor, each with its count
    """
    raise Unsolved("parameter_count")


def is_linear(f, n: int) -> bool:
    """Whether f is linear up to a constant, f(x) = A x + b, judged from values of f alone.

    f takes an array (n,), returns an array (m,), and is smooth -> True or False
    """
    raise Unsolved("is_linear")


def predict(x: Array, v: Array, new: Array) -> Array:
    """Learn from examples where a hand is, and predict it for other angles to within 1 mm.

    An arm in the plane has two bones of unknown length and a shoulder at an unknown place. x holds the
    angle of the shoulder and that of the elbow, which is counted from the upper arm. The new angles may
    be any angles, also several turns away from those of the examples. The method is up to you. A hint:
    which functions of the angles does the position of the hand depend on linearly?

    x (n, 2) rad, v (n, 2) m, without noise; new (k, 2) rad -> (k, 2) m
    """
    raise Unsolved("predict")
