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
    """How much each example's shape counts at x, such that at an example only its own shape counts.

    The third way of the lecture: coefficient j is a sum over i of the kernels
    exp(-|x - x_i|^2 / width^2), each with a factor that you solve for. At example j it has to be
    one, and at all other examples zero.

    x (D,) rad; examples (n, D) rad; width rad -> (n,)
    """
    raise Unsolved("exact")


def features(R: Array) -> Array:
    """SMPL's features of a pose: elements of R_k - I, row by row, of every joint but the root.

    R (K, 3, 3) for K joints, the root first and counted in K -> (9 (K - 1),)
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

    The directions are the first k principal components, the one of largest variance first. Over
    the n people, each of the k betas has the mean 0 and the variance 1, where the variance is the
    sum of squares over n - 1. Each direction may have either sign.

    people (n, m) m, a person's coordinates in each row -> (mean (m,) m, S (m, k) m)
    """
    raise Unsolved("directions")


def regressor(people: Array, joints: Array) -> Array:
    """Weights of vertices, none negative and of sum one, with which their mean is a joint of these people.

    For people who were not among them the joint must be right to 3 mm on average. A person gives
    three equations, one for each coordinate, and all people together fewer equations than there are
    vertices. The joints have a noise of 1 mm, and only a few of the true weights are not zero. The
    lecture's section on joints names a function and a way to ask for the sum.

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
