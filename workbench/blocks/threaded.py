"""A function of many rows, divided among the processor's cores where that is faster.

Threads are enough because CasADi releases Python's lock while it works: nothing is copied to
another process, and every row is computed as it would be alone, so that the numbers are the same to
the last bit. A function that asks Python (a `casadi.Callback`) gains nothing, and neither does a
short one: both ways are tried, and the clock decides.
"""

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks.batched import Batched, count
from workbench.browser import in_browser

WORTH = 2e-4  # seconds a row: handing rows to a thread takes about as long as one such row
TRIED = 3  # calls that are timed on one core, and as many on all cores


def available_cores() -> int:
    """How many cores this process may use; one in a browser, which has no threads."""
    if in_browser():
        return 1
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


class Threaded:
    """A `Batched` function that is divided among the cores where that is measured to be faster.

    `make` makes the function, once for each thread, so that each has memory of its own.
    """

    def __init__(self, make: Callable[[], Batched], shared: Sequence[bool]) -> None:
        self._make, self._shared = make, tuple(shared)
        self._alone = make()
        self._seconds: dict[bool, list[float]] = {
            False: [],
            True: [],
        }  # by whether apart

    def __call__(self, *arguments: Array) -> list[Array]:
        """Arguments (M, .), or (.) where they are shared; a list of outputs (M, .)."""
        M = count(arguments, self._shared)
        if available_cores() < 2 or 2 * available_cores() > M:
            return self._alone(*arguments)
        apart = self._faster_apart()
        began = time.perf_counter()
        found = self._apart(*arguments) if apart else self._alone(*arguments)
        if len(self._seconds[apart]) < TRIED:
            self._seconds[apart].append((time.perf_counter() - began) / M)
        return found

    def _faster_apart(self) -> bool:
        """Whether several cores were faster; both ways are tried in turn until they are timed."""
        alone, apart = self._seconds[False], self._seconds[True]
        if len(apart) < TRIED and (not alone or min(alone) < WORTH):
            return False
        return len(apart) < len(alone) if len(apart) < TRIED else min(apart) < min(alone)

    def _apart(self, *arguments: Array) -> list[Array]:
        parts = np.array_split(np.arange(count(arguments, self._shared)), len(self._each))

        def some(one: Batched, rows: Index) -> list[Array]:
            given = zip(arguments, self._shared, strict=True)
            return one(*(a if same else a[rows] for a, same in given))

        pieces = list(self._pool.map(some, self._each, parts))
        return [np.concatenate(part) for part in zip(*pieces, strict=True)]

    @cached_property
    def _each(self) -> list[Batched]:
        return [self._alone, *(self._make() for _ in range(available_cores() - 1))]

    @cached_property
    def _pool(self) -> ThreadPoolExecutor:
        return ThreadPoolExecutor(len(self._each))
