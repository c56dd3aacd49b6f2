"""Numbers in a user's file, or a sentence about what is there instead."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.errors import BadFile

Array = NDArray[np.float64]


def json_in(path: str | Path) -> Any:
    """All that a JSON file says. Raises BadFile."""
    try:
        return json.loads(Path(path).read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        raise BadFile(f"{path} cannot be read as JSON: {error}") from error


def numbers_in(path: str | Path, what: str, given: Any) -> Array:
    """An array; `what` in the file it is, for the error. Raises BadFile."""
    try:
        numbers = np.asarray(given, dtype=float)
    except (ValueError, TypeError, OverflowError):
        numbers = None
    if numbers is None or not isinstance(given, (list, tuple)):
        raise BadFile(f"{path}: {what} must be numbers, not {given!r:.60}")
    return numbers


def size_in(path: str | Path, where: str, given: Any) -> tuple[int, int]:
    """Width and height in px. Raises BadFile."""
    numbers = numbers_in(path, f"{where}: size", given)
    if numbers.shape != (2,) or not (np.isfinite(numbers) & (numbers >= 1)).all():
        raise BadFile(
            f"{path}: {where} has the size {given!r:.60}; it must be width and height in px"
        )
    return int(numbers[0]), int(numbers[1])
