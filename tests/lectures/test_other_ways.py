"""Right answers by other ways than ours pass, as whoever has read the text may write them."""

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
import scipy.special
from scipy.spatial.transform import Rotation

import workbench as wb
from tests.lectures.answered import all_pass

Array = np.ndarray
U, L = 0.30, 0.25  # m, the arm of lecture 6


def series(w: Array) -> Array:
    t, W = np.linalg.norm(w), np.cross(np.eye(3), w)
    a, b = np.sin(t) / t, (1 - np.cos(t)) / t**2
    if t < 1e-4:
        a, b = 1 - t**2 / 6, 0.5 - t**2 / 24
    return np.eye(3) + a * W + b * W @ W


def by_tangent(A: Array, B: Array) -> float:
    R = A.T @ B
    v = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return np.arctan2(np.linalg.norm(v), np.trace(R) - 1)


def turn_by_turn(w: Array) -> Array:
    while np.linalg.norm(w) > np.pi:
        w = w * (1 - 2 * np.pi / np.linalg.norm(w))
    return w


def flipped(M: Array) -> Array:
    W, _, Vt = np.linalg.svd(M)
    if np.linalg.det(W @ Vt) < 0:
        W[:, -1] *= -1
    return W @ Vt


def climbed(rotations: Array) -> Array:
    R = rotations[0]
    for _ in range(100):
        S = R.T @ rotations.mean(axis=0)
        R = R @ series(np.array([S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]]) / 2)
    return R


def five_points(f, x: Array) -> list[list[float]]:
    h, columns = 1e-3, []
    for d in h * np.eye(len(x)):
        near, far = f(x + d) - f(x - d), f(x + 2 * d) - f(x - 2 * d)
        columns.append((8 * near - far) / (12 * h))
    return np.transpose(columns).tolist()


def by_qr(e: Array, J: Array) -> Array:
    Q, R = np.linalg.qr(J)
    return scipy.linalg.solve_triangular(R, -Q.T @ e)


def by_scipy(f, J, x: Array) -> Array:
    return scipy.optimize.least_squares(f, x, J, method="lm", gtol=1e-15, xtol=1e-15, ftol=1e-15).x


def handed_down(parents: list[int]) -> Array:
    D = np.zeros((len(parents), len(parents)), dtype=bool)
    for k, parent in enumerate(parents):
        if parent >= 0:
            D[k] = D[parent]
            D[k, parent] = True
    return D


def with_null_space(J: Array) -> Array:
    N, P = scipy.linalg.null_space(J), np.linalg.pinv(J)
    found = np.sqrt(np.sum(P**2, axis=1))
    found[np.abs(N).max(axis=1, initial=0) > 1e-9] = np.inf
    return found


def tried_out() -> list[int]:
    body = wb.load_body("small")
    pose, betas, trans = (block.symbol for block in body.blocks())
    rng = np.random.default_rng(0)
    at = body.start() | {"pose": 0.4 * rng.normal(size=(24, 3))}
    joints = wb.residuals.landmarks(
        body.joint_points(pose, betas, trans), np.zeros((24, 3)), sigma=1.0
    )
    skin = wb.residuals.vertices(body.points(pose, betas, trans), np.zeros((369, 3)), sigma=1.0)
    J, V = (wb.Problem([r], ["pose"]).linearize(at).jacobian for r in (joints, skin))
    chosen: list[int] = []
    reached = 40
    for i in rng.permutation(369):
        rows = [3 * k + axis for k in (*chosen, int(i)) for axis in range(3)]
        rank = np.linalg.matrix_rank(np.vstack([J, V[rows]]), tol=1e-6)
        if rank > reached:
            chosen.append(int(i))
            reached = rank
        if reached == 72:
            break
    return chosen


def by_softmax(x: Array, examples: Array, width: float) -> Array:
    return scipy.special.softmax(-(np.linalg.norm(x - examples, axis=1) ** 2) / width**2)


def by_the_small_side(F: Array, D: Array, ridge: float) -> Array:
    return F.T @ np.linalg.solve(F @ F.T + ridge * np.eye(len(F)), D)


def by_rows_below(F: Array, D: Array, ridge: float) -> Array:
    n = F.shape[1]
    below = np.vstack([F, np.sqrt(ridge) * np.eye(n)])
    return np.linalg.lstsq(below, np.vstack([D, np.zeros((n, D.shape[1]))]), rcond=None)[0]


def by_eigenvectors(people: Array, k: int) -> tuple[Array, Array]:
    variances, V = np.linalg.eigh(np.cov(people.T))
    return people.mean(axis=0), V[:, ::-1][:, :k] * np.sqrt(variances[::-1][:k])


def by_slsqp(reached: Array, seen: Array) -> Array:
    K = reached.shape[1]

    def left(w: Array) -> float:
        return np.sum((np.einsum("jka,k->ja", reached, w) - seen) ** 2)

    one = {"type": "eq", "fun": lambda w: w.sum() - 1}
    return scipy.optimize.minimize(left, np.full(K, 1 / K), bounds=[(0, 1)] * K, constraints=one).x


def from_the_mean(meshes: Array) -> Array:
    T = meshes[-1] - meshes[-1].mean(axis=0)
    for _ in range(100):
        around = [V - V.mean(axis=0) for V in meshes]
        T = np.mean([V @ Rotation.align_vectors(V, T)[0].as_matrix() for V in around], axis=0)
    return T


def by_kernel_ridge(F: Array, D: Array, penalty: float) -> Array:
    return D.T @ np.linalg.solve(F @ F.T + penalty * np.eye(len(F)), F)


WAYS = {
    2: [
        {
            "hat": lambda w: np.cross(np.eye(3), w),
            "rodrigues": series,
            "angle_between": by_tangent,
            "shorter": turn_by_turn,
            "nearest_rotation": flipped,
            "mean_rotation": climbed,
        },
        {
            "rodrigues": lambda w: scipy.linalg.expm(np.cross(np.eye(3), w)),
            "angle_between": lambda A, B: Rotation.from_matrix(A.T @ B).magnitude(),
            "shorter": lambda w: Rotation.from_rotvec(w).as_rotvec(),
            "mean_rotation": lambda rotations: Rotation.from_matrix(rotations).mean().as_matrix(),
        },
    ],
    5: [
        {
            "shares": by_softmax,
            "learn": by_the_small_side,
            "directions": by_eigenvectors,
            "features": lambda R: np.concatenate([np.ravel(one - np.eye(3)) for one in R[1:]]),
        },
        {"learn": by_rows_below},
    ],
    6: [
        {
            "gradient": lambda e, J: 2 * e @ J,
            "numeric_jacobian": five_points,
            "gauss_newton_step": by_qr,
            "fit": by_scipy,
        },
        {"gauss_newton_step": lambda e, J: -np.linalg.pinv(J) @ e},
    ],
    8: [
        {
            "rank": np.linalg.matrix_rank,
            "null_space": scipy.linalg.null_space,
            "depends": handed_down,
            "sigmas": with_null_space,
            "markers": tried_out,
        },
    ],
    13: [
        {
            "ridge": by_kernel_ridge,
            "shape_space": by_eigenvectors,
            "weights_of": by_slsqp,
            "rest_shape": from_the_mean,
        },
    ],
}


@pytest.mark.parametrize(
    ("number", "answers"), [(n, ways) for n, every in WAYS.items() for ways in every]
)
def test_right_answers_pass_however_they_were_found(number: int, answers: dict) -> None:
    all_pass(number, answers)
