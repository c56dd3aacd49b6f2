"""Cameras around a synthetic person."""

from collections.abc import Mapping

import numpy as np

from workbench.arrays import Array

SIZE, FOCAL, AWAY = 1000, 1200.0, 4.0  # px, px, m


def looking_in(angle: float) -> Mapping[str, Array]:
    """The calibration of an upright camera on a circle about the origin, in front at angle 0."""
    forward = -np.array([np.sin(angle), 0.0, np.cos(angle)])
    down = np.array([0.0, -1.0, 0.0])
    middle = (SIZE - 1) / 2
    return {
        "K": np.array([[FOCAL, 0, middle], [0, FOCAL, middle], [0, 0, 1]]),
        "R": np.array([np.cross(down, forward), down, forward]),
        "t": np.array([0.0, 0.0, AWAY]),
    }
