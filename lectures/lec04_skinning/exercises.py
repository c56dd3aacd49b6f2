"""Exercises of lecture 4, skinning.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
Angles are in radians, lengths in metres. Then

    workbench lecture check 4 lec04_skinning.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def blend(points: Array, motions: Array, weights: Array) -> Array:
    """Linear blend skinning.

    points (N, 3) m; motions (K, 3, 4), each [R t], with t in m; weights (N, K), rows summing to one
    -> (N, 3) m
    """
    raise Unsolved("blend")


def radius_left(weight: float, angle: float) -> float:
    """What linear blending leaves of the radius of a ring, where a limb is twisted.

    The ring follows the twisted bone with `weight`, and the one that stays with the rest.

    weight from 0 to 1; angle rad, of the twist -> a share
    """
    raise Unsolved("radius_left")


def volume_lost(area: float, zone: float, angle: float) -> float:
    """The volume that linear blending takes from a twisted tube of cross-section `area`.

    The weight goes from 0 to 1 in a straight line over a length `zone`.

    area m^2; zone m; angle rad -> m^3
    """
    raise Unsolved("volume_lost")


def blended_turn(weight: float, angle: float) -> float:
    """By which angle a vertex is turned by blended quaternions.

    One joint stays, and one turns by `angle` about an axis, with `weight`; as in the lecture, the
    quaternions are averaged and brought to length one.

    weight from 0 to 1; angle rad, from 0 to pi -> rad, about the same axis
    """
    raise Unsolved("blended_turn")


def blend_quaternions(Q: Array, weights: Array) -> Array:
    """The blended quaternion of length one, with either sign.

    q and -q are the same rotation, and you are given either: before they are added, give each the
    sign with which it is nearer to the one that weighs most, so that the signs in which they were
    given do not matter.

    Q (K, 4), each w x y z of length one; weights (K,), summing to one -> (4,)
    """
    raise Unsolved("blend_quaternions")


def weights(s: Array) -> Array:
    """Weights along a forearm that has helpers: five bones in a row, that share the twist.

    When the hand turns by 180 degrees, they turn about the forearm by 0, 45, 90, 135 and 180
    degrees. A ring at s = 0 (the elbow) follows the first bone alone, one at s = 1 the last one
    alone. Between them, linear blending must leave at least 0.9 of every radius, and rings that are a
    hundredth of the length apart must not be turned by more than 5 degrees against each other.

    s (n,), from 0 to 1 -> (n, 5), not negative, rows summing to one
    """
    raise Unsolved("weights")


def first_weights(segments: Array, edges: Array, lengths: Array, border: float) -> Array:
    """First blend weights from a segmentation, by one implicit step of the heat equation.

    Solve (I + border^2 L / 2) W = W_0. W_0 has a one in each row, in the column of the vertex's
    segment. L has -1 / length^2 for the two vertices of an edge, and on the diagonal what makes the
    sum of each row zero. Keep all weights, however small.

    segments (N,) whole numbers from 0 to K - 1, each used; edges (E, 2) vertices; lengths (E,) m;
    border m -> (N, K)
    """
    raise Unsolved("first_weights")
