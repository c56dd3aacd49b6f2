"""Training a regressor of poses on synthetic views, by scikit-learn's multi-layer perceptron."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.bodies.forward.kinematics import ancestors
from workbench.environment import pip_install
from workbench.errors import BadArgument, NotSupported
from workbench.fitting.observations import COCO
from workbench.fitting.pose_regressor import PoseRegressor, normalised
from workbench.geometry.rotation import matrix_from_vector
from workbench.priors.poses import PoseGaussian, PoseMixture, draw_poses
from workbench.writing import write_arrays

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

HIDDEN = (256, 256)
PEOPLE, PASSES = 20_000, 60
RATE = 2e-3  # of Adam's method (Kingma and Ba 2015)
AVERAGED = 0.3  # of the passes, the last ones, whose weights are averaged
LARGEST = 2**15 - 1  # of the whole numbers in which weights are stored
LEAST_SCALE = 0.03  # m per rad: joints that move no landmark are learned a little as well


@dataclass(frozen=True, eq=False)
class TrainingPeople:
    """People of whom views are drawn.

    Attributes:
        poses: (N, K, 3) rad, in which the root is not turned.
        landmarks: (N, M, 3) m, relative to the root joint.
    """

    poses: Array
    landmarks: Array


def people_in(body: Body, poses: Array, rng: np.random.Generator) -> TrainingPeople:
    """People in given poses (N, K, 3) rad with betas of the standard normal distribution."""
    betas = rng.standard_normal((len(poses), body.n_betas))
    at = body.joints(poses, betas)[:, :1]
    return TrainingPeople(poses, body.landmark("coco", poses, betas) - at)


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


def train_pose_regressor(
    body: Body,
    prior: PoseGaussian | PoseMixture,
    *,
    n: int = PEOPLE,
    passes: int = PASSES,
    hidden: tuple[int, ...] = HIDDEN,
    seed: int = 0,
    progress: Callable[[int, float], None] = lambda done, loss: None,
) -> PoseRegressor:
    """Train a regressor on `n` people in poses drawn from a prior, with random shapes.

    In each of the passes every person is seen by another camera at random (`draw_views`). The
    squared errors of angles are weighted by the squares of `radian_lengths`, so that they are about
    those of the landmarks. Half of the weights' noise is taken away by averaging them over the last
    passes (Polyak and Juditsky 1992). `progress` is called after each pass with the number of
    passes done and the loss.

    Raises NotSupported if scikit-learn is not installed, and BadArgument for a body without COCO's
    keypoints, another number of joints than the prior's, or counts below 1.
    """
    if min(n, passes, len(hidden), *hidden) < 1:
        raise BadArgument(f"n, passes and hidden must be at least 1, not {n}, {passes}, {hidden}")
    if "coco" not in body.landmarks or body.joint_names[1:] != prior.joint_names:
        raise BadArgument(
            f"the body {body.name!r} has no landmarks 'coco', or not the joints of the prior; a "
            "regressor is trained with a body of SMPL's 24 joints, such as `default`"
        )
    rng = np.random.default_rng(seed)
    return trained(
        body, people_in(body, draw_poses(prior, n, rng), rng), passes, hidden, rng, progress
    )


def neural_networks() -> ModuleType:
    """The neural networks of scikit-learn. Raises NotSupported where that is not installed."""
    try:
        return import_module("sklearn.neural_network")
    except ImportError as error:
        raise NotSupported(
            f"training a regressor needs scikit-learn, which is not installed: "
            f"{pip_install('learn')}. The regressor that comes with the workbench needs nothing"
        ) from error


def trained(
    body: Body,
    people: TrainingPeople,
    passes: int,
    hidden: tuple[int, ...],
    rng: np.random.Generator,
    progress: Callable[[int, float], None],
) -> PoseRegressor:
    """Train a regressor on given people; see `train_pose_regressor`."""
    neural_network = neural_networks()
    names = body.landmark_names("coco")
    rows = [names.index(name) for name in COCO]
    scales, mean = radian_lengths(body), people.poses.mean(axis=0)
    angles = ((people.poses - mean) * scales[:, None])[:, 1:].reshape(len(people.poses), -1)
    network = neural_network.MLPRegressor(
        hidden_layer_sizes=hidden,
        learning_rate_init=RATE,
        alpha=0.0,
        random_state=int(rng.integers(2**31)),
    )
    sums: list[Array] = []
    first = passes - max(1, round(AVERAGED * passes))
    for k in range(passes):
        R = draw_facings(len(angles), rng)
        rays, confidence = draw_views(people.landmarks[:, rows], R, COCO, rng)
        network_input, to_virtual = normalised(rays, confidence)
        columns = scales[0] * (to_virtual @ R)[..., :2].reshape(len(R), 6)
        x, y = network_input.reshape(len(R), -1), np.hstack([columns, angles])
        network.partial_fit(x.astype(np.float32), y.astype(np.float32))
        if k >= first:
            now = [np.array(a, dtype=float) for a in (*network.coefs_, *network.intercepts_)]
            sums = [a + b for a, b in zip(sums, now, strict=True)] if sums else now
        progress(k + 1, float(network.loss_))
    averages = [one / (passes - first) for one in sums]
    layers = len(averages) // 2
    weights, biases = tuple(averages[:layers]), tuple(averages[layers:])
    return PoseRegressor(COCO, body.joint_names, weights, biases, mean, scales)


def radian_lengths(body: Body) -> Array:
    """How far a turn of each joint by one radian moves the landmarks `coco`, rms in m: (K,).

    A landmark turns about a joint as far as its vertices follow it or joints below it. It is at
    least 0.03 m, because some joints move no landmark.
    """
    regressor = body.landmarks["coco"].regressor
    follows = regressor @ body.vertex_weights @ ancestors(body.parents)  # (M, K)
    away = body.landmark("coco")[:, None] - body.joints()
    moved: Array = np.sqrt(((follows * np.linalg.norm(away, axis=2)) ** 2).mean(axis=0))
    return np.maximum(moved, LEAST_SCALE)


def save_regressor(regressor: PoseRegressor, path: str | Path) -> None:
    """Write a regressor into an .npz; weights become multiples of a step, in 16 bits.

    The step is the largest weight of a layer / 32,767. Raises BadFile if it cannot be written.
    """
    arrays = {
        "keypoint_names": np.array(regressor.keypoint_names),
        "joint_names": np.array(regressor.joint_names),
        "mean": regressor.mean.astype(np.float32),
        "scales": regressor.scales.astype(np.float32),
    }
    for i, (W, b) in enumerate(zip(regressor.weights, regressor.biases, strict=True)):
        step = float(np.abs(W).max()) / LARGEST or 1.0
        arrays[f"weights_{i}"] = np.rint(W / step).astype(np.int16)
        arrays[f"step_{i}"] = np.array(step)
        arrays[f"biases_{i}"] = b.astype(np.float32)
    write_arrays(path, arrays)
