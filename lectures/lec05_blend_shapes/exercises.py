"""Exercises of lecture 5, blend shapes.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
Angles are in radians, lengths in metres. Then

    workbench lecture check 5 lec05_blend_shapes.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def shares(x: Array, examples: Array, width: float) -> Array:
    """The share of each example: exp(-|x - x_i|^2 / width^2), divided by the sum of all.

    The lecture's tau is width^2.

    x (D,) rad; examples (n, D) rad; width rad -> (n,)
    """
    raise Unsolved("shares")


def exact(x: Array, examples: Array, width: float) -> Array:
    """Coefficients that bring each example's own shape back exactly where the example is.

    Sums of the kernels exp(-|x - x_i|^2 / width^2), not divided by anything, that are 1 at their
    own example and 0 at all others.

    x (D,) rad; examples (n, D) rad; width rad -> (n,)
    """
    raise Unsolved("exact")


def features(R: Array) -> Array:
    """SMPL's features of a pose: elements of R_k - I, row by row, of every joint but the root.

    R (K, 3, 3), the root first -> (9 (K - 1),)
    """
    raise Unsolved("features")


def learn(F: Array, D: Array, ridge: float) -> Array:
    """Pose blend shapes from examples: least in |F P - D|^2 + ridge |P|^2, all squares summed.

    F (n, f), the features of n poses; D (n, m) m, the displacements in these poses; ridge above 0
    -> P (f, m) m
    """
    raise Unsolved("learn")


def directions(people: Array, k: int) -> tuple[Array, Array]:
    """Mean and k shape directions of people, scaled so that betas are in standard deviations.

    Principal components; over the n people each of the k betas has mean 0 and variance 1, taken
    with n - 1.

    people (n, m) m, a person's coordinates in each row -> (mean (m,) m, S (m, k) m)
    """
    raise Unsolved("directions")


def regressor(people: Array, joints: Array) -> Array:
    """Weights of vertices, not negative and of sum one, whose mean is a joint of these people.

    For people who were not among them it must be right to 3 mm. There are more vertices than
    equations, the joints have noise of 1 mm, and the true weights are few.

    people (n, N, 3) m; joints (n, 3) m -> (N,)
    """
    raise Unsolved("regressor")


def mixed(
    mean_1: Array, C_1: Array, mean_2: Array, C_2: Array, share: float
) -> tuple[Array, Array]:
    """Mean and covariance of everybody, if the people are of two groups.

    A share of all people is of the first group, the others are of the second.

    mean_1 and mean_2 (m,) m; C_1 and C_2 (m, m) m^2, their covariances; share from 0 to 1
    -> (mean (m,) m, C (m, m) m^2)
    """
    raise Unsolved("mixed")
