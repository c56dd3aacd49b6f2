"""Exercises of lecture 5 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


@variant(
    "shares",
    points=2,
    minutes=15,
    draw=lambda rng: {
        "WIDTH": rounded(rng, 0.31, 1.6, digits=3),
        "POWER": rounded(rng, 1.1, 2.9, digits=2),
    },
    arguments=lambda rng, numbers: (rng.standard_normal(3), rng.standard_normal((5, 3))),
)
def shares(x: Array, examples: Array, *, WIDTH: float, POWER: float) -> Array:
    """The share of each example, by kernels with long tails: (1 + |x - x_i|^2 / WIDTH^2)^-POWER.

    Each is divided by the sum of all.

    x (D,) rad; examples (n, D) rad; WIDTH rad -> (n,)
    """
    k = (1 + np.sum((x - examples) ** 2, axis=1) / WIDTH**2) ** -POWER
    return k / k.sum()


@mistake("shares", "the distance is squared, as the width is")
def shares_of_distances(x, examples, *, WIDTH, POWER):
    k = (1 + np.linalg.norm(x - examples, axis=1) / WIDTH) ** -POWER
    return k / k.sum()


@variant(
    "features",
    points=2,
    minutes=12,
    draw=lambda rng: {
        "JOINTS": sorted(int(k) for k in rng.choice(np.arange(1, 24), 4, replace=False)),
        "SCALE": rounded(rng, 0.31, 2.9, digits=3),
    },
    arguments=lambda rng, numbers: (rng.standard_normal((24, 3, 3)),),
)
def features(R: Array, *, JOINTS: list[int], SCALE: float) -> Array:
    """The features of a part of the body: SCALE times the elements of R_k - I, for k in JOINTS.

    Row by row, joint after joint, in the order of JOINTS.

    R (24, 3, 3), the root first -> (9 times the number of JOINTS,)
    """
    return SCALE * (R[JOINTS] - np.eye(3)).ravel()


@mistake("features", "joint k is R[k]: the root counts in the numbering")
def features_off_by_one(R, *, JOINTS, SCALE):
    return SCALE * (R[[k - 1 for k in JOINTS]] - np.eye(3)).ravel()


@variant(
    "learn",
    points=3,
    minutes=25,
    draw=lambda rng: {"RIDGES": rounded(rng, 0.11, 4.9, count=4, digits=3)},
    arguments=lambda rng, numbers: (rng.standard_normal((6, 4)), rng.standard_normal((6, 5))),
    edges=lambda numbers: [(np.ones((2, 4)), np.ones((2, 3)))],
)
def learn(F: Array, D: Array, *, RIDGES: list[float]) -> Array:
    """Pose blend shapes from examples, where each feature has its own ridge.

    Least in |F P - D|^2 plus the sum over features i of RIDGES[i] times the squares of row i of P.

    F (n, 4), D (n, m) m -> P (4, m) m
    """
    return np.linalg.solve(F.T @ F + np.diag(RIDGES), F.T @ D)


@mistake("learn", "a ridge stands once on the diagonal of F'F, and is not squared")
def learn_with_squares(F, D, *, RIDGES):
    return np.linalg.solve(F.T @ F + np.diag(RIDGES) ** 2, F.T @ D)


@variant(
    "mixed",
    points=3,
    minutes=25,
    draw=lambda rng: {"SHARES": thirds(rng)},
    arguments=lambda rng, numbers: (rng.standard_normal((3, 2)), spreads(rng)),
)
def mixed(means: Array, covariances: Array, *, SHARES: list[float]) -> tuple[Array, Array]:
    """Mean and covariance of everybody, if the people are of three groups.

    SHARES[g] of all people are of group g; the shares have the sum one.

    means (3, m) m; covariances (3, m, m) m^2 -> (mean (m,) m, C (m, m) m^2)
    """
    s = np.array(SHARES)
    mean = s @ means
    off = means - mean
    return mean, np.einsum("g,gij->ij", s, covariances) + np.einsum("g,gi,gj->ij", s, off, off)


@mistake("mixed", "the means of the groups differ, which adds to the covariance of all")
def mixed_within_groups(means, covariances, *, SHARES):
    return np.array(SHARES) @ means, np.einsum("g,gij->ij", SHARES, covariances)


def thirds(rng: np.random.Generator) -> list[float]:
    a, b = rounded(rng, 0.15, 0.42, count=2, digits=3)
    return [a, b, round(1 - a - b, 3)]


def spreads(rng: np.random.Generator) -> Array:
    A = rng.standard_normal((3, 2, 2))
    return A @ A.transpose(0, 2, 1)
