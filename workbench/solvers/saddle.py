"""Whether a stationary point is a saddle: a direction along which the cost falls, if there is one.

At a minimum the Hessian H of the cost has no negative eigenvalue on the directions that bounds
leave free (Nocedal and Wright, Numerical Optimization, 2006, theorem 12.5). At most minima H is
nearly M = J'J + 1e-4 D^2, D the lengths of J's columns, so that M^-1 H has eigenvalues near 1 and a
negative one would lie apart. Lanczos' method finds such a one in a few steps, each of which takes
one gradient (Golub and Van Loan, Matrix Computations, 2013, sections 10.1 and 11.5).
"""

from collections.abc import Callable
from functools import lru_cache
from math import acosh, cosh
from typing import NamedTuple

import numpy as np
import scipy.linalg

from workbench.arrays import Array, Mask
from workbench.problem import Linearization
from workbench.problem.rounding import FACTOR, fall
from workbench.problem.steps import EPS, factor_of
from workbench.solvers.end_point import EndPoint

DAMPING = 1e-4  # of D^2, in M: directions that J does not notice are looked at first
STEP = 1e-6  # of the terms of the residual: how far a gradient is taken for a difference
FLAT = 0.1  # an eigenvalue of M^-1 H below this one is worth looking at
MORE, CLEAR = 20, 0.1  # gradients once an eigenvalue is negative; how well its vector is known
SHORTEST = 1e-3  # of |r|, along columns of length 1: where the cost is tried first
NEARBY = 0.1  # of an unknown's size, or of 1: where it is tried last
NEARLY_ZERO = 1e-9  # a number whose size says nothing of its unit
DOUBLINGS = 10  # of the step to a lower point, as long as the cost falls on
ACROSS = 0.1  # of 1/n: the least squared part of a random vector along any one direction
FEW = 20  # unknowns up to which every direction is looked at, by gradients to both sides
FEWEST, SHARE = 2, 10  # gradients otherwise, and one for so many evaluations of the run
DENSE = 3000  # unknowns up to which an M that is an array is factorized

Product = Callable[[Array], Array]


class Saddle(NamedTuple):
    """What shows that a point is no minimum.

    Attributes:
        direction: (n,) along which the cost falls, of length 1, in the unknowns y_i = D_i x_i,
            which change the residual by themselves by about one sigma.
        to: (n,) a point along it where the cost is lower.
        fall: by how much it is lower there.
    """

    direction: Array
    to: Array
    fall: float


