"""The type that holds the numbers of an array exactly and is read in the least time.

What limits a posed surface is reading its shape and pose directions. Those of an embedded body are
whole multiples of one step, and those of many files are single precision: four bytes hold each of
them, and the processor makes eight of them again in its registers, the same to the bit. The numbers
of steps would fit into two bytes. But to make doubles of these takes more instructions than the one
that single precision takes, which costs more than reading four bytes (measured: the points of
`full` take a third longer).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array

MOST = np.iinfo(np.int16).max  # steps on either side of zero, as in the files of embedded bodies
SAMPLE = 500  # numbers from which a step is guessed
TOGETHER = 2**16  # numbers that are compared at a time
DIGITS = range(1, 17)  # of a step that somebody has written down


class Stored(Enum):
    """How numbers are stored: as a count of steps or as they are, and in which precision."""

    STEPS = "steps"
    SINGLE = "single"
    DOUBLE = "double"

    @property
    def in_c(self) -> str:
        """How the C code calls the type of one stored number: `double` or `float`."""
        return "double" if self is Stored.DOUBLE else "float"

    @property
    def dtype(self) -> np.dtype[Any]:
        """The type of one stored number in NumPy: double or single precision."""
        return np.dtype(np.float64 if self is Stored.DOUBLE else np.float32)


@dataclass(frozen=True)
class Storage:
    """How the numbers of an array are stored: each is what is stored, times `step`.

    Attributes:
        kind: the type.
        step: the unit of `Stored.STEPS`; 1 for the other types.
    """

    kind: Stored
    step: float = 1.0

    def stored(self, array: Array) -> NDArray[Any]:
        """The numbers as they are stored."""
        if self.kind is Stored.STEPS:
            return np.rint(array / self.step).astype(np.float32)
        return array.astype(self.kind.dtype)

    def exact(self, array: Array) -> bool:
        """Whether the stored numbers, times the step, are those of the array to the bit."""
        if self.kind is Stored.DOUBLE:
            return True
        bound = MOST * self.step if self.kind is Stored.STEPS else float(np.finfo(np.float32).max)
        return all(
            np.abs(some).max(initial=0.0) <= bound
            and np.array_equal(self.stored(some) * np.float64(self.step), some)
            for some in _pieces(array)
        )


def storages(*arrays: Array) -> tuple[Storage, ...]:
    """How arrays are stored in one type: the smallest that holds all of them exactly."""
    steps = tuple(Storage(Stored.STEPS, whole_step(array)) for array in arrays)
    single = (Storage(Stored.SINGLE),) * len(arrays)
    for found in (steps, single):
        if all(one.step and one.exact(array) for one, array in zip(found, arrays, strict=True)):
            return found
    return (Storage(Stored.DOUBLE),) * len(arrays)


def whole_step(array: Array) -> float:
    """The number of which all entries seem to be whole multiples; 0 if there is none.

    It is guessed from some of the entries, by Euclid's algorithm, and then tried on these.
    """
    flat = array.ravel()
    entries = flat[np.linspace(0, flat.size - 1, min(flat.size, 4 * SAMPLE)).astype(np.int64)]
    values = np.unique(np.abs(entries[entries != 0]))[:: max(1, len(entries) // SAMPLE)]
    if not flat.any():
        return 1.0
    if not len(values) or not np.isfinite(values).all():
        return 0.0
    largest = float(values[-1])
    least = largest / MOST
    step = largest
    for value in values.tolist():
        step = _common(step, value, 1e-3 * least)
        if step < (1 - 1e-6) * least:
            return 0.0
    return next((s for s in _near(step, largest) if Storage(Stored.STEPS, s).exact(values)), 0.0)


def _common(a: float, b: float, nothing: float) -> float:
    """The greatest common divisor of two numbers, if what is smaller than `nothing` is rounding."""
    while b > nothing:
        a, b = b, abs(a - b * round(a / b))
    return a


def _near(step: float, largest: float) -> Iterator[float]:
    """Numbers that differ from a step by rounding: those with few digits first."""
    sharp = largest / round(largest / step)
    for digits in DIGITS:
        yield float(f"{sharp:.{digits}g}")
    yield from (sharp, float(np.nextafter(sharp, 0)), float(np.nextafter(sharp, np.inf)))


def _pieces(array: Array) -> Iterator[Array]:
    flat = array.ravel()
    return (flat[first : first + TOGETHER] for first in range(0, flat.size, TOGETHER))
