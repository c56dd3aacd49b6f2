"""People seen by cameras at random, from whom a regressor learns."""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.geometry.rotation import matrix_from_vector
from workbench.priors.poses import PoseGaussian, PoseMixture, draw_poses

STATURE = 400.0  # px, in whose images noise and outliers are given
TALL = 1.7  # m
NOISE = (2.0, 10.0)  # px, of one image
OUTLIER = 120.0  # px
LIMBS = tuple(
    tuple(f"{side}_{part}" for part in parts)
    for side in ("left", "right")
    for parts in (
        ("elbow", "wrist"),
        ("wrist",),
        ("knee", "ankle", "big_toe", "small_toe", "heel"),
        ("ankle", "big_toe", "small_toe", "heel"),
        ("eye", "ear"),
    )
)


@dataclass(frozen=True, eq=False)
class People:
    """People of whom views are drawn.

    Attributes:
        poses: (N, K, 3) rad, in which the root is not turned.
        landmarks: (N, M, 3) m, relative to the root joint.
    """

    poses: Array
    landmarks: Array


def draw_people(
    body: Body, prior: PoseGaussian | PoseMixture, n: int, rng: np.random.Generator
) -> People:
    """People in poses of a prior with betas of the standard normal distribution."""
    return people_in(body, draw_poses(prior, n, rng), rng)


def people_in(body: Body, poses: Array, rng: np.random.Generator) -> People:
    """People in given poses (N, K, 3) rad with betas of the standard normal distribution."""
    betas = rng.standard_normal((len(poses), body.n_betas))
    at = body.joints(poses, betas)[:, :1]
    return People(poses, body.landmark("coco", poses, betas) - at)


def draw_facings(n: int, rng: np.random.Generator) -> Array:
    """Rotations (n, 3, 3) of the root as upright cameras see it, facing in all directions.

    Cameras look down by 10 degrees on average. Most people stand upright, and some do not.
    """
    upright = np.diag([1.0, -1.0, -1.0])
    spread = np.where(rng.random((n, 1)) < 0.85, 0.15, 0.6)
    tilt = spread * rng.standard_normal((n, 3)) * [1, 0, 1]
    facing = np.column_stack([np.zeros(n), rng.uniform(-np.pi, np.pi, n), np.zeros(n)])
    pitch = np.column_stack([rng.normal(0.17, 0.2, n), np.zeros(n), rng.normal(0, 0.06, n)])
    R = matrix_from_vector(pitch) @ upright @ matrix_from_vector(facing) @ matrix_from_vector(tilt)
    return np.asarray(R)


def draw_views(
    landmarks: Array, R: Array, names: tuple[str, ...], rng: np.random.Generator
) -> tuple[Array, Array]:
    """Rays (N, M, 2) and confidences (N, M) of landmarks that are turned by R (N, 3, 3).

    The camera looks at the root; its distance is 2.5 to 12 m. Keypoints are noisy, a few of some
    images are wrong, and single ones and whole limbs are missing.
    """
    n, M = landmarks.shape[:2]
    depth = np.exp(rng.uniform(np.log(2.5), np.log(12.0), n))[:, None]
    seen = np.einsum("nij,nmj->nmi", R, landmarks)
    z = np.maximum(seen[..., 2] + depth, 0.3)
    rays = seen[..., :2] / z[..., None]
    px = TALL / depth / STATURE  # of a ray
    noise = rng.uniform(*NOISE, (n, 1, 1)) * px[..., None]
    rays = rays + noise * rng.standard_normal((n, M, 2))
    wrong = rng.random((n, M)) < rng.choice([0, 0.1, 0.25], (n, 1), p=[0.7, 0.2, 0.1])
    rays = rays + (wrong * px)[..., None] * OUTLIER * rng.standard_normal((n, M, 2))
    missing = rng.random((n, M)) < rng.choice([0, 0.1, 0.3], (n, 1), p=[0.5, 0.3, 0.2])
    for limb in LIMBS:
        missing |= np.isin(names, limb) & (rng.random((n, 1)) < 0.05)
    legs = np.isin([name.split("_")[-1] for name in names], ("knee", "ankle", "toe", "heel"))
    feet = np.isin([name.split("_")[-1] for name in names], ("toe", "heel"))
    missing |= legs & (rng.random((n, 1)) < 0.05)
    missing |= feet & (rng.random((n, 1)) < 0.5)
    missing &= (~missing).sum(axis=1, keepdims=True) >= 4
    return rays, (~missing).astype(float)
