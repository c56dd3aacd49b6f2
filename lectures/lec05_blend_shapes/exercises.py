"""Exercises of lecture 5, blend shapes.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
Lengths are in metres, angles in radians; D is the number of a pose's numbers, m that of a shape's.
Then

    workbench lecture check 5 lec05_blend_shapes.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def features(R: Array) -> Array:
    """SMPL's pose features: R_k - I of every joint but the root (k = 0), row by row, joint by joint.

    R (K, 3, 3), the rotations of all joints -> (9 (K - 1),)
    """
    raise Unsolved("features")


def shares(theta: Array, places: Array, width: float) -> Array:
    """The share of each example: K_i = exp(-|theta - place_i|^2 / width^2), over the sum of all K.

    They have to be numbers also where every K_i is zero in the computer, 100 widths away; the
    largest exponent may be subtracted from all of them, above and below.

    theta (D,) rad, places (n, D) rad, width in rad -> (n,), of sum one
    """
    raise Unsolved("shares")


def solved_shapes(places: Array, shapes: Array, width: float) -> Array:
    """The Q_j with sum over j of K_j(place_i) Q_j = P_i: kernels, not divided, that meet all examples.

    places (n, D) rad, shapes (n, m) m, the P_i; width in rad -> (n, m) m
    """
    raise Unsolved("solved_shapes")


def displacement(weights: Array, R: Array, rest: Array, posed: Array) -> Array:
    """What has to be added to the rest surface, so that linear blending takes it to the posed one.

    The bones turn about the origin and do not move otherwise: M_i = sum over k of w_ik R_k.

    weights (N, K), R (K, 3, 3), rest (N, 3) m, posed (N, 3) m -> (N, 3) m
    """
    raise Unsolved("displacement")


def person(template: Array, shapedirs: Array, regressor: Array, lengths: Array, c: Array):
    """A person at rest, and their joints, as SMPL has them, from coordinates c in metres.

    The columns of shapedirs are for betas in standard deviations; c is along columns of length one
    (c_m = |S_m| beta_m), whose lengths before are given: lengths_m = |S_m|.

    template (N, 3) m, shapedirs (N, 3, B) m, regressor (K, N), lengths (B,) m, c (B,) m
    -> a tuple of vertices (N, 3) m and joints (K, 3) m
    """
    raise Unsolved("person")


def predict(poses: Array, shapes: Array, asked: Array) -> Array:
    """Blend shapes of one joint for poses that nobody has seen, learned from examples. Any method.

    It is held to three things: zero at rest; the same for all vectors of one rotation (also those
    longer than pi); and in poses like the examples, off by at most a tenth of the shapes' own rms.

    poses (n, 3) rad, rotation vectors; shapes (n, m) m; asked (q, 3) rad -> (q, m) m
    """
    raise Unsolved("predict")
