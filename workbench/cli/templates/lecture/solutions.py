"""Solutions of the exercises of lecture 0, NAME."""

import numpy as np


def influence(count: int, off: float) -> float:
    """See the exercise."""
    return off / count


def pull(r: float, k: float) -> float:
    """See the exercise."""
    return float(np.clip(r, -k, k))
