"""Numbers in any form that NumPy can read: lists, arrays, single numbers."""

from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.errors import NotNumbers

KINDS = {"U": "text", "S": "text", "c": "complex numbers", "M": "dates", "m": "time spans"}


def numbers(what: str, value: object) -> NDArray[Any]:
    """`value` as an array of whole or real numbers of any precision; errors call it `what`.

    Raises NotNumbers.
    """
    if isinstance(value, (cs.MX, cs.SX)):
        raise NotNumbers(what, "a symbol; give its numbers, or make it part of a residual")
    try:
        found = np.asarray(value)
    except (ValueError, TypeError):
        raise NotNumbers(what, "rows of different lengths") from None
    if found.dtype.kind not in "biuf":
        held = type(found.flat[0] if found.size else value).__name__
        raise NotNumbers(what, KINDS.get(found.dtype.kind, f"something of type {held}"))
    return found


def reals(what: str, value: object) -> Array:
    """`value` as float64, itself if it is that already. Raises NotNumbers."""
    return numbers(what, value).astype(np.float64, copy=False)
