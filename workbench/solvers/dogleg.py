"""Powell's dogleg: along the gradient, then towards the Gauss-Newton step, in a trust region."""

from dataclasses import KW_ONLY, dataclass

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.problem import Linearization, Problem
from workbench.problem.steps import LinearAlgebra, automatic
from workbench.solvers.abilities import Abilities, Boxes, Derivative
from workbench.solvers.limits import Limits
from workbench.solvers.run import Run
from workbench.solvers.solution import Callback, Solution
from workbench.solvers.trust_region import Scaling, identity

FIRST_SHARE = 0.9  # of the distance from zero, where roots and logarithms have no derivative
MODEL_HOLDS_FROM = 0.95  # of the predicted decrease


@dataclass(frozen=True)
class RadiusRule:
    """How the radius of the trust region follows the gain ratio.

    Attributes:
        good: a gain ratio above this makes the radius at least `growth` |D p|.
        growth: see `good`; a larger one trusts the linear model farther at once.
        poor: a gain ratio below this multiplies the radius by `shrinkage`.
        shrinkage: see `poor`, between 0 and 1.
        first: the first radius, at most, as a share of the distance of the start from zero, or of 1
            if that is more; infinite for the length of the first Gauss-Newton step.
    """

    good: float
    growth: float
    poor: float
    shrinkage: float
    first: float


# Madsen, Nielsen and Tingleff, Methods for non-linear least squares problems, 2004, section 3.3;
# they leave the first radius to the user
textbook = RadiusRule(good=0.75, growth=3.0, poor=0.25, shrinkage=0.5, first=FIRST_SHARE)
# the rule of chumpy, the optimizer with which SMPL was first fitted
chumpy = RadiusRule(good=0.9, growth=2.5, poor=0.05, shrinkage=0.25, first=np.inf)


def first_radius(x: Array, D: Array, share: float = FIRST_SHARE) -> float:
    """The radius at the start x (n,) in the metric D (n,): a share of max(|D x|, 1), usually 0.9.

    Far from a minimum the linear model may promise the most at a place that it knows nothing about:
    there an exponential underflows, no unknown changes the residual any more, and no way leads
    back. With this radius the first step does not lead as far as zero. SciPy's trf begins with
    |D x|, MINPACK with 100 times as much (Moré 1978).
    """
    return share * max(float(np.linalg.norm(D * x)), 1.0)


def model_holds(run: Run, x: Array, here: Linearization, p: Array) -> bool:
    """Whether the cost falls along the step p (n,) by 95 % of what the linear model predicts."""
    predicted = here.predicted_decrease(p)
    return 0 < MODEL_HOLDS_FROM * predicted <= here.cost - run.cost(x + p)


def cauchy_point(here: Linearization, D: Array) -> Array:
    """The Cauchy point: the minimum of the linear model along -D^-2 g, as a step (n,)."""
    downhill = -here.gradient / D**2
    rise = float(np.sum(here.along(downhill) ** 2))
    fall = -float(here.gradient @ downhill)
    return downhill * (fall / rise) if rise > 0 else downhill


def dogleg_step(newton: Array, cauchy: Array, D: Array, radius: float) -> Array:
    """The step (n,) at which the dogleg path leaves the trust region |D p| <= radius.

    The path leads from 0 straight to the Cauchy point, and from there to the Gauss-Newton step.
    """
    if np.linalg.norm(D * newton) <= radius:
        return newton
    length = float(np.linalg.norm(D * cauchy))
    if length >= radius:
        return cauchy * (radius / length)
    leg = D * (newton - cauchy)
    a, b, c = leg @ leg, (D * cauchy) @ leg, radius**2 - length**2
    root = float(np.sqrt(b * b + a * c))
    share = c / (b + root) if b > 0 else (root - b) / a  # without cancellation
    return np.asarray(cauchy + share * (newton - cauchy))


@dataclass(frozen=True)
class Dogleg(Limits):
    """Powell's dogleg: a trust-region method that needs one factorization for each iterate.

    The first radius is the length of the first Gauss-Newton step if the linear model proves right
    there, or else `first_radius` at most; chumpy's rule takes that step, however long it is. See
    Powell, A hybrid method for nonlinear equations, 1970, and Madsen, Nielsen and Tingleff, Methods
    for non-linear least squares problems, 2004, section 3.3.

    Attributes:
        rule: how the radius follows the gain ratio: `textbook`, or `chumpy`, with which this is the
            optimizer by which SMPL was first fitted.
        scaling: the metric D of the trust region. `identity`: a radian, a metre and a standard
            deviation count the same; `columns`: units of unknowns do not matter.
        linear_algebra: how the Gauss-Newton step is computed; `automatic` chooses a factorization.
    """

    rule: RadiusRule = textbook
    scaling: Scaling = identity
    linear_algebra: LinearAlgebra = automatic
    _: KW_ONLY
    max_iterations: int = 2_000

    @property
    def abilities(self) -> Abilities:
        """It needs a Jacobian at every iterate, and takes no bounds."""
        source = "Powell 1970; Madsen, Nielsen and Tingleff 2004"
        of_chumpy = "with the radius rules of chumpy, with which SMPL was first fitted"
        note = of_chumpy if self.rule is chumpy else ""
        return Abilities(Derivative.JACOBIAN, Boxes.REFUSED, source=source, note=note)

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`; see `Solver`. Raises NotSupported for bounds or constraints."""
        with Run("dogleg", self, problem, start, callback) as run:
            x, here = run.x, run.begin()
            radius = np.inf
            while True:
                D = self.scaling(here)
                newton = self.linear_algebra(here, 0.0, np.ones_like(D))
                if newton is None:
                    run.stall("the columns of the Jacobian are dependent; use automatic")
                cauchy = cauchy_point(here, D)
                if not np.isfinite(radius):  # at the start
                    whole = float(np.linalg.norm(D * newton.p))
                    radius = min(whole, first_radius(x, D, self.rule.first))
                    if radius < whole and model_holds(run, x, here, newton.p):
                        radius = whole
                while True:
                    p = dogleg_step(newton.p, cauchy, D, radius)
                    gain_ratio = run.gain_ratio(x, here, x + p, here.predicted_decrease(p))
                    length = float(np.linalg.norm(D * p))
                    if gain_ratio > self.rule.good:
                        radius = max(radius, self.rule.growth * length)
                    elif gain_ratio < self.rule.poor:
                        radius *= self.rule.shrinkage
                    if gain_ratio > 0:
                        break
                    shortest = 1e-16 * np.linalg.norm(D * x)
                    if not shortest <= radius < np.inf or np.array_equal(x + p, x):
                        run.stall()
                del here  # first: its memory serves the next one
                x, here = run.move(x + p, 0.0, newton.by)
        return run.solution()
