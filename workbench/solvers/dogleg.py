"""Powell's dogleg: down the slope, then over to Gauss-Newton, as far as the model is trusted."""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.problem import Linearization, Problem
from workbench.problem.steps import LinearAlgebra, automatic
from workbench.solvers.abilities import Abilities, Boxes, Derivative, refuse
from workbench.solvers.run import Run
from workbench.solvers.scaling import Scaling, identity
from workbench.solvers.solution import Callback, Solution


@dataclass(frozen=True)
class RadiusRule:
    """How the trust region follows the gain: above `good` it reaches `growth` |D p| at least,
    below `poor` it is multiplied by `shrinkage`.
    """

    good: float
    growth: float
    poor: float
    shrinkage: float


textbook = RadiusRule(good=0.75, growth=3.0, poor=0.25, shrinkage=0.5)  # Madsen et al. 2004, 3.3
chumpy = RadiusRule(good=0.9, growth=2.5, poor=0.05, shrinkage=0.25)  # of the course's optimizer


def cauchy_point(here: Linearization, D: Array) -> Array:
    """The least of the linear model along the steepest descent in the metric D: a step (n,)."""
    downhill = -here.gradient / D**2
    rise = float(np.sum(here.along(downhill) ** 2))
    fall = -float(here.gradient @ downhill)
    return downhill * (fall / rise) if rise > 0 else downhill


def dogleg_step(newton: Array, cauchy: Array, D: Array, radius: float) -> Array:
    """Where the path 0 - Cauchy point - Gauss-Newton point leaves the ball |D p| <= radius."""
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
class Dogleg:
    """A trust region whose step costs one factorization (Powell 1970).

    The first radius is the length of the first Gauss-Newton step. `chumpy` as the rule makes it
    the optimizer that the course's body models were first fitted with.
    """

    rule: RadiusRule = textbook
    scaling: Scaling = identity
    linear_algebra: LinearAlgebra = automatic
    max_iterations: int = 200
    max_evaluations: int = 10_000
    max_seconds: float = 600.0
    gradient_tolerance: float = 1e-6

    @property
    def abilities(self) -> Abilities:
        """A Jacobian at every iterate; no bounds."""
        return Abilities(
            Derivative.JACOBIAN,
            Boxes.UNKNOWN,
            source="Powell 1970; Madsen, Nielsen and Tingleff 2004",
            note="by the rules of the course's optimizer" if self.rule is chumpy else "",
        )

    def solve(
        self, problem: Problem, start: Values, *, callback: Callback | None = None
    ) -> Solution:
        """See Solver; raises NotSupported for a problem with bounds or constraints."""
        refuse("dogleg", self.abilities, problem)
        with Run("dogleg", self, problem, start, callback) as run:
            x = run.x
            here = run.linearize(x)
            run.record(x, here.cost, run.optimality(x, here))
            radius = np.inf
            while True:
                D = self.scaling(here)
                newton = self.linear_algebra(here, 0.0, np.ones_like(D))
                if newton is None:
                    run.stall("the columns of the Jacobian are dependent; use automatic")
                if not np.isfinite(radius):
                    radius = float(np.linalg.norm(D * newton.p))
                cauchy = cauchy_point(here, D)
                while True:
                    p = dogleg_step(newton.p, cauchy, D, radius)
                    trial = run.gain_ratio(x, here, x + p, here.predicted_decrease(p))
                    length = float(np.linalg.norm(D * p))
                    if trial.gain_ratio > self.rule.good:
                        radius = max(radius, self.rule.growth * length)
                    elif trial.gain_ratio < self.rule.poor:
                        radius *= self.rule.shrinkage
                    if trial.gain_ratio > 0:
                        break
                    shortest = 1e-16 * np.linalg.norm(D * x)
                    if not shortest <= radius < np.inf or np.array_equal(x + p, x):
                        run.stall()
                if (there := trial.there) is None:
                    del here  # first: its memory serves the next one
                    there = run.linearize(x + p)
                x, here = run.wrapped(x + p, there)
                run.record(x, here.cost, run.optimality(x, here), 0.0, newton.by)
        return run.solution()
