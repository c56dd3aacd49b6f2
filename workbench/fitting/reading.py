"""Reading numbers in a user's file, or saying what is there instead."""

from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadFile, shown

LARGEST = 1e6  # px: no image is wider or higher


def numbers_in(path: str | Path, what: str, given: Any) -> Array:
    """A list of numbers as an array; `what` names it in the error. Raises BadFile."""
    try:
        numbers = np.asarray(given, dtype=float)
    except (ValueError, TypeError, OverflowError):
        numbers = None
    if numbers is None or not isinstance(given, (list, tuple)):
        raise BadFile(f"{path}: {what} must be numbers, not {shown(given)}")
    return numbers


def size_in(path: str | Path, where: str, given: Any) -> tuple[int, int]:
    """The width and height of an image in px; `where` names it in the error. Raises BadFile."""
    numbers = numbers_in(path, f"{where}: size", given)
    if numbers.shape != (2,) or not ((numbers >= 1) & (numbers <= LARGEST)).all():  # nor NaN
        raise BadFile(
            f"{path}: {where} has the size {shown(given)}; it must be width and height in px"
        )
    return int(numbers[0]), int(numbers[1])
