r"""Draws of a Gaussian that linear limits cut off, by exact Hamiltonian Monte Carlo.

In coordinates w in which the Gaussian is standard normal, a particle with a random velocity moves
on an ellipse, w(t) = w cos t + v sin t, which changes no density; where it meets a limit
f'w + g >= 0 it is reflected. Times and places of these meetings are known in closed form, so every
proposal is accepted (Pakman and Paninski 2014, Exact Hamiltonian Monte Carlo for truncated
multivariate Gaussians). Without limits a quarter of a turn forgets everything.
"""

import numpy as np

from workbench.arrays import Array, Index
from workbench.errors import NotSupported

CHAINS = 1000  # particles side by side
WARM = 40  # flights before the first that counts
APART = 10  # flights from one that counts to the next: in a tail, one alone does not forget
MOST = 2000  # reflections of a flight; one with more is undone, which is as likely both ways
UNDONE = 0.01  # of all flights, at most
TOUCHING = 1e-12  # of the size of the terms: on the limit, but for rounding


def truncated_normal(
    F: Array, g: Array, start: Array, count: int, rng: np.random.Generator
) -> Array:
    """`count` draws (count, k) of w ~ N(0, 1) under F w + g >= 0, from a start that satisfies it.

    F is (c, k), g (c,). A limit that the start violates is moved to the start. Raises NotSupported
    if the limits leave so little room that the particles do not get through it.
    """
    g = np.maximum(g, -(F @ start))
    w = np.repeat(start[None], CHAINS, axis=0)
    kept, undone, flights = [], 0, WARM + APART * -(-count // CHAINS)
    for flight in range(flights):
        before = w
        w = _flown(F, g, w, rng.standard_normal(w.shape))
        undone += int(np.sum((w == before).all(axis=1)))
        if flight >= WARM and flight % APART == APART - 1:
            kept.append(w)
        if undone > UNDONE * flights * CHAINS:
            raise NotSupported(
                "bounds and constraints leave the Gaussian too little room to draw from, so that "
                "Laplace's approximation says nothing here. If they limit numbers that are "
                "integrated out, name these numbers too; else draw with `sample`, or widen them"
            )
    return np.concatenate(kept)[:count]


def _flown(F: Array, g: Array, w: Array, v: Array) -> Array:
    """The particles w (N, k) with velocities v after a quarter of a turn."""
    before, w = w, w.copy()
    left = np.full(len(w), np.pi / 2)
    lengths = np.sum(F**2, axis=1)
    going = np.arange(len(w))
    for _ in range(MOST):
        t, limit = _met(F, g, w[going], v[going])
        t = np.minimum(t, left[going])
        c, s = np.cos(t)[:, None], np.sin(t)[:, None]
        w[going], v[going] = w[going] * c + v[going] * s, v[going] * c - w[going] * s
        left[going] -= t
        on = left[going] > 0
        going, limit = going[on], limit[on]
        if not going.size:
            break
        f = F[limit]
        speed = np.sum(f * v[going], axis=1) / lengths[limit]
        v[going] -= 2 * speed[:, None] * f
    w[going] = before[going]
    return w


def _met(F: Array, g: Array, w: Array, v: Array) -> tuple[Array, Index]:
    """When each particle next meets a limit from inside, and which; infinity if none is met."""
    a, b = v @ F.T, w @ F.T  # the limit's value is b cos t + a sin t + g
    size = np.hypot(a, b)
    phase = np.arctan2(-a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        falls = np.arccos(np.clip(-g / size, -1, 1)) - phase
    t = np.where(size > abs(g), np.mod(falls, 2 * np.pi), np.inf)
    touching = b + g <= TOUCHING * (abs(b) + abs(g))
    t = np.where(touching & (a < 0), 0.0, t)
    limit = np.argmin(t, axis=1)
    return t[np.arange(len(w)), limit], limit
