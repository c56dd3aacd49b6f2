"""Rounding errors along a run, measured where they may matter and not at every point."""

import numpy as np

from workbench.arrays import Array, Mask
from workbench.problem import Linearization, Problem
from workbench.problem.rounding import Rounding
from workbench.solvers.limits import GUARDED
from workbench.solvers.linearization_cache import LinearizationCache

CLEARLY = 100.0  # times the rounding errors of a few points ago: they do not matter
OFTEN = 5  # linearizations after which they are measured in any case


class RoundingNoise:
    """How much rounding errors hide at the points of a run.

    Measuring rounding errors takes up to a tenth of the time of a linearization. During most of a
    run, the measurement at an earlier point is enough to tell that rounding errors are much smaller
    than the residual.
    """

    def __init__(self, problem: Problem, fixed: Array, linearizations: LinearizationCache) -> None:
        self._problem, self._fixed, self._linearizations = problem, fixed, linearizations
        self._last: Rounding | None = None
        self.age = 0  # of the last measurement, in linearizations

    def at(self, x: Array, here: Linearization) -> Rounding:
        """How much of each row of the residual may be rounding error at x (n,), measured there.

        At a far start it may be larger than all of the residual at the minimum.
        """

        def measure() -> Rounding:
            self._last, self.age = self._problem.rounding(x, self._fixed, here.residual), 0
            return self._last

        return self._linearizations.once("rounding", here, GUARDED(measure))

    def of_cost(self, x: Array, here: Linearization) -> float:
        """By how much rounding may have changed the cost at x (n,)."""
        return self.at(x, here).of_cost(here.residual)

    def recent(self, x: Array, here: Linearization) -> Rounding:
        """The rounding errors measured a few points ago, or those at x (n,) if there are none."""
        return self._recent or self.at(x, here)

    def optimality(self, x: Array, here: Linearization) -> float:
        """`Problem.optimality` at x (n,), less what rounding explains there."""

        def measure() -> float:
            if (last := self._recent) is not None:
                found = self._problem.optimality(x, here)
                if found * min(1.0, float(np.sqrt(2 * here.cost))) > CLEARLY * last.norm:
                    return found
            return self._problem.optimality(x, here, self.at(x, here))

        return self._linearizations.once("optimality", here, measure)

    def hides(
        self,
        predicted: float,
        x: Array,
        here: Linearization,
        moved: Mask | None = None,
    ) -> bool:
        """Whether rounding may hide that the cost falls from x (n,) by as much as `predicted`.

        If `moved` (m,) is given, only these rows of the residual count.
        """
        last = self._recent
        if last is not None and predicted > CLEARLY * last.of_cost(here.residual):
            return False
        rounding = self.at(x, here)
        if moved is None:
            return predicted <= rounding.of_cost(here.residual)
        return predicted <= rounding.of_fall(here.residual, moved)

    @property
    def _recent(self) -> Rounding | None:
        return self._last if self.age < OFTEN else None
