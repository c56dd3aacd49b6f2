"""Exercises of lecture 1, a body model is a function.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
Angles are in radians, lengths in metres. Then

    workbench lecture check 1 lec01_function.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def polynomial(w: Array, x: float) -> float:
    """The value at x of a polynomial with these coefficients, that of the highest power last.

    w (d + 1,): w[0] + w[1] x + w[2] x^2 + ...; x a number -> a number
    """
    raise Unsolved("polynomial")


def linear_fit(x: Array, v: Array) -> tuple[Array, Array]:
    """The map x -> A x + b that is nearest to examples, in the sum of squares over all of them.

    x (n, d), v (n, m), an example in each row, n > d -> A (m, d), b (m,)
    """
    raise Unsolved("linear_fit")


def shortening(alpha: float) -> float:
    """The length of a bone of length 1 halfway through a turn, by the mean of its two ends' places.

    The bone turns about one end by alpha; the other end is averaged between before and after.

    alpha rad, in [0, pi] -> a number, the share of the length
    """
    raise Unsolved("shortening")


def parameter_count(N: int, K: int, B: int) -> dict[str, int]:
    """How many numbers the arrays of a body in SMPL's form hold, stored dense.

    N vertices, K joints with the root among them, B shape directions
    -> template, shapedirs, posedirs, weights, J_regressor, each with its count
    """
    raise Unsolved("parameter_count")


def is_linear(f, n: int) -> bool:
    """Whether f is linear, up to a constant: f(x) = A x + b. Use values of f alone.

    f takes (n,) and answers (m,), and is smooth -> True or False
    """
    raise Unsolved("is_linear")


def predict(x: Array, v: Array, new: Array) -> Array:
    """Learn from examples where a hand is, and predict it for other angles to within 1 mm.

    An arm of two bones in the plane, whose lengths are not given, hangs on a shoulder somewhere; x are
    its angles, that of the elbow counted from the upper arm. New angles may be any: other ones than
    in the examples, or several turns further. How you do it is up to you: which functions of the
    angles is the hand's place linear in?

    x (n, 2) rad, v (n, 2) m, without noise; new (k, 2) rad -> (k, 2) m
    """
    raise Unsolved("predict")
