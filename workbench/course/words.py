"""Values in a line of a table: rounded, and cut where they go on for ever."""

from typing import Any

import numpy as np

LONGEST = 300  # characters


def in_words(value: Any) -> str:
    """Numbers to six digits; of anything else its repr, or its type where it has none."""
    if isinstance(value, bool | np.bool_ | str):
        return cut(repr(value) if isinstance(value, str) else str(bool(value)))
    try:
        array = np.asarray(value, dtype=float)
    except Exception:
        return cut(_repr(value))
    if array.ndim == 0:
        return f"{array:.6g}"
    return cut(np.array2string(array, precision=6, suppress_small=True, threshold=40))


def kind(value: Any) -> str:
    """What a value is: `an array of shape (3, 3)`, `a str`."""
    if value is None:
        return "None"
    shape = np.shape(value) if isinstance(value, np.ndarray) else None
    if shape is not None:
        return f"an array of shape {shape}" if shape else "a number"
    if isinstance(value, bool | int | float | np.number):
        return "a number"
    if isinstance(value, list | tuple | dict):
        return f"a {type(value).__name__} of length {len(value)}"
    if hasattr(value, "is_symbolic"):
        return f"a CasADi {type(value).__name__} of shape {value.shape}"
    return f"a {type(value).__name__}"


def cut(text: str) -> str:
    """The beginning of a text that is too long."""
    return text if len(text) <= LONGEST else text[:LONGEST] + " ..."


def _repr(value: Any) -> str:
    try:
        return repr(value)
    except Exception:
        return kind(value)
