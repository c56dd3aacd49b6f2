"""The metric D of a step: what a unit of each entry costs."""

from collections.abc import Callable

import numpy as np

from workbench.arrays import Array
from workbench.problem import Linearization

Scaling = Callable[[Linearization], Array]


def identity(here: Linearization) -> Array:
    """D = I: a radian, a metre and a standard deviation of shape cost the same (Levenberg 1944)."""
    return np.ones(here.shape[1])


def columns(here: Linearization) -> Array:
    """D = diag |J_i|: no entry's unit matters (Marquardt 1963). Right for regressions; on bodies
    it frees the entries that the data hardly see, and the fit wanders.
    """
    return np.where(here.column_norms > 0, here.column_norms, 1.0)
