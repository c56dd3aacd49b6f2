"""Right answers by other ways than ours pass, of each kind some."""

import casadi as cs
import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
import scipy.stats
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from workbench.course.grading import CheckState, grade_exercise
from workbench.course.outline import lecture

pytestmark = pytest.mark.thorough

Array = np.ndarray
EYE = np.eye(3)


def by_tangent(A: Array, B: Array) -> float:
    R = A.T @ B
    v = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return np.arctan2(np.linalg.norm(v), np.trace(R) - 1)


def by_qr(e: Array, J: Array) -> Array:
    Q, R = np.linalg.qr(J)
    return scipy.linalg.solve_triangular(R, -Q.T @ e)


def by_normal_equations(e: Array, J: Array, damping: float) -> Array:
    return np.linalg.solve(J.T @ J + damping * np.eye(J.shape[1]), -J.T @ e)


def by_halves(log_p, start: Array, count: int) -> Array:
    """Differential evolution as in the lecture: one half moves, and the other stands still."""
    rng, H = np.random.default_rng(5), 20
    x = start + 2.5 * rng.standard_normal((2, H, 2))
    here = np.array([[log_p(one) for one in half] for half in x])
    kept, rounds = [], 10 * count // (2 * H)
    for k in range(rounds):
        for moving, other in ((0, x[1]), (1, x[0])):
            a, b = rng.integers(H, size=(2, H))
            steps = rng.choice([1.0, 1.2], size=(H, 1)) * (other[a] - other[b])
            y = x[moving] + steps + 1e-4 * rng.standard_normal((H, 2))
            there = np.array([log_p(one) for one in y])
            taken = np.log(rng.uniform(size=H)) < there - here[moving]
            x[moving][taken], here[moving][taken] = y[taken], there[taken]
        if k >= rounds // 5:
            kept.append(x.reshape(-1, 2).copy())
    return np.concatenate(kept)[-8 * count :: 8]


def by_brute_force(points: Array, cloud: Array) -> Array:
    contacts = cloud[cdist(points, cloud).argmin(axis=1)]
    p, q = points.mean(axis=0), contacts.mean(axis=0)
    R, _ = Rotation.align_vectors(contacts - q, points - p)
    return R.apply(points - p) + q


def by_casadi(p: Array, corners: Array, shares: Array) -> Array:
    v = cs.SX.sym("v", 3, 3)  # a column for each corner
    slope = cs.gradient(cs.norm_2(cs.DM(p) - v @ cs.DM(shares)), v)
    return np.asarray(cs.Function("slope", [v], [slope])(corners.T)).T


def by_scipys_densities(
    x: Array, shares: Array, means: Array, covariances: Array
) -> tuple[float, float]:
    logs = np.log(shares) + [
        scipy.stats.multivariate_normal(mean, C).logpdf(x)
        for mean, C in zip(means, covariances, strict=True)
    ]
    return -max(logs), -float(np.logaddexp.reduce(logs))


def by_matrices(vertices: Array, pose: Array) -> tuple[Array, Array]:
    S = np.diag([-1.0, 1.0, 1.0])
    return vertices @ S, Rotation.from_matrix(
        S @ Rotation.from_rotvec(pose).as_matrix() @ S
    ).as_rotvec()


WAYS = {
    2: {"hat": lambda w: np.cross(np.eye(3), w), "angle_between": by_tangent},
    3: {"inverse": np.linalg.inv, "turned_body": lambda v, p, R: [R @ (x - p) + p for x in v]},
    4: {"radius_left": lambda w, a: abs(1 - w + w * np.exp(1j * a))},
    7: {"damped_step": by_normal_equations},
    8: {"rank": np.linalg.matrix_rank, "null_space": scipy.linalg.null_space},
    12: {"draw": by_halves},
    15: {"icp_step": by_brute_force, "distance_gradient": by_casadi},
    16: {"mixture_costs": by_scipys_densities},
    18: {"mirrored": by_matrices},
}


@pytest.mark.parametrize("number", WAYS)
def test_right_answers_by_other_ways_pass(number: int) -> None:
    for exercise, answer in WAYS[number].items():
        for one in grade_exercise(lecture(number), exercise, answer):
            assert one.state is CheckState.PASSED, one
