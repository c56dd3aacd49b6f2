"""Null vectors without what rounding leaves of long columns, by Newton steps."""

import numpy as np
import scipy.linalg

from workbench.arrays import Array
from workbench.problem import Linearization


def polished(null: Array, here: Linearization, tolerance: float) -> Array:
    """An orthonormal basis (n, d) of the null space, one Newton step from another one."""
    if not isinstance(here.jacobian, np.ndarray) or not here.jacobian.any():
        return null
    return np.asarray(np.linalg.qr(stepped(null, here.R, tolerance))[0])


def stepped(vectors: Array, R: Array, tolerance: float) -> Array:
    """Vectors (n, d) after a Newton step to where R takes them to zero."""
    cond = tolerance / float(np.linalg.norm(R))
    return np.asarray(vectors - scipy.linalg.lstsq(R, R @ vectors, cond=cond)[0])
