"""How long a step may be: a radius around a point, inside of which its linear model is trusted.

At a point far from a minimum the linear model may promise the most at a place that it knows nothing
about. There an exponential underflows or a peak has left the data, no unknown changes the residual
any more, and no way leads back.
"""

from collections.abc import Callable

import numpy as np

from workbench.arrays import Array
from workbench.problem import Linearization
from workbench.solvers.run import Run

FIRST = 0.9  # of the distance from zero: at zero itself roots and logarithms have no derivative
AGREED = 0.95  # of the predicted decrease: the linear model holds, and is tried farther out
GROWTH = 2.0  # of a step over the one before
TRUSTED = 0.1  # of |J p|: how far the linear model may be off where a step may be longer still


def first_radius(x: Array, D: Array, share: float = FIRST) -> float:
    """The radius at the start x (n,) in the metric D (n,): a share of max(|D x|, 1), usually 0.9.

    From a start that is not near zero, the first step thus does not lead as far as zero; from zero,
    it is shorter than one unit. SciPy's trf begins with |D x|, and with 1 at zero; MINPACK with 100
    |D x|, and with 100 at zero (Moré, The Levenberg-Marquardt algorithm: implementation and theory,
    1978).

    `TrustRegion` begins as trf does, without this function. Its radius shrinks to the length of the
    first step, whatever it was before, and follows the gain ratio from there; here the first radius
    caps steps that nothing else damps. The gym's stored results are those of these two rules.
    """
    return share * max(float(np.linalg.norm(D * x)), 1.0)


def radius_after(p: Array, change: Array, error: Array) -> float:
    """How long the step after p (n,) may be: twice as long, and longer where the model was right.

    `change` (m,) is J p, by which the linear model changed the residual, and `error` (m,) by how
    much the residual at the end of the step is another one. The error grows as the square of the
    length of a step, so that its share of the change grows as the length. The next step may be so
    long that this share would be a tenth. So nothing holds a linear problem up.
    """
    share = float(np.linalg.norm(error)) / max(float(np.linalg.norm(change)), 1e-300)
    return float(np.linalg.norm(p)) * max(GROWTH, TRUSTED / max(share, 1e-16))


def trusted(
    run: Run, x: Array, here: Linearization, step: Callable[[float], Array], longest: float
) -> float:
    """How long the first step may be, as a multiple of the radius; 0 if not even the radius holds.

    `step` gives the step p (n,) of a length. The lengths 1, 2, 4, ..., and `longest` are tried, and
    it is the last of these up to which the cost falls by 95 % of what the linear model predicts. So
    a start at which the model holds costs evaluations of the residual, and no further Jacobian. See
    Dennis and Schnabel, Numerical methods for unconstrained optimization and nonlinear equations,
    1983, section 6.4.3.
    """
    held, length = 0.0, 1.0
    while True:
        p = step(length)
        fall = here.cost - run.cost(x + p)
        if not 0 < AGREED * here.predicted_decrease(p) <= fall:
            return held
        held = length
        if length >= longest:
            return held
        length = min(GROWTH * length, longest)
