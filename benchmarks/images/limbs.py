"""What fits to images and videos are judged by: twelve landmarks of the limbs."""

import numpy as np

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.fitting.observations import LIMBS, SIDES

NAMES = tuple(f"{side}_{part}" for side in SIDES for part in LIMBS)
HIPS = [NAMES.index(f"{side}_hip") for side in SIDES]


def limbs(body: SkinnedBody, landmarks: Array) -> Array:
    """The twelve limb landmarks (..., 12, 3) of all (..., M, 3)."""
    names = body.landmark_names("coco")
    return landmarks[..., [names.index(name) for name in NAMES], :]


def mean_distance(found: Array, true: Array) -> float:
    """The mean distance of points (..., 3) m, in mm."""
    return 1e3 * float(np.linalg.norm(found - true, axis=-1).mean())


def mpjpe(found: Array, true: Array) -> float:
    """The same for limbs (..., 12, 3) m after the middles of the hips were brought together."""
    found, true = (x - x[..., HIPS, :].mean(axis=-2, keepdims=True) for x in (found, true))
    return mean_distance(found, true)
