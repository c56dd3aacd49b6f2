"""Exercises of lecture 8 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


def noticed(rng: np.random.Generator, numbers: dict) -> Array:
    """A Jacobian with singular values on both sides of SMALLEST, if its columns are in yardsticks."""
    s = rng.permutation([0.2, 0.6, *rng.choice([0.4, 1.6], 2)]) * rng.uniform(0.9, 1.1, 4)
    s[rng.integers(4)] = rng.uniform(2, 3)
    U = np.linalg.qr(rng.standard_normal((6, 4)))[0]
    V = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    return U * (numbers["SMALLEST"] * s) @ V / numbers["YARDSTICKS"]


@variant(
    "rank",
    points=2,
    minutes=15,
    draw=lambda rng: {
        "YARDSTICKS": rounded(rng, 0.11, 3.9, count=4, digits=3),
        "SMALLEST": rounded(rng, 0.6, 1.6, digits=2),
    },
    arguments=lambda rng, numbers: (noticed(rng, numbers),),
)
def rank(J: Array, *, YARDSTICKS: list[float], SMALLEST: float) -> tuple[int, float]:
    """How many directions of x the residual notices, and how well the weakest of them.

    Unknown i counts in units of YARDSTICKS[i]. A direction counts if a step of length one in these units
    changes the whitened residual by more than SMALLEST: count the singular values of the Jacobian by the
    unknowns in these units, and return how many there are and the smallest of those that count.

    J (m, 4), by the unknowns in their own units -> (a whole number, a number)
    """
    s = np.linalg.svd(J * YARDSTICKS, compute_uv=False)
    return int(np.sum(s > SMALLEST)), float(s[s > SMALLEST].min())


@mistake("rank", "a step of one yardstick is YARDSTICKS[i] in the unit of x: multiply the columns")
def rank_divided(J, *, YARDSTICKS, SMALLEST):
    s = np.linalg.svd(J / YARDSTICKS, compute_uv=False)
    return int(np.sum(s > SMALLEST)), float(s[s > SMALLEST].min(initial=np.inf))


@variant(
    "depends",
    points=3,
    minutes=20,
    draw=lambda rng: {"PARENTS": [-1, *(int(rng.integers(max(0, k - 3), k)) for k in range(1, 9))]},
    arguments=lambda rng, numbers: tuple(
        sorted(int(k) for k in rng.choice(9, 6, replace=False)) for _ in range(2)
    ),
)
def depends(seen: list[int], turning: list[int], *, PARENTS: list[int]) -> Array:
    """The pattern of a chain of which some joints are seen, and some turn.

    Entry [i, k] says whether joint seen[i] moves when joint turning[k] turns. The tree is PARENTS (9,), -1
    for the root. A joint turns about its own place.

    seen, turning, numbers of joints -> (as many as are seen, as many as turn) of 0 and 1
    """
    pattern = np.zeros((9, 9), dtype=int)
    for i, up in enumerate(PARENTS):
        while up >= 0:
            pattern[i, up] = 1
            up = PARENTS[up]
    return pattern[np.ix_(seen, turning)]


@mistake("depends", "a joint turns about its own place, and so does not move itself")
def depends_on_itself(seen, turning, *, PARENTS):
    right = depends.solution(seen, turning, PARENTS=PARENTS)
    return right | (np.array(seen)[:, None] == turning)


@variant(
    "sigmas",
    points=3,
    minutes=20,
    draw=lambda rng: {"PRIOR": rounded(rng, 0.11, 2.9, count=4, digits=3)},
    arguments=lambda rng, numbers: (rng.standard_normal((5, 4)),),
    edges=lambda numbers: [(np.ones((2, 4)),)],
)
def sigmas(J: Array, *, PRIOR: list[float]) -> Array:
    """How well each unknown is known, to first order, from whitened residuals and a prior.

    The prior says of unknown i alone that its standard deviation is PRIOR[i]; J knows nothing of it.

    J (m, 4), of any rank -> (4,), standard deviations
    """
    both = np.vstack([J, np.diag(1 / np.array(PRIOR))])
    return np.sqrt(np.diag(np.linalg.inv(both.T @ both)))


@mistake("sigmas", "the prior is a residual x_i / PRIOR[i]: its information is 1 / PRIOR[i]^2")
def sigmas_without_squares(J, *, PRIOR):
    return sigmas.solution(J, PRIOR=np.sqrt(PRIOR))


@mistake(
    "sigmas", "other unknowns are unknown as well: invert the matrix before taking its diagonal"
)
def sigmas_one_by_one(J, *, PRIOR):
    return 1 / np.sqrt(np.sum(J**2, axis=0) + 1 / np.array(PRIOR) ** 2)
