"""The best point of a run, whatever the solver itself reports."""

import numpy as np

from workbench.arrays import Array


class Best:
    """The feasible point of lowest cost; as long as there is none, that of the least violation.

    Points whose costs differ by no more than rounding are compared by how stationary they are: the
    cost is flat at a minimum, the gradient is not.

    Attributes:
        x: (n,) the point.
        cost: the cost there.
        violation: by how many tolerances the worst constraint is exceeded there.
    """

    def __init__(self, start: Array) -> None:
        self.x, self.cost, self.violation = start.copy(), np.inf, np.inf
        self._settled: tuple[Array, float, float, float] | None = None  # and its optimality
        self._noise = 0.0  # of the cost there

    def offer(self, x: Array, cost: float, violation: float) -> None:
        """Take a point with a finite cost if it is better; `violation` is in tolerances."""
        if violation <= 1 and self.violation <= 1:
            better = cost < self.cost
        else:
            better = (violation, cost) < (self.violation, self.cost)
        if better:
            self.x, self.cost, self.violation = x.copy(), cost, violation

    def settle(
        self, x: Array, cost: float, violation: float, optimality: float, noise: float
    ) -> None:
        """Remember a point of known optimality, whose cost is uncertain by `noise`."""
        if violation > 1 or self.violation > 1 or not cost <= self.cost + noise:
            return
        if self._settled is None or optimality < self._settled[2] or self._settled_is_worse():
            self._settled, self._noise = (x.copy(), cost, optimality, violation), noise

    def decide(self, optimality: float) -> float:
        """Prefer the settled point if it costs the same and is more stationary than the best.

        Takes the optimality of the best point, and returns that of the chosen one.
        """
        if self._settled is None or self._settled_is_worse() or optimality <= self._settled[2]:
            return optimality
        self.x, self.cost, optimality, self.violation = self._settled
        return optimality

    def _settled_is_worse(self) -> bool:
        return self._settled is not None and self._settled[1] > self.cost + self._noise
