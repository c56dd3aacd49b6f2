"""Pose directions split into their antisymmetric and symmetric halves: a fifth fewer products.

Where nothing is rotated in the bind pose, a joint displaces one coordinate of a vertex by
P : (R - I), the sum over all entries of a matrix P (3, 3) of pose directions times those of R - I.
With the rotation vector theta, t = |theta|, a = sin(t) / t and b = (1 - cos(t)) / t^2 (Rodrigues'
formula),

    R - I = a [theta]x + b [theta]x^2,
    P : (R - I) = a s + e,    s = theta . w,    e = 1/2 b theta' S theta,
    S = P + P' - 2 tr(P) I,

where w are the three numbers of P - P'. Its derivative by theta needs S theta only once:

    a w + b S theta + (a' / t s + p e) theta,

with p = b' / (b t), and derivatives ' by t. A displacement takes nine products, as by features, and
its derivative 20 more, in place of 27.

Instead of P (9 numbers) its halves are stored: w, and of S its entries xx, yy, zz, xy, xz, yz.
These are sums and differences of entries of P. Where all of P are whole steps, so are the halves,
at most 4 x 32,767 < 2^24 of them: counts of steps in single precision lose nothing. Where
directions are stored as doubles, their halves are rounded sums, with errors of 1e-16 of their size.
"""

from __future__ import annotations

from math import factorial

import casadi as cs
import numpy as np
from scipy.special import bernoulli

from workbench.arrays import Array
from workbench.geometry.rotation import SERIES_BELOW, SERIES_TERMS, sine_and_cosine_ratios

NUMBERS = 9  # of a joint for its derivative: see `numbers_of`
SCALED = 5  # so many of them, the first, are multiplied by the unit of what is stored


def _halving() -> Array:
    """The halves (9,) of P (9,), row by row: a matrix (9, 9)."""
    unit = np.eye(9).reshape(9, 3, 3)  # the entries of P, as rows of a linear map
    P = {(i, j): unit[3 * i + j].ravel() for i in range(3) for j in range(3)}
    trace = P[0, 0] + P[1, 1] + P[2, 2]
    w = [P[2, 1] - P[1, 2], P[0, 2] - P[2, 0], P[1, 0] - P[0, 1]]
    S = [2 * P[i, i] - 2 * trace for i in range(3)]
    S += [P[i, j] + P[j, i] for i, j in ((0, 1), (0, 2), (1, 2))]
    return np.array([*w, *S])


HALVING = _halving()
TOGETHER = np.linalg.inv(HALVING)  # P of its halves; its entries are multiples of 1/4


def halved(posedirs: Array) -> Array:
    """The halves of pose directions (..., 9) m, in place of them, in m."""
    return posedirs @ HALVING.T


def gradient_by_features(by_halved: Array) -> Array:
    """The gradient by features (..., 9), from that by what the halves are multiplied with."""
    return by_halved @ TOGETHER.T


def halved_features(pose: cs.SX) -> cs.SX:
    """What a joint with the rotation vector theta (3,) rad multiplies its halves with, (9,).

    These are a theta, whose products with w are a s, and six whose products with S are e.
    """
    a, b = sine_and_cosine_ratios(cs.sumsqr(pose))
    x, y, z = cs.vertsplit(pose)
    squares = [b / 2 * x * x, b / 2 * y * y, b / 2 * z * z]
    return cs.vertcat(a * pose, *squares, b * x * y, b * x * z, b * y * z)


def numbers_of(pose: cs.SX) -> cs.SX:
    """What the derivative by theta (3,) rad takes in addition, (9,): a, a'/t, b theta, p, theta."""
    t2 = cs.sumsqr(pose)
    a, b = sine_and_cosine_ratios(t2)
    near = t2 < SERIES_BELOW
    t = cs.sqrt(cs.if_else(near, 1.0, t2))  # both branches are evaluated
    slope = cs.if_else(near, _series(t2, _SLOPE), (cs.cos(t) - cs.sin(t) / t) / t**2)  # a' / t
    p = cs.if_else(near, _series(t2, _RATIO), cs.cos(t / 2) / cs.sin(t / 2) / t - 2 / t**2)
    return cs.vertcat(a, slope, b * pose, p, pose)


_N = range(SERIES_TERMS)  # powers of t^2
_SLOPE = [(-1) ** (n + 1) * 2 * (n + 1) / factorial(2 * n + 3) for n in _N]
_RATIO = [-2 * abs(float(bernoulli(2 * n + 2)[-1])) / factorial(2 * n + 2) for n in _N]


def _series(t2: cs.SX, terms: list[float]) -> cs.SX:
    total = 0 * t2
    for term in reversed(terms):
        total = total * t2 + term
    return total


def slopes_of(halves: cs.SX, e: cs.SX, numbers: cs.SX) -> cs.SX:
    """The derivative of a displacement by theta, (3, 3) m/rad: by x for all axes, then by y and z.

    `halves` (3, 9) m has one row for each coordinate, `e` (3,) m are their sums above.
    """
    a, slope, b_theta, p, theta = numbers[0], numbers[1], numbers[2:5], numbers[5], numbers[6:]
    slopes = []
    for d in range(3):
        w, (xx, yy, zz, xy, xz, yz) = halves[d, :3].T, cs.horzsplit(halves[d, 3:])
        S = cs.blockcat([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        along = slope * cs.dot(theta, w) + p * e[d]
        slopes.append((a * w + S @ b_theta + along * theta).T)
    return cs.vec(cs.vertcat(*slopes))
