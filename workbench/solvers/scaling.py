"""The metric D of a step: how much a change of each unknown by one unit counts."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.problem import Linearization

Scaling = Callable[[Linearization], Array]


def identity(here: Linearization) -> Array:
    """D = I (n,): a radian, a metre and a standard deviation of shape count the same.

    See Levenberg, A method for the solution of certain non-linear problems in least squares, 1944.
    """
    return np.ones(here.shape[1])


def columns(here: Linearization) -> Array:
    """D = diag |J_i| (n,): units of unknowns do not matter.

    See Marquardt, An algorithm for least-squares estimation of nonlinear parameters, 1963. This
    suits regressions. On bodies it hardly damps the unknowns that change the residual least, which
    then move far without need.
    """
    return np.where(here.column_norms > 0, here.column_norms, 1.0)


@dataclass
class Metric:
    """The metric of a trust region along a run: that of the present scaling, and no less than
    before.

    So a radius does not grow by itself where columns get shorter (Moré, The Levenberg-Marquardt
    algorithm: implementation and theory, 1978, section 6).

    Attributes:
        scaling: gives D (n,) at a point.
        D: (n,) the largest so far.
    """

    scaling: Scaling
    D: Array | float = 0.0

    def at(self, here: Linearization) -> Array:
        """D (n,) at the next point of a run."""
        self.D = np.maximum(self.D, self.scaling(here))
        return self.D
