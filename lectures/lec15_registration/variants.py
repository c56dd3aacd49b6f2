"""Exercises of lecture 15 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


@variant(
    "robust_weight",
    points=3,
    minutes=25,
    draw=lambda rng: {
        "SIGMA": rounded(rng, 0.003, 0.009, digits=4),
        "SCALE": rounded(rng, 0.021, 0.09, digits=4),
        "POWER": rounded(rng, 0.4, 0.95, digits=2),
    },
    arguments=lambda rng, numbers: (rng.uniform(0, 0.2, 5),),
    edges=lambda numbers: [(np.array([0.0]),)],
)
def robust_weight(d: Array, *, SIGMA: float, SCALE: float, POWER: float) -> Array:
    """The weights w of iteratively reweighted least squares, for a loss of yours.

    A distance d costs half of rho = (d / SIGMA)^2 / (1 + (d / SCALE)^2)^POWER. Its weight is such that half of
    w d^2, with w held, has the same derivative at d.

    d (n,) m, none of them negative -> (n,) 1/m^2
    """
    s = (d / SCALE) ** 2
    return (1 + s - POWER * s) / (1 + s) ** (POWER + 1) / SIGMA**2


@mistake("robust_weight", "this is rho / d^2; the weight comes from the derivative of rho")
def robust_weight_from_rho(d, *, SIGMA, SCALE, POWER):
    return 1 / SIGMA**2 / (1 + (d / SCALE) ** 2) ** POWER


@variant(
    "coupling_residual",
    points=2,
    minutes=15,
    draw=lambda rng: {
        "EDGES": [
            [int(a), int(b)]
            for a, b in zip(rng.permutation(6)[:4], rng.permutation(6)[:4] + 6, strict=True)
        ],
        "SIGMAS": rounded(rng, 0.0011, 0.009, count=4, digits=5),
    },
    arguments=lambda rng, numbers: (*rng.uniform(-1, 1, (2, 12, 3)),),
)
def coupling_residual(V: Array, M: Array, *, EDGES: list[list[int]], SIGMAS: list[float]) -> Array:
    """The residual that couples free vertices V to those of a model M by your edges, in sigmas.

    For edge e it is the difference along the edge (second end minus first) of V, minus that of M, over
    SIGMAS[e]: x, y and z of the first edge, then those of the second, and so on.

    V, M (12, 3) m -> (12,)
    """
    first, second = np.array(EDGES).T
    moved = V - M
    return ((moved[second] - moved[first]) / np.array(SIGMAS)[:, None]).ravel()


@mistake("coupling_residual", "the second end minus the first")
def coupling_residual_backwards(V, M, *, EDGES, SIGMAS):
    return -coupling_residual.solution(V, M, EDGES=EDGES, SIGMAS=SIGMAS)
