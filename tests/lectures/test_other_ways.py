"""Right answers by other ways than ours pass: lectures 2 to 6, 8 to 10 and 13."""

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
import scipy.special
from scipy.spatial.transform import Rotation

import workbench as wb
from tests.lectures.answered import all_pass

pytestmark = pytest.mark.thorough

Array = np.ndarray
EYE = np.eye(3)


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


def rigid(R: Array, t: Array) -> Array:
    return np.block([[R, t[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])


def motions(R: Array, joints: Array, parents: list[int]) -> list[Array]:
    G = [rigid(R[0], joints[0])]
    for k, up in enumerate(parents[1:], start=1):
        G.append(G[up] @ rigid(R[k], joints[k] - joints[up]))
    return G


def bound(R: Array, joints: Array, parents: list[int]) -> list[Array]:
    still = motions(np.array([EYE] * len(parents)), joints, parents)
    return [A @ np.linalg.inv(B) for A, B in zip(motions(R, joints, parents), still, strict=True)]


def one_after_the_other(bones: Array, target: Array) -> Array:
    """Cyclic coordinate descent: each joint in turn points the tip at the target."""
    R = Rotation.from_rotvec(0.1 * np.ones(bones.shape))
    for _ in range(100):
        for k in reversed(range(len(bones))):
            world, at, places = Rotation.identity(), np.zeros(3), []
            for turn, bone in zip(R, bones, strict=True):
                places.append((at, world))
                world = world * turn
                at = at + world.apply(bone)
            place, up = places[k]
            a, b = at - place, target - place
            axis = np.cross(a, b)
            size = np.linalg.norm(axis)
            if size > 1e-12:
                turn = Rotation.from_rotvec(axis / size * np.arctan2(size, a @ b))
                parts = list(R)
                parts[k] = up.inv() * turn * up * parts[k]
                R = Rotation.concatenate(parts)
    return R.as_rotvec()


def point_by_point(points: Array, motions: Array, weights: Array) -> list[Array]:
    return [
        sum(w * (G[:, :3] @ p + G[:, 3]) for w, G in zip(row, motions, strict=True))
        for p, row in zip(points, weights, strict=True)
    ]


def with_the_other_sign(Q: Array, weights: Array) -> Array:
    """-q is the same rotation."""
    pivot = Q[np.argmax(weights)]
    q = sum(w * (r if r @ pivot >= 0 else -r) for w, r in zip(weights, Q, strict=True))
    return -q / np.sqrt(q @ q)


def smooth(s: Array) -> Array:
    x = np.clip(1 - np.abs(4 * s[:, None] - np.arange(5)), 0, 1)
    return x**2 * (3 - 2 * x)


def by_modes(segments: Array, edges: Array, lengths: Array, border: float) -> Array:
    """Each mode of the graph fades by its own factor."""
    differences = np.zeros((len(edges), len(segments)))
    for row, (i, j), length in zip(differences, edges, lengths, strict=True):
        row[[i, j]] = 1 / length, -1 / length
    values, U = np.linalg.eigh(differences.T @ differences)
    return U @ (U.T @ np.eye(max(segments) + 1)[segments] / (1 + border**2 * values / 2)[:, None])


def by_second_moments(
    mean_1: Array, C_1: Array, mean_2: Array, C_2: Array, share: float
) -> tuple[Array, Array]:
    mean = mean_2 + share * (mean_1 - mean_2)
    moments = [C + np.outer(m, m) for m, C in ((mean_1, C_1), (mean_2, C_2))]
    return mean, share * moments[0] + (1 - share) * moments[1] - np.outer(mean, mean)


def by_eigenvectors(people: Array, k: int) -> tuple[Array, Array]:
    values, V = np.linalg.eigh(np.cov(people.T))
    return people.mean(axis=0), -V[:, ::-1][:, :k] * np.sqrt(values[::-1][:k])


def on_the_simplex(people: Array, joints: Array) -> Array:
    A = people.transpose(0, 2, 1).reshape(-1, people.shape[1])
    y, n = joints.ravel(), people.shape[1]
    found = scipy.optimize.minimize(
        lambda w: (np.sum((A @ w - y) ** 2), 2 * A.T @ (A @ w - y)),
        np.full(n, 1 / n),
        jac=True,
        bounds=[(0, 1)] * n,
        constraints={"type": "eq", "fun": lambda w: w.sum() - 1, "jac": lambda w: np.ones(n)},
        method="SLSQP",
        options={"ftol": 1e-12, "maxiter": 500},
    )
    return found.x


def of_least_rays(cameras: list[Array], seen: list[Array]) -> Array:
    """The point nearest to all rays."""
    A, b = np.zeros((3, 3)), np.zeros(3)
    for P, s in zip(cameras, seen, strict=True):
        centre, d = -P[:, :3].T @ P[:, 3], P[:, :3].T @ [*s, 1]
        across = EYE - np.outer(d, d) / (d @ d)
        A, b = A + across, b + across @ centre
    return np.linalg.solve(A, b)


def by_align_vectors(rest: Array, seen: Array) -> tuple[Array, Array]:
    R, _ = Rotation.align_vectors(seen - seen.mean(axis=0), rest - rest.mean(axis=0))
    return R.as_matrix(), seen.mean(axis=0) - R.apply(rest.mean(axis=0))


def written_out(seen: Array) -> tuple[Array, Array, Array]:
    """Observations as numbers, another name for all, another solver."""
    body = wb.load_body("small")
    pose, betas, trans = (block.symbol for block in body.blocks())
    problem = wb.Problem(
        [
            wb.residuals.landmarks(body.joint_points(pose, betas, trans), seen, sigma=0.005),
            wb.residuals.gaussian(pose, covariance=0.0625),
            wb.residuals.gaussian(betas),
        ],
        ["pose", "betas", "trans"],
    )
    found = wb.solve(problem, body.start(), wb.GaussNewton()).values
    return found["pose"], found["betas"], found["trans"]


def by_symmetric_root(x: Array, mean: Array, C: Array) -> Array:
    return scipy.linalg.sqrtm(np.linalg.inv(C)).real @ (x - mean)


def of_pairs(x: Array, y: Array) -> tuple[float, float]:
    """The line through two points that most others are near to, and least squares among these."""
    i, j = np.triu_indices(len(x), 1)
    counts, lines = [], []
    for a, b in zip(i, j, strict=True):
        if abs(x[a] - x[b]) > 0.2:
            slope = (y[a] - y[b]) / (x[a] - x[b])
            near = np.abs(y - y[a] - slope * (x - x[a])) < 0.06
            counts.append(near.sum())
            lines.append(near)
    best = lines[int(np.argmax(counts))]
    slope, offset = np.polyfit(x[best], y[best], 1)
    return slope, offset


def densest(x: Array, shares: Array, means: Array, covariances: Array) -> float:
    return min(
        -np.log(c * np.exp(-(x - m) @ np.linalg.solve(C, x - m) / 2) / np.sqrt(np.linalg.det(C)))
        for c, m, C in zip(shares, means, covariances, strict=True)
    )


WAYS = {
    2: {
        "hat": lambda w: np.cross(np.eye(3), w),
        "rodrigues": series,
        "angle_between": by_tangent,
        "shorter": turn_by_turn,
        "nearest_rotation": flipped,
        "mean_rotation": climbed,
    },
    3: {
        "inverse": np.linalg.inv,
        "turned_body": lambda v, p, R: np.array([R @ (x - p) + p for x in v]),
        "world_rotations": lambda R, up: [
            G[:3, :3] for G in motions(R, np.zeros((len(up), 3)), up)
        ],
        "posed_joints": lambda R, j, up: [G[:3, 3] for G in motions(R, j, up)],
        "binding": bound,
        "reach": one_after_the_other,
    },
    4: {
        "blend": point_by_point,
        "radius_left": lambda w, a: abs(1 - w + w * np.exp(1j * a)),
        "volume_lost": lambda A, zone, a: A * zone * (1 - np.cos(a)) / 3,
        "blended_turn": lambda w, a: 2 * np.angle(1 - w + w * np.exp(0.5j * a)),
        "blend_quaternions": with_the_other_sign,
        "weights": smooth,
        "first_weights": by_modes,
    },
    5: {
        "shares": lambda x, e, w: scipy.special.softmax(-np.sum((x - e) ** 2, axis=1) / w**2),
        "exact": lambda x, e, w: (
            np.exp(-np.sum((x - e) ** 2, axis=1) / w**2)
            @ np.linalg.inv(np.exp(-np.sum((e[:, None] - e) ** 2, axis=2) / w**2))
        ),
        "features": lambda R: [
            A[r, c] - (r == c) for A in R[1:] for r in range(3) for c in range(3)
        ],
        "learn": lambda F, D, p: np.linalg.lstsq(
            np.vstack([F, np.sqrt(p) * np.eye(F.shape[1])]),
            np.vstack([D, np.zeros((F.shape[1], D.shape[1]))]),
            rcond=None,
        )[0],
        "directions": by_eigenvectors,
        "regressor": on_the_simplex,
        "mixed": by_second_moments,
    },
    6: {
        "gradient": lambda e, J: 2 * e @ J,
        "numeric_jacobian": five_points,
        "gauss_newton_step": by_qr,
        "fit": by_scipy,
    },
    8: {
        "rank": np.linalg.matrix_rank,
        "null_space": scipy.linalg.null_space,
        "depends": handed_down,
        "sigmas": with_null_space,
        "markers": tried_out,
    },
    9: {
        "project": lambda p, R, t, f, c: [
            [f * x / z + c[0], f * y / z + c[1]] for x, y, z in p @ R.T + t
        ],
        "depth": lambda H, h, f: f * sum(H) / sum(h),
        "keypoint_residual": lambda s, o, c, g: np.repeat(c, 2) * (s - o).ravel() / g,
        "triangulate": of_least_rays,
        "place": by_align_vectors,
        "fit": written_out,
    },
    10: {
        "whitened": by_symmetric_root,
        "rho": lambda x, s: 1 - 1 / (1 + (x / s) ** 2),
        "influence": lambda x, s: 2 * (x / s) / (1 + (x / s) ** 2) ** 2 / s,
        "shrunk": lambda x, s: np.sin(np.arctan(x / s)),
        "max_mixture": densest,
        "line": of_pairs,
    },
    13: {
        "ridge": by_kernel_ridge,
        "shape_space": by_eigenvectors,
        "weights_of": by_slsqp,
        "rest_shape": from_the_mean,
    },
}


@pytest.mark.parametrize("number", WAYS)
def test_right_answers_by_other_ways_pass(number: int) -> None:
    all_pass(number, WAYS[number])
