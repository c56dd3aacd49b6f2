"""Exercises of lecture 3, kinematic chains.

Write each answer in place of the line that raises `Unsolved`, and keep the names, arguments and shapes.
Rotations are matrices, and lengths are in metres. `parents[k]` is the joint on which joint k hangs; it
comes before k in the list, and is -1 for the root, joint 0. This command grades the file:

    workbench lecture check 3 lec03_chains.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def inverse(G: Array) -> Array:
    """The inverse of a rigid motion [R t; 0 1], computed by transposing and multiplying only.

    G (4, 4) -> (4, 4)
    """
    raise Unsolved("inverse")


def turned_body(vertices: Array, pelvis: Array, R: Array) -> Array:
    """The whole surface after the root alone has turned: SMPL turns it about the pelvis.

    vertices (N, 3) m, at rest; pelvis (3,) m; R (3, 3), the root's rotation -> (N, 3) m
    """
    raise Unsolved("turned_body")


def world_rotations(R: Array, parents: list[int]) -> Array:
    """The rotation of each joint in the world, from the rotations relative to the parents.

    R (K, 3, 3), parents (K,) -> (K, 3, 3)
    """
    raise Unsolved("world_rotations")


def posed_joints(R: Array, joints: Array, parents: list[int]) -> Array:
    """Where the joints are after all of them have turned; the root stays where it is.

    R (K, 3, 3), relative to the parent; joints (K, 3) m, at rest, where no joint is turned;
    parents (K,) -> (K, 3) m
    """
    raise Unsolved("posed_joints")


def binding(R: Array, joints: Array, parents: list[int]) -> Array:
    """The matrices G_k(pose) G_k(rest)^-1, which move points from the surface at rest to the posed one.

    R (K, 3, 3), relative to the parent; joints (K, 3) m, at rest, where no joint is turned;
    parents (K,) -> (K, 4, 4)
    """
    raise Unsolved("binding")


def reach(bones: Array, target: Array) -> Array:
    """A pose in which the tip of an arm is at a target, or as near to the target as it can get.

    The arm is a chain without branches. Its root is at the origin; when nothing is turned, bones[k]
    leads from joint k to joint k + 1, and the last bone leads to the tip. The answer is a rotation
    vector for each joint, relative to the joint before it. Every pose is right in which the tip is at
    most 1e-4 m further from the target than it has to be. Every target is further from the root than the
    longest bone is long, so the arm need not fold up. `scipy.optimize.least_squares` finds numbers for
    which the entries of a function are small.

    bones (n, 3) m; target (3,) m -> (n, 3) rad
    """
    raise Unsolved("reach")
