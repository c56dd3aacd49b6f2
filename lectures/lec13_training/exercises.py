"""Exercises of lecture 13, training.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
Lengths are in metres. Then

    workbench lecture check 13 lec13_training.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def unposed(M: Array, m: Array, V: Array) -> Array:
    """The rest vertices t_i that v_i = M_i t_i + m_i takes to V. M_i is a blend of rotations.

    M (N, 3, 3), m (N, 3) m, V (N, 3) m -> (N, 3) m
    """
    raise Unsolved("unposed")


def pose_blend_shapes(X: Array, D: Array, price: float) -> Array:
    """The P that is least in |X P - D|^2 + price |P|^2, both the sum of squares of all entries.

    X (n, F), a pose's features in each row; D (n, d) m; price > 0 -> (F, d) m
    """
    raise Unsolved("pose_blend_shapes")


def taught_by() -> dict[str, str]:
    """Which set teaches which part of SMPL: "multi-pose" (few people, many poses) or "multi-shape".

    -> a dict with the keys "P" (pose blend shapes), "W" (weights), "J" (joint regressor),
    "T" (the template), "S" (shape directions)
    """
    raise Unsolved("taught_by")


def shape_directions(people: Array, k: int) -> Array:
    """The first k shape directions of un-posed people: as long as one standard deviation along each.

    Standard deviations divide by P - 1. Either sign will do.

    people (P, n) m, a person in each row, k < P -> (k, n) m, a direction in each row
    """
    raise Unsolved("shape_directions")


def joint_shares(V: Array, joints: Array) -> Array:
    """The shares w, none below 0 and 1 in sum, least in the sum over people of |w V_s - j_s|^2.

    To six digits of that sum. scipy.optimize may help.

    V (S, N, 3) m, joints (S, 3) m, one joint of each person -> (N,)
    """
    raise Unsolved("joint_shares")


def shape_of(scans: Array) -> Array:
    """The shape T of a stiff thing, from scans V_j = T R_j' with noise and rotations R_j unknown.

    Least in the sum of |T R_j' - V_j|^2; the sum at your answer, each R_j being its best one, must not
    be above 1.0001 times the least. T is known but for a rotation: any will do. Scans are centred.

    scans (S, N, 3) m -> (N, 3) m
    """
    raise Unsolved("shape_of")
