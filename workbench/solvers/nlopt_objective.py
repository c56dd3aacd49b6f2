"""The cost and the constraints as NLopt sees them: always finite, and nothing is raised."""

from collections.abc import Callable
from math import isfinite, sqrt

import nlopt
import numpy as np

from workbench.arrays import Array, Mask
from workbench.problem import Linearization
from workbench.problem.constraint_set import ConstraintSet
from workbench.problem.rounding import all_finite
from workbench.solvers.abilities import Abilities, Derivative
from workbench.solvers.judgement import BOUGHT
from workbench.solvers.run import Run

NOT_A_POINT = (
    "the algorithm broke down, for it asks for the cost at a point that is not a number; the best "
    "point before that was kept; try another algorithm"
)
LOOK = 3.0  # times the tolerance: an estimate of the optimality at which it is worth a Jacobian


class Objective:
    """The cost and the constraints in NLopt's variables y = scale x.

    An exception stops NLopt and is kept as `error`. Where the residual is not finite, NLopt gets
    the values of a cone that rises from the last good point, because with a NaN COBYLA never
    returns and the other algorithms do not get far.
    """

    def __init__(
        self,
        run: Run,
        here: Linearization,
        scale: Array,
        optimizer: nlopt.opt,
        abilities: Abilities,
    ) -> None:
        self.run, self.scale, self.optimizer = run, scale, optimizer
        self.error: BaseException | None = None
        self._descends = abilities.derivative is Derivative.GRADIENT and not abilities.is_global
        self._lowest = run.best.cost
        self._bounded, self._look = run.problem.bounded, LOOK
        self._last = run.x * scale, run.best.cost  # the last good point
        self._worst = run.best.cost
        self._norms, self._steep = np.where(scale > 0, scale, np.inf), 0
        self._error = run.problem.support.norms(run.rounding_noise.at(run.x, here).rows)

    def cost(self, y: Array, gradient: Array) -> float:
        """The cost at y, its gradient written into `gradient`, if that has a length."""
        if self.error is None:
            try:
                return self._evaluate(y, gradient)
            except BaseException as error:
                self._give_up(error)
        gradient[:] = 0.0
        return float(self._last[1])

    def rows(
        self, there: ConstraintSet, wanted: Mask, sign: float, limit: Array
    ) -> Callable[[Array, Array, Array], None]:
        """A function of NLopt's form for sign (c - limit) of the `wanted` rows (k,)."""

        def evaluate(result: Array, y: Array, gradient: Array) -> None:
            result[:] = 0.0
            if gradient.size:
                gradient[:] = 0.0
            if self.error is not None:
                return
            try:
                x = self._x(y)
                if gradient.size:
                    at = (x, self.run.fixed)
                    here = self.run.evaluate("constraint", lambda: there.linearize(*at))
                    values = here.values
                    slopes = sign * here.rows(wanted) / self.scale
                    gradient[:] = np.where(np.isfinite(slopes), slopes, 0.0)
                else:
                    values = self.run.constraints(x)
                found = sign * (values - limit)[wanted]
                result[:] = np.where(np.isfinite(found), found, 1e10)
            except BaseException as error:
                self._give_up(error)

        return evaluate

    def _give_up(self, error: BaseException) -> None:
        self.error = error
        self.optimizer.force_stop()

    def _x(self, y: Array) -> Array:
        x, problem = y / self.scale, self.run.problem
        if not self._bounded:
            return x
        return np.clip(x, problem.lower, problem.upper)  # which rounding may have left

    def _evaluate(self, y: Array, gradient: Array) -> float:
        run, x = self.run, self._x(y)
        if not all_finite(y):
            run.stall(NOT_A_POINT)
        if gradient.size:
            cost, g = run.cost_and_gradient(x)
            if isfinite(cost):
                gradient[:] = g / self.scale
        else:
            cost, g = run.cost(x), np.zeros(0)
        if not isfinite(cost):
            return self._cone(y, gradient)
        self._last, self._worst = (y.copy(), cost), max(self._worst, cost)
        if self._is_worth_recording(cost):
            self._lowest = cost
            run.record(x, cost, self._linearization(x, g))
        return cost

    def _is_worth_recording(self, cost: float) -> bool:
        """Whether the cost is the lowest, or may be that of a more stationary feasible point."""
        best = self.run.best
        if self.run.problem.stacked_constraints is None:
            return cost < self._lowest
        return best.cost == cost or (best.violation <= 1 and cost <= (1 + BOUGHT) * best.cost)

    def _cone(self, y: Array, gradient: Array) -> float:
        """A cost higher than all before, whose gradient leads back to the last good point."""
        good, cost = self._last
        way, high = y - good, 10 * abs(self._worst) + 1
        length = float(np.linalg.norm(way))
        if gradient.size:
            gradient[:] = (high - cost) * way / length**2 if length > 0 else 0.0
        return float(high)

    def _linearization(self, x: Array, g: Array) -> Linearization | None:
        """The linearization at x (n,) if the point may be nearly stationary, else None.

        The gradient g (n,) and the column norms of the last Jacobian tell whether it may be.
        """
        run, problem = self.run, self.run.problem
        if not (self._descends and g.size):
            return None
        if problem.stacked_constraints is None and self._is_steep(x, g):
            return None
        here = run.linearize(x)
        self._look = 1.0  # from here on the norms are good
        self._norms = np.where(here.column_norms > 0, here.column_norms, np.inf)
        self._error = problem.support.norms(run.rounding_noise.at(x, here).rows)
        return here

    def _is_steep(self, x: Array, g: Array) -> bool:
        """Whether the gradient g (n,) at x (n,) is clearly no longer that of a stationary point.

        Without bounds, the unknown by which the point before was steep is looked at first.
        """
        run, problem, i = self.run, self.run.problem, self._steep
        more = self._look * run.limits.gradient_tolerance * sqrt(2 * run.best.cost)
        if self._bounded:
            low, high = (problem.lower - x) * self._norms, (problem.upper - x) * self._norms
            way = np.clip(-g / self._norms, low, high)
        elif abs(g[i]) / self._norms[i] > self._error[i] + more:
            return True
        else:
            way = g / self._norms
        steep = np.abs(way) > self._error + more
        self._steep = int(steep.argmax())
        return bool(steep[self._steep])
