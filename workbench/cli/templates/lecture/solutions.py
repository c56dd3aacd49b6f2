"""Solutions of the exercises of lecture 0, NAME."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def influence(count: int, off: float) -> float:
    """See the exercise."""
    return off / count


def pull(r: float, k: float) -> float:
    """See the exercise."""
    return float(np.clip(r, -k, k))


def step(x: float, readings: Array, k: float) -> float:
    """See the exercise."""
    r = x - readings
    weights = np.where(r == 0, 1.0, np.clip(r, -k, k) / np.where(r == 0, 1.0, r))
    return float(weights @ readings / weights.sum())
