"""The best point of a run, by our own account and nobody else's."""

import numpy as np

from workbench.arrays import Array


class Best:
    """The feasible point of lowest cost; while there is none, the one that misses least.

    Costs that rounding cannot tell apart are told apart by how stationary the points are: the
    cost is flat at a minimum, the gradient is not.
    """

    def __init__(self, start: Array) -> None:
        self.x, self.cost, self.violation = start.copy(), np.inf, np.inf
        self._settled: tuple[Array, float, float, float] | None = None  # and its optimality
        self._noise = 0.0  # of the cost there

    def offer(self, x: Array, cost: float, violation: float) -> None:
        """A point with a finite cost that misses constraints by so many tolerances."""
        if violation <= 1 and self.violation <= 1:
            better = cost < self.cost
        else:
            better = (violation, cost) < (self.violation, self.cost)
        if better:
            self.x, self.cost, self.violation = x.copy(), cost, violation

    def settle(
        self, x: Array, cost: float, violation: float, optimality: float, noise: float
    ) -> None:
        """A point of which it is known how stationary it is, and how rough its cost."""
        if violation > 1 or self.violation > 1 or not cost <= self.cost + noise:
            return
        if self._settled is None or optimality < self._settled[2] or self._settled_is_worse():
            self._settled, self._noise = (x.copy(), cost, optimality, violation), noise

    def decide(self, optimality: float) -> float:
        """Prefer the settled point, if it costs the same and is more stationary than the best.

        Given how stationary the best point is, answers how stationary the chosen one is.
        """
        if self._settled is None or self._settled_is_worse() or optimality <= self._settled[2]:
            return optimality
        self.x, self.cost, optimality, self.violation = self._settled
        return optimality

    def _settled_is_worse(self) -> bool:
        return self._settled is not None and self._settled[1] > self.cost + self._noise
