"""Training a regressor of poses on synthetic views, by scikit-learn's multi-layer perceptron."""

from collections.abc import Callable
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.bodies.forward.kinematics import ancestors
from workbench.environment import pip_install
from workbench.errors import BadArgument, NotSupported
from workbench.fitting.observations import COCO
from workbench.fitting.pose_regressor import PoseRegressor, normalised
from workbench.fitting.synthetic_views import People, draw_facings, draw_people, draw_views
from workbench.priors.poses import PoseGaussian, PoseMixture

HIDDEN = (256, 256)
PEOPLE, PASSES = 20_000, 60
RATE = 2e-3  # of Adam's method (Kingma and Ba 2015)
AVERAGED = 0.3  # of the passes, the last ones, whose weights are averaged
LEAST_SCALE = 0.03  # m per rad: joints that move no landmark are learned a little as well


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

    In each of the passes every person is seen by another camera at random (`synthetic_views`). The
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
    return trained(body, draw_people(body, prior, n, rng), passes, hidden, rng, progress)


def trained(
    body: Body,
    people: People,
    passes: int,
    hidden: tuple[int, ...],
    rng: np.random.Generator,
    progress: Callable[[int, float], None],
) -> PoseRegressor:
    """Train a regressor on given people; see `train_pose_regressor`."""
    names = body.landmark_names("coco")
    rows = [names.index(name) for name in COCO]
    scales, mean = radian_lengths(body), people.poses.mean(axis=0)
    angles = ((people.poses - mean) * scales[:, None])[:, 1:].reshape(len(people.poses), -1)
    network = neural_networks().MLPRegressor(
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
    return PoseRegressor(
        COCO,
        body.joint_names,
        tuple(averages[:layers]),
        tuple(averages[layers:]),
        mean,
        scales,
    )


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


def neural_networks() -> Any:
    """scikit-learn's module of neural networks. Raises NotSupported if it is not installed."""
    try:
        from sklearn import neural_network  # type: ignore[import-untyped]  # it has none
    except ImportError as error:
        raise NotSupported(
            f"training a regressor needs scikit-learn, which is not installed: "
            f"{pip_install('learn')}. The regressor that comes with the workbench needs nothing"
        ) from error
    return neural_network
