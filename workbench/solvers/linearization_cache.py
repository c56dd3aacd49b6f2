"""The last linearization of a run, which is returned again to whoever asks at the same point."""

from collections.abc import Callable
from typing import Any, TypeVar

from workbench.arrays import Array
from workbench.problem import Linearization

T = TypeVar("T")


class LinearizationCache:
    """One linearization, the point where it was made, and what was measured there.

    Only one is kept, because Jacobians are large and the next one can use the same memory.
    """

    def __init__(self) -> None:
        self._point = b""
        self._here: Linearization | None = None
        self._measured: dict[str, Any] = {}

    def at(self, x: Array) -> Linearization | None:
        """The linearization if it was made at x (n,), else None."""
        return self._here if self._here is not None and self._point == x.tobytes() else None

    def forget(self) -> None:
        """Free the memory of the linearization and of everything measured there."""
        self._here, self._measured = None, {}

    def keep(self, x: Array, here: Linearization) -> Linearization:
        """Keep a linearization at x (n,) in place of the one before, and return it."""
        self._point, self._here, self._measured = x.tobytes(), here, {}
        return here

    def once(self, what: str, here: Linearization, measure: Callable[[], T]) -> T:
        """The result of `measure`, which is called once for the linearization that is kept.

        `what` names the quantity. For any other linearization it is measured every time.
        """
        if here is not self._here:
            return measure()
        if what not in self._measured:
            self._measured[what] = measure()
        found: T = self._measured[what]
        return found
