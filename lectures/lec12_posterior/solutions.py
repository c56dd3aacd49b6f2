"""Solutions of lecture 12."""

import numpy as np

Array = np.ndarray

F, D, LENGTH = 1000.0, 5.0, 0.25  # px, m, m
SIGMA, PRIOR = 3.0, 0.6  # px, rad


def log_posterior(phi: float, seen: float) -> float:
    pixel = F * LENGTH * np.cos(phi) / (D + LENGTH * np.sin(phi))
    return -0.5 * ((pixel - seen) / SIGMA) ** 2 - 0.5 * (phi / PRIOR) ** 2


def deviations(J: Array) -> Array:
    R = np.linalg.qr(J, mode="r")  # R'R = J'J, with the condition of J
    return np.linalg.norm(np.linalg.inv(R), axis=1)


def interval(draws: Array, level: float) -> Array:
    tail = (1 - level) / 2
    return np.quantile(draws, [tail, 1 - tail], axis=0).T


def next_point(log_p, x: Array, y: Array, u: float) -> Array:
    return y if np.log(u) < log_p(y) - log_p(x) else x


def stretch(x: Array, other: Array, z: float) -> tuple[Array, float]:
    return other + z * (x - other), (len(x) - 1) * np.log(z)


def draw(log_p, start: Array, count: int) -> Array:
    rng, each = np.random.default_rng(0), 6  # steps to a draw: neighbours are much alike
    sizes = rng.choice([0.3, 0.8, 2.5], size=(count * each, 1))  # for what is narrow, and to jump
    steps = sizes * rng.standard_normal((count * each, 2))
    levels = np.log(rng.uniform(size=count * each))
    chain, x, here = [], np.array(start, dtype=float), log_p(start)
    for step, level in zip(steps, levels, strict=True):
        there = log_p(x + step)
        if level < there - here:
            x, here = x + step, there
        chain.append(x)
    return np.array(chain[each - 1 :: each])
