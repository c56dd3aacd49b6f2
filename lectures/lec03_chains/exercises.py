"""Exercises of lecture 3, kinematic chains.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
Rotations are matrices, lengths in metres. `parents[k]` is the joint that joint k hangs on, before k
in the list; -1 for the root, joint 0. Then

    workbench lecture check 3 lec03_chains.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def inverse(G: Array) -> Array:
    """The inverse of a rigid motion [R t; 0 1], by transposing and multiplying alone.

    G (4, 4) -> (4, 4)
    """
    raise Unsolved("inverse")


def turned_body(vertices: Array, pelvis: Array, R: Array) -> Array:
    """The whole surface after the root alone has turned: SMPL turns it about the pelvis.

    vertices (N, 3) m, at rest; pelvis (3,) m; R (3, 3), the root's rotation -> (N, 3) m
    """
    raise Unsolved("turned_body")


def world_rotations(R: Array, parents: list[int]) -> Array:
    """How each joint is turned in the world, from how each is turned relative to its parent.

    R (K, 3, 3), parents (K,) -> (K, 3, 3)
    """
    raise Unsolved("world_rotations")


def posed_joints(R: Array, joints: Array, parents: list[int]) -> Array:
    """Where the joints are after all of them have turned; the root stays in its place.

    R (K, 3, 3), relative to the parent; joints (K, 3) m, at rest, where no joint is turned;
    parents (K,) -> (K, 3) m
    """
    raise Unsolved("posed_joints")


def binding(R: Array, joints: Array, parents: list[int]) -> Array:
    """The matrices G_k(pose) G_k(rest)^-1 that take points of the surface at rest to the posed one.

    R (K, 3, 3), relative to the parent; joints (K, 3) m, at rest, where no joint is turned;
    parents (K,) -> (K, 4, 4)
    """
    raise Unsolved("binding")


def reach(bones: Array, target: Array) -> Array:
    """A pose in which the tip of an arm is at a target, or as near to it as the arm can get.

    The arm is a chain without branches. Its root is at the origin; bones[k] leads from joint k to
    joint k + 1 while nothing is turned, the last bone to the tip. The answer is a rotation vector
    for each joint, relative to the joint before. Any pose will do that brings the tip to within
    1e-4 m of the target, or of the least distance that there is. Every target is further away
    than the longest bone, so nothing has to be folded up.
    `scipy.optimize.least_squares` looks for numbers that make a function's entries small.

    bones (n, 3) m; target (3,) m -> (n, 3) rad
    """
    raise Unsolved("reach")
