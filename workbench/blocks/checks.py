"""Checks of arguments that are of the wrong kind, with errors that say what is expected."""

from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.errors import BadArgument, NotNumbers, WorkbenchError

T = TypeVar("T")
Error = type[WorkbenchError]
KINDS = {"U": "text", "S": "text", "c": "complex numbers", "M": "dates", "m": "time spans"}


def several(what: str, value: object, kind: type[T], error: Error = BadArgument) -> tuple[T, ...]:
    """`value` as a tuple, every element being of this kind. Raises the error."""
    if isinstance(value, kind) and not isinstance(value, Iterable):
        raise error(f"{what} are a tuple of {kind.__name__}; put the one into a tuple: (it,)")
    return _members(what, value, kind, f"a tuple of {kind.__name__}", error)


def texts(what: str, value: object, error: Error = BadArgument) -> tuple[str, ...]:
    """A text or several texts as a tuple of texts. Raises the error for anything else."""
    return (value,) if isinstance(value, str) else _members(what, value, str, "texts", error)


def _members(what: str, value: object, kind: type[T], are: str, error: Error) -> tuple[T, ...]:
    if isinstance(value, str) or not _iterable(value):
        raise error(f"{what} are {are}, not {_kind(value)}")
    members: tuple[Any, ...] = tuple(value)  # type: ignore[arg-type]  # asked above
    for member in members:
        if not isinstance(member, kind):
            raise error(f"{what} are {are}, but among them is {_kind(member)}")
    return members


def mapping(what: str, value: object) -> Mapping[str, Any]:
    """`value` as it is, if it is a dict or the like. Raises BadArgument for anything else."""
    if not isinstance(value, Mapping):
        raise BadArgument(f"{what} are a dict with a name for each, not {_kind(value)}")
    return value


def _iterable(value: object) -> bool:
    """Whether a value can be iterated over; CasADi's matrices have __iter__, but refuse."""
    try:
        iter(value)  # type: ignore[call-overload]  # that is the question
    except TypeError:
        return False
    return True


def _kind(value: object) -> str:
    hint = "; take its .name" if isinstance(getattr(value, "name", None), str) else ""
    return "None" if value is None else f"something of type {type(value).__name__}{hint}"


def numbers(what: str, value: object) -> NDArray[Any]:
    """`value` as an array of whole or real numbers of any precision; errors call it `what`.

    Raises NotNumbers.
    """
    if isinstance(value, (cs.MX, cs.SX)):
        raise NotNumbers(
            what,
            "a symbol; give its numbers, or make it part of a residual (a body's `points` and "
            "`joint_points` take symbols)",
        )
    try:
        array = np.asarray(value)
    except (ValueError, TypeError):
        raise NotNumbers(what, "rows of different lengths") from None
    if array.dtype.kind not in "biuf":
        element = type(array.flat[0] if array.size else value).__name__
        raise NotNumbers(what, KINDS.get(array.dtype.kind, f"something of type {element}"))
    return array


def reals(what: str, value: object) -> Array:
    """`value` as float64, itself if it is that already. Raises NotNumbers."""
    return numbers(what, value).astype(np.float64, copy=False)


def above_zero(what: str, /, **values: float) -> None:
    """Raise BadArgument unless these numbers of `what` are finite and above zero."""
    for name, number in values.items():
        if not 0 < number < np.inf:
            raise BadArgument(f"{name} of {what} must be finite and above 0, not {number!r}")


def from_zero(what: str, /, **values: float) -> None:
    """Raise BadArgument unless these numbers of `what` are finite, and zero or above."""
    above_zero(what, **{name: number for name, number in values.items() if number != 0})
