"""Solutions of lecture 9."""

from functools import cache

import numpy as np

import workbench as wb

Array = np.ndarray

BODY = "small"
NOISE, POSE, BETAS = 0.005, 0.25, 1.0  # m, rad, 1


def project(points: Array, R: Array, t: Array, f: float, c: Array) -> Array:
    x = points @ R.T + t
    return f * x[:, :2] / x[:, 2:] + c


def depth(lengths: Array, pixels: Array, f: float) -> float:
    return f * np.mean(lengths) / np.mean(pixels)


def keypoint_residual(seen: Array, observed: Array, confidence: Array, sigma: float) -> Array:
    return (confidence[:, None] * (seen - observed) / sigma).ravel()


def triangulate(cameras: list[Array], seen: list[Array]) -> Array:
    # x (row 3) = row 1 and y (row 3) = row 2, applied to (X, 1): linear in X
    rows = [s[i] * P[2] - P[i] for P, s in zip(cameras, seen, strict=True) for i in range(2)]
    h = np.linalg.svd(np.array(rows))[2][-1]
    return h[:3] / h[3]


def place(rest: Array, seen: Array) -> tuple[Array, Array]:
    p, q = rest.mean(axis=0), seen.mean(axis=0)
    U, _, Vt = np.linalg.svd((seen - q).T @ (rest - p))
    R = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    return R, q - R @ p


ALL = ("pose", "betas", "trans")


@cache
def asked(pose_variance: float, free: tuple[str, ...]) -> tuple[wb.SkinnedBody, wb.Problem]:
    """The body, and the problem with this prior of the pose; with none of it, none at all."""
    body = wb.load_body(BODY)
    pose, betas, trans = (block.symbol for block in body.blocks())
    seen = wb.Block("seen", (24, 3), "m")
    joints = body.joint_points(pose, betas, trans)
    residuals = [wb.residuals.landmarks(joints, seen.symbol, sigma=NOISE)]
    if np.isfinite(pose_variance):
        residuals += [
            wb.residuals.gaussian(pose, covariance=pose_variance, unit="rad"),
            wb.residuals.gaussian(betas, covariance=BETAS**2),
        ]
    return body, wb.Problem(residuals, list(free), blocks=[seen, *body.blocks()])


@cache  # the checks ask for the same people again and again
def solved(
    seen: tuple[float, ...], pose_variance: float = POSE**2, free: tuple[str, ...] = ALL
) -> tuple[Array, Array, Array]:
    """Pose, betas and translation at the end."""
    body, problem = asked(pose_variance, free)
    start = body.start() | {"seen": np.reshape(seen, (24, 3))}
    found = start | wb.solve(problem, start).values
    return found["pose"], found["betas"], found["trans"]


def fit(seen: Array) -> tuple[Array, Array, Array]:
    return solved(tuple(seen.ravel()))
