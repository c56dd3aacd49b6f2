"""The last linearization of a run: whoever asks at the same point again gets it back."""

from collections.abc import Callable

from workbench.arrays import Array
from workbench.problem import Linearization
from workbench.problem.rounding import Rounding


class LinearizationCache:
    """One linearization, where it was made, its rounding errors, and how stationary it is there.

    Only one: Jacobians are large, and memory that is free again is used for the next.
    """

    def __init__(self) -> None:
        self._point = b""
        self._here: Linearization | None = None
        self._optimality: float | None = None
        self._rounding: Rounding | None = None

    def at(self, x: Array) -> Linearization | None:
        """The linearization, if it was made at x."""
        return self._here if self._here is not None and self._point == x.tobytes() else None

    def forget(self) -> None:
        """Free its memory."""
        self._here = self._optimality = self._rounding = None

    def keep(self, x: Array, here: Linearization) -> Linearization:
        """Instead of the one before."""
        self._point, self._here = x.tobytes(), here
        self._optimality = self._rounding = None
        return here

    def rounding(self, here: Linearization, measure: Callable[[], Rounding]) -> Rounding:
        """As measured; of the one that is kept, once."""
        if here is not self._here:
            return measure()
        if self._rounding is None:
            self._rounding = measure()
        return self._rounding

    def optimality(self, here: Linearization, measure: Callable[[], float]) -> float:
        """As measured; of the one that is kept, once."""
        if here is not self._here:
            return measure()
        if self._optimality is None:
            self._optimality = measure()
        return self._optimality
