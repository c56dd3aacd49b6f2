"""Exercises of lecture 13, training a body model.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
Lengths are in metres. This command grades the file:

    workbench lecture check 13 lec13_training.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def taught_by() -> dict[str, str]:
    """Which set of registrations teaches what: "multi-pose" or "multi-shape" for each name.

    -> a dict with the keys "template", "shapedirs", "posedirs", "weights", "J_regressor"
    """
    raise Unsolved("taught_by")


def unevenness(T: Array, opposite: Array) -> float:
    """|T - U(T)|^2, where U is the mirror at x = 0: zero for a body that is alike on both sides.

    T (N, 3) m; opposite (N,) whole numbers, the vertex on the other side of each -> a number, m^2
    """
    raise Unsolved("unevenness")


def ridge(F: Array, D: Array, penalty: float) -> Array:
    """The P that is least in sum over j of |D_j - P F_j|^2 + penalty times the sum of squares of P.

    F (J, f), the features of each mesh; D (J, m) m, its displacements -> (m, f) m
    """
    raise Unsolved("ridge")


def shape_space(people: Array, B: int):
    """The mean and the first B principal directions, scaled so that betas have variance one.

    That is the variance with n - 1 below. Signs are up to you.

    people (n, m) m, a person in each row -> a tuple of mean (m,) m and directions (m, B) m
    """
    raise Unsolved("shape_space")


def weights_of(reached: Array, seen: Array) -> Array:
    """The weights of one vertex: least in sum over j of |sum over k of w_k reached_jk - seen_j|^2,
    with no weight below zero and their sum one.

    reached (J, K, 3) m: where bone k alone would take the vertex in pose j; seen (J, 3) m -> (K,)
    """
    raise Unsolved("weights_of")


def rest_shape(meshes: Array) -> Array:
    """Training in small: the shape of a rigid thing that was seen in many places.

    That is the T that is least in min over R_j, t_j of sum over j of |R_j T_i + t_j - V_ji|^2, R_j
    rotations. Where T stands, and how it is turned, is up to you; take turns until nothing changes.
    (The best R, t for two sets of points: mean on mean; then with A the sum over i of
    V_i T_i', both less their means, and A = U S V', the R = U diag(1, 1, det(U V')) V'.)

    meshes (J, N, 3) m -> (N, 3) m
    """
    raise Unsolved("rest_shape")