def most_gradients(n: int, evaluations: int) -> int:
    """How many gradients a search among n unknowns may take after so many evaluations."""
    return n if n <= FEW else max(FEWEST, evaluations // SHARE)


def saddle(end: EndPoint, most: int) -> Saddle | None:
    """A direction along which the cost falls from a stationary point; None if none is found.

    At most `most` gradients are evaluated, and 20 more once a negative eigenvalue has shown. If
    they are fewer than the unknowns, a saddle may be missed. No minimum is taken for a saddle: the
    cost falls by more than rounding, the gradient that is left and the tolerance explain. With
    constraints other than bounds nothing is looked for, because the cost may fall along their
    curves without falling along any line.
    """
    here, x = end.here, end.x
    if here.constraints is not None or here.cost <= end.worth:
        return None
    D = np.maximum(here.column_norms, np.linalg.norm(here.residual) / _size(end))
    held = _held(end, D)
    inverse = None if held.all() else _inverse(here, D, held)
    if inverse is None:
        return None
    step = STEP * end.rounding.norm / (FACTOR * EPS)

    def bend(v: Array) -> Array:
        h = step / float(np.linalg.norm(v))
        ahead = (end.gradient(x + h * v / D) - here.gradient) / (h * D)
        if len(x) > FEW and np.isfinite(ahead).all():
            return np.where(held, 0.0, ahead)
        behind = (here.gradient - end.gradient(x - h * v / D)) / (h * D)
        sides = [side for side in (ahead, behind) if np.isfinite(side).all()]
        return np.where(held, 0.0, np.mean(sides or [ahead], axis=0))

    def falls(v: Array) -> Saddle | None:
        return _falls(end, v / float(np.linalg.norm(v)), D)

    return _searched(bend, inverse, falls, held, most)


def _size(end: EndPoint) -> Array:
    """The size of each unknown (n,); 1 where it is and was zero."""
    return np.where(end.size > NEARLY_ZERO, end.size, 1.0)


def _held(end: EndPoint, D: Array) -> Mask:
    """Unknowns that a bound holds, (n,): they are on it, and the cost falls towards it."""
    problem, x, slope = end.problem, end.x, end.here.gradient / D
    least = end.tolerance * float(np.linalg.norm(end.here.residual))
    low, high = x <= problem.lower, x >= problem.upper
    held = (low & (slope > least)) | (high & (slope < -least)) | (low & high)
    return np.asarray(held | ~problem.support.read)


def _inverse(here: Linearization, D: Array, held: Mask) -> Product | None:
    """The product of M^-1 and a vector, of the unknowns D x; None if that is not affordable."""
    normal, n = here.normal, len(D)
    if not isinstance(normal, np.ndarray):
        factor = factor_of(normal, np.where(held, 1.0, DAMPING) * D**2)
        return None if factor is None else lambda v: np.where(held, 0.0, D * factor.solve(D * v))
    if n > DENSE:
        return None
    M = normal / np.outer(D, D)
    if held.any():
        M[held], M[:, held] = 0.0, 0.0
    M[np.diag_indices(n)] += DAMPING
    L, failed = scipy.linalg.lapack.dpotrf(M, lower=True)
    if failed:
        return None
    return lambda v: np.asarray(scipy.linalg.lapack.dpotrs(L, v, lower=True)[0])


@lru_cache(maxsize=4)
def random_vector(n: int) -> Array:
    """Random numbers (n,), normally distributed and always the same; they cannot be written to."""
    found = np.random.default_rng(0).standard_normal(n)
    found.setflags(write=False)
    return found


def _searched(
    bend: Product,
    inverse: Product,
    falls: Callable[[Array], Saddle | None],
    held: Mask,
    most: int,
) -> Saddle | None:
    """Lanczos' method for the least eigenvalue of M^-1 H, and whether the cost falls along it.

    `bend` gives H v, and `falls` tries a direction. The search ends where an eigenvalue of 0 would
    have shown by now, for about three of four random vectors: the least one found is so far
    above it that Chebyshev's polynomial would have brought it out (Kuczynski and Wozniakowski,
    Estimating the largest eigenvalue by the power and Lanczos algorithms, 1992).
    """
    n, size = len(held), int((~held).sum())
    u = np.where(held, 0.0, random_vector(n))
    w = inverse(u)
    beta = float(np.sqrt(u @ w))
    dual, primal = np.zeros((n, 0)), np.zeros((n, 0))
    before, most, tried = np.zeros((0, 0)), min(most, size), False
    most_once_seen = most + MORE
    for k in range(1, size + 1):
        dual = np.concatenate([dual, (u / beta)[:, None]], axis=1)
        primal = np.concatenate([primal, (w / beta)[:, None]], axis=1)
        u = bend(primal[:, -1])
        if not np.isfinite(u).all():
            return None
        T = np.zeros((k, k))
        T[:-1, :-1] = before
        T[-1, -1] = u @ primal[:, -1]
        if k > 1:
            T[-1, -2] = T[-2, -1] = beta
        for _ in range(2):  # twice, so that rounding does not bring the same vectors back
            u = u - dual @ (primal.T @ u)
        w = inverse(u)
        beta = float(np.sqrt(max(float(u @ w), 0.0)))
        values, vectors = np.linalg.eigh(T)
        before = T
        least = float(values[0])
        if least < -FLAT and not tried:
            most = min(most_once_seen, size)
        last = k >= most or beta <= EPS * float(np.abs(values).max())
        clear = beta * abs(float(vectors[-1, 0])) <= CLEAR * abs(least)
        if least < FLAT and (last or (least < -FLAT and clear and not tried)):
            found, tried = falls(primal @ vectors[:, 0]), True
            if found is not None:
                return found
        if last or (k > 1 and _shown(values, k, size)):
            return None
    return None


def _shown(values: Array, k: int, n: int) -> bool:
    """Whether k steps that found these eigenvalues would have shown one that is 0."""
    low, high = float(values[0]), float(values[-1])
    if low <= FLAT:
        return False
    if high - low <= EPS * high:
        return True
    grown = min((k - 1) * acosh((high + low) / (high - low)), 100.0)
    return cosh(grown) ** 2 * ACROSS * low > n * high


def _falls(end: EndPoint, d: Array, D: Array) -> Saddle | None:
    """Whether the cost falls along d (n,), of length 1, to one of its sides, and how far it does.

    It is tried at growing distances until it changes by more than rounding. If it bends upwards
    there, or falls by no more than its gradient says, there is no fall.
    """
    here, x = end.here, end.x
    low, high = end.problem.lower, end.problem.upper
    size = float(np.linalg.norm(here.residual))
    longest = NEARBY / float(np.max(np.abs(d) / D / _size(end)))

    def at(length: float) -> tuple[float, float, float]:
        r = end.residual(np.clip(x + length * d / D, low, high))
        lower = fall(here.residual, r)
        noise = end.rounding.of_fall(here.residual, r != here.residual)
        return length, (lower if np.isfinite(lower) else -np.inf), noise

    length = SHORTEST * size
    while length <= longest:
        sides = at(length), at(-length)
        bend, noise = sides[0][1] + sides[1][1], sides[0][2] + sides[1][2]
        best, lower, _ = max(sides, key=lambda side: side[1])
        explained = noise + 2 * length * abs(float(here.gradient @ (d / D)))
        if bend > noise or lower > explained:
            for _ in range(DOUBLINGS):
                further, much_lower, _ = at(2 * best)
                if much_lower <= lower:
                    break
                best, lower = further, much_lower
            to = np.clip(x + best * d / D, low, high)
            return Saddle(np.sign(best) * d, to, lower) if lower > end.worth else None
        if bend < -noise:
            return None
        length *= 10
    return None
