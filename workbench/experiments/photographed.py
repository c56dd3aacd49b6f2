"""Photographs of made-up people, whose answer is known."""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.fitting.observations import Observations, photograph

CAMERA = "camera"  # what every camera is called, so that all shots share one problem
FOCAL, SIZE, TALL = 1200.0, 1100, 1.7  # px, px and m
HEIGHTS = (400.0, 900.0)  # px, of a person in the image


@dataclass(frozen=True, eq=False)
class Shot:
    """What one camera saw of a person.

    Attributes:
        observed: the keypoints in one photograph, whose name is `CAMERA`.
        truth: pose, betas and trans of the person.
    """

    observed: Observations
    truth: Values


def made_up_shots(
    body: SkinnedBody, poses: Array, facings: Array, rng: np.random.Generator, *, noise: float
) -> list[Shot]:
    """People in given poses (N, K, 3) rad with betas from N(0, 1), 400 to 900 px tall.

    `facings` (N, 3, 3) take the world to each camera, and keypoints have `noise` px in each
    coordinate.
    """
    names = body.landmark_names("coco")
    K = np.array([[FOCAL, 0, SIZE / 2], [0, FOCAL, SIZE / 2], [0, 0, 1]])
    found = []
    for pose, R in zip(poses, facings, strict=True):
        betas = rng.standard_normal(body.n_betas)
        truth = {"pose": pose, "betas": betas, "trans": -body.joints(pose, betas).mean(axis=0)}
        t = np.array([0.0, 0.0, FOCAL * TALL / rng.uniform(*HEIGHTS)])
        seen = body.landmark("coco", *truth.values()) @ R.T + t
        pixels = FOCAL * seen[:, :2] / seen[:, 2:] + SIZE / 2
        pixels = pixels + noise * rng.standard_normal(pixels.shape)
        points = np.column_stack([pixels, np.ones(len(names))])
        shot = photograph(CAMERA, (SIZE, SIZE), points, {"K": K, "R": R, "t": t})
        found.append(Shot(Observations(tuple(names), (shot,)), truth))
    return found
