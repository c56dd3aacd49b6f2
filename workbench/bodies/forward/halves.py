"""Pose directions split into their antisymmetric and symmetric halves: a third fewer products.

Where nothing is rotated in the bind pose, a joint displaces one coordinate of a vertex by
P : (R - I), the sum over all entries of a matrix P (3, 3) of pose directions times those of R - I.
With the rotation vector theta, t = |theta|, a = sin(t) / t and b = (1 - cos(t)) / t^2 (Rodrigues'
formula),

    R - I = a [theta]x + b [theta]x^2,
    P : (R - I) = a theta . w + 1/2 b theta' S theta,      S = P + P' - 2 tr(P) I,

where w are the three numbers of P - P'. A derivative by theta needs S theta only once:

    g = a w + b S theta,    s = theta . w,    u = 1/2 theta . g,
    P : (R - I) = 1/2 a s + u,
    its derivative by theta = g + (p u + q s) theta,

with p = b' / (b t), q = a' / t - 1/2 a p, and derivatives ' by t: 24 products, where nine features
and their 27 slopes take 36. Instead of P (9 numbers) its halves are stored: w, and of S its entries
xx, yy, zz, xy, xz, yz. These are sums and differences of entries of P. Where all of P are whole
steps, so are they, and nothing is lost.
"""

from __future__ import annotations

from math import factorial

import casadi as cs
import numpy as np
from scipy.special import bernoulli

from workbench.arrays import Array
from workbench.geometry.rotation import SERIES_BELOW, SERIES_TERMS

NUMBERS = 13  # of a joint: see `numbers_of`
SCALED = 6  # so many of them, the first, are multiplied by the unit of what is stored


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
    """The halves of pose directions (..., 9), in place of them."""
    return posedirs @ HALVING.T


def gradient_by_features(by_halved: Array) -> Array:
    """The gradient by features (..., 9), from that by what the halves are multiplied with."""
    return by_halved @ TOGETHER.T


def numbers_of(pose: cs.SX) -> cs.SX:
    """What a joint with the rotation vector theta (3,) multiplies halves with, (13,).

    These are a, a/2, q, b theta, p, theta and theta/2.
    """
    t2 = cs.sumsqr(pose)
    near = t2 < SERIES_BELOW
    t = cs.sqrt(cs.if_else(near, 1.0, t2))  # both branches are evaluated
    a = cs.if_else(near, _series(t2, _SINE), cs.sin(t) / t)
    b = cs.if_else(near, _series(t2, _COSINE), 2 * (cs.sin(t / 2) / t) ** 2)
    slope = cs.if_else(near, _series(t2, _SLOPE), (cs.cos(t) - cs.sin(t) / t) / t**2)  # a' / t
    p = cs.if_else(near, _series(t2, _RATIO), cs.cos(t / 2) / cs.sin(t / 2) / t - 2 / t**2)
    return cs.vertcat(a, a / 2, slope - a * p / 2, b * pose, p, pose, pose / 2)


_N = range(SERIES_TERMS)  # powers of t^2
_SINE = [(-1) ** n / factorial(2 * n + 1) for n in _N]
_COSINE = [(-1) ** n / factorial(2 * n + 2) for n in _N]
_SLOPE = [(-1) ** (n + 1) * 2 * (n + 1) / factorial(2 * n + 3) for n in _N]
_RATIO = [-2 * abs(float(bernoulli(2 * n + 2)[-1])) / factorial(2 * n + 2) for n in _N]


def _series(t2: cs.SX, terms: list[float]) -> cs.SX:
    total = 0 * t2
    for term in reversed(terms):
        total = total * t2 + term
    return total


def moved_by(halves: cs.SX, numbers: cs.SX) -> cs.SX:
    """The displacement (3,) and its derivative by theta (3, 3), axis by axis: (12,).

    `halves` (3, 9) has one row for each coordinate.
    """
    a, half_a, q, b_theta = numbers[0], numbers[1], numbers[2], numbers[3:6]
    p, theta, half_theta = numbers[6], numbers[7:10], numbers[10:13]
    displaced, slopes = [], []
    for d in range(3):
        w, (xx, yy, zz, xy, xz, yz) = halves[d, :3].T, cs.horzsplit(halves[d, 3:])
        S = cs.blockcat([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        g = a * w + S @ b_theta
        s, u = cs.dot(theta, w), cs.dot(half_theta, g)
        displaced.append(half_a * s + u)
        slopes.append((g + (p * u + q * s) * theta).T)
    return cs.vertcat(*displaced, cs.vec(cs.vertcat(*slopes)))
