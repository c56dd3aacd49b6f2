"""How often a problem is evaluated, and for how long, within limits."""

import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager

from workbench.solvers.limits import Stop
from workbench.solvers.solution import Status


class Meter:
    """The number of evaluations of each kind, and a clock, which starts when this is made.

    Attributes:
        counts: the number of evaluations by kind.
    """

    def __init__(self, kinds: Iterable[str], max_evaluations: int, max_seconds: float) -> None:
        self.counts = dict.fromkeys(kinds, 0)
        self._limited = tuple(kind for kind in self.counts if is_limited(kind))
        self._max_evaluations, self._max_seconds = max_evaluations, max_seconds
        self._began, self._pauses = time.perf_counter(), 0.0

    @property
    def seconds(self) -> float:
        """The time on the clock, in s."""
        return time.perf_counter() - self._began - self._pauses

    def check_evaluations(self) -> None:
        """Raise Stop if all evaluations are used up; those of constraints are not limited."""
        if sum(map(self.counts.__getitem__, self._limited)) >= self._max_evaluations:
            raise Stop(Status.MAX_EVALUATIONS)

    def check_seconds(self) -> None:
        """Raise Stop if the time is used up."""
        if self.seconds > self._max_seconds:
            raise Stop(Status.MAX_SECONDS)

    @contextmanager
    def paused(self) -> Iterator[None]:
        """A context in which the clock stands still."""
        before = time.perf_counter()
        yield
        self._pauses += time.perf_counter() - before


def limited(counts: Mapping[str, int]) -> int:
    """How many of the evaluations are limited."""
    return sum(count for kind, count in counts.items() if is_limited(kind))


def is_limited(kind: str) -> bool:
    """Whether evaluations of a kind are limited: all but those of constraints."""
    return not kind.startswith("constraint")
