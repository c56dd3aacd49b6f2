"""Exercises of lecture 19, dynamics and rigging.

Write each answer in place of the line that raises `Unsolved`, and keep the names, arguments and shapes.
Lengths are in metres, times in seconds. This command grades the file:

    workbench lecture check 19 lec19_dynamics.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray

GRAVITY = np.array([0.0, -9.81, 0.0])  # m/s^2


def wobble(a1: float, a2: float, fps: float) -> tuple[float, float]:
    """How fast phi[t] = a1 phi[t - 1] + a2 phi[t - 2] swings, and how fast it dies away.

    The poles solve z^2 = a1 z + a2; here they are complex, r exp(i w) and r exp(-i w), with r below 1. The
    swing is r^t cos(w t + phase), where t counts frames: w is an angle in radians for each frame.

    a1, a2; fps frames a second -> the frequency in Hz, and the time in s in which the swing falls to half
    """
    raise Unsolved("wobble")


def one_step(phi: Array, x: Array) -> tuple[float, float, Array]:
    """The least squares of one step ahead: phi[t] = a1 phi[t - 1] + a2 phi[t - 2] + b . x[t].

    Use all t for which phi[t], phi[t - 1] and phi[t - 2] were observed.

    phi (T,); x (T, X) -> a1, a2, b (X,)
    """
    raise Unsolved("one_step")


def free_run(a1: float, a2: float, driven: Array) -> Array:
    """phi[t] = a1 phi[t - 1] + a2 phi[t - 2] + driven[t], where phi is zero before the first frame.

    driven (T,) -> phi (T,)
    """
    raise Unsolved("free_run")


def stabilized(first: Array, second: Array, most: float) -> tuple[Array, Array]:
    """The matrices of a model whose poles are all multiplied by one factor, so that the largest is `most`.

    The model is phi[t] = A_1 phi[t - 1] + A_2 phi[t - 2], and its poles z solve z^2 v = z A_1 v + A_2 v. A
    model whose poles are at most `most` already stays as it is.

    first, second (C, C); most between 0 and 1 -> first (C, C), second (C, C)
    """
    raise Unsolved("stabilized")


def felt(R: Array, places: Array, fps: float) -> Array:
    """What a point of the body feels, in the frame of its bone, less what it feels when the body is at rest.

    The bone is turned by R. A point with acceleration a feels gravity less a. Take second differences, in
    those frames that have a neighbour on both sides.

    R (T, 3, 3); places (T, 3) m; fps frames a second -> (T - 2, 3) m/s^2
    """
    raise Unsolved("felt")


def joint_between(Ra: Array, ta: Array, Rb: Array, tb: Array) -> tuple[Array, int]:
    """The joint of two bones: the point at rest that both bones take to the same places.

    Bone a takes a point p at rest to Ra[t] p + ta[t], and bone b to Rb[t] p + tb[t]. Solve for p by least
    squares over all frames, three equations each. Where the motion leaves the joint undetermined, return the
    place that is closest to the origin, and in how many independent directions it may slide. A singular value
    of the matrix of all these equations counts as zero if it is at most a millionth of the largest one. So if
    the largest one is zero, all of them count as zero. (Both np.linalg.lstsq and np.linalg.matrix_rank take a
    tolerance. Read what theirs is relative to.)

    Ra, Rb (T, 3, 3); ta, tb (T, 3) m -> the place (3,) m, and a whole number from 0 to 3
    """
    raise Unsolved("joint_between")
