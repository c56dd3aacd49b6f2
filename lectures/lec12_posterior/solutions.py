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


def next_point(log_p, x: Array, y: Array, drawn: float) -> Array:
    return y if np.log(drawn) < log_p(y) - log_p(x) else x


def stretch(x: Array, other: Array, z: float) -> tuple[Array, float]:
    return other + z * (x - other), (len(x) - 1) * np.log(z)


def draw(log_p, start: Array, count: int) -> Array:
    # differential evolution: steps are differences of walkers, so that they have the density's shape
    rng, walkers, each = np.random.default_rng(0), 25, 8  # steps of a walker to a draw
    x = start + 2.5 * rng.standard_normal((walkers, 2))  # far enough to be in every piece
    here = [log_p(one) for one in x]
    rounds = each * count // walkers
    kept = []
    for k in range(rounds + rounds // 4):  # the first rounds depend on the start
        for i in range(walkers):
            a, b = rng.integers(walkers, size=2)
            factor = 1.0 if rng.uniform() < 0.2 else 1.19  # 1 leads from piece to piece
            y = x[i] + factor * (x[a] - x[b]) + 1e-4 * rng.standard_normal(2)
            there = log_p(y)
            if np.log(rng.uniform()) < there - here[i]:
                x[i], here[i] = y, there
        if k >= rounds // 4:
            kept.append(x.copy())
    return np.concatenate(kept)[:: len(kept) * walkers // count][:count]
