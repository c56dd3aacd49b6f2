"""Rounding errors along a run: measured where they may matter, and not at every point."""

import numpy as np

from workbench.arrays import Array, Mask
from workbench.problem import Linearization, Problem
from workbench.problem.rounding import Rounding
from workbench.solvers.limits import guarded
from workbench.solvers.linearization_cache import LinearizationCache

CLEARLY = 100.0  # times the rounding errors of a few points ago: they do not matter
OFTEN = 5  # linearizations after which they are measured in any case


class RoundingNoise:
    """How much rounding errors hide at the points of a run.

    To measure them takes about a tenth of a linearization. What was measured a few points ago is
    enough to tell that they are nothing beside the residual, as they are on most of the way.
    """

    def __init__(self, problem: Problem, fixed: Array, linearizations: LinearizationCache) -> None:
        self._problem, self._fixed, self._linearizations = problem, fixed, linearizations
        self._last: Rounding | None = None
        self.age = 0  # of the last measurement, in linearizations

    def at(self, x: Array, here: Linearization) -> Rounding:
        """How much of each row of the residual may be rounding error at x, measured there.

        At a far start it may be larger than all of the residual at the minimum.
        """

        def measure() -> Rounding:
            self._last, self.age = self._problem.rounding(x, self._fixed, here.residual), 0
            return self._last

        return self._linearizations.rounding(here, guarded()(measure))

    def of_cost(self, x: Array, here: Linearization) -> float:
        """By how much rounding may have changed the cost at x."""
        return self.at(x, here).of_cost(here.residual)

    def about(self, x: Array, here: Linearization) -> Rounding:
        """The same, or what it was a few points ago."""
        return self._lately or self.at(x, here)

    def optimality(self, x: Array, here: Linearization) -> float:
        """The problem's measure, less what rounding explains at x."""

        def measure() -> float:
            if (last := self._lately) is not None:
                found = self._problem.optimality(x, here)
                if found * min(1.0, float(np.sqrt(2 * here.cost))) > CLEARLY * last.norm:
                    return found
            return self._problem.optimality(x, here, self.at(x, here))

        return self._linearizations.optimality(here, measure)

    def hides(
        self,
        predicted: float,
        x: Array,
        here: Linearization,
        moved: Mask | None = None,
    ) -> bool:
        """Whether rounding may hide such a fall of the cost from x.

        Only rows that `moved` (m,) count, if they are known.
        """
        last = self._lately
        if last is not None and predicted > CLEARLY * last.of_cost(here.residual):
            return False
        rounding = self.at(x, here)
        if moved is None:
            return predicted <= rounding.of_cost(here.residual)
        return predicted <= rounding.of_fall(here.residual, moved)

    @property
    def _lately(self) -> Rounding | None:
        return self._last if self.age < OFTEN else None
