"""What the arrays of a file must be, compared with what they say of themselves before any is read.

    EXPECTED = {"template": reals("N", 3), "faces": wholes("F", 3), "joint_names": texts("K")}

Letters stand for sizes that a file chooses; the same letter means the same size in all its arrays.
Functions here raise BadFile with the reason alone, as those of `workbench.reading.npy` do.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array, Index, Mask
from workbench.errors import BadFile, listed
from workbench.reading.archive import Archive
from workbench.reading.npy import Header, widened

Size = int | str
LARGEST = (
    2**53
)  # whole numbers beyond have no exact float64, and nothing that is counted has so many


@dataclass(frozen=True)
class Kind:
    """What the elements of an array are."""

    told: str
    types: frozenset[str]  # as numpy writes them, without the order of bytes: f8
    read: Callable[[NDArray[Any]], NDArray[Any]]  # into the type that is promised; raises BadFile


@dataclass(frozen=True)
class Expected:
    """What one array of a file must be."""

    kind: Kind
    shape: tuple[Size, ...]
    optional: bool = False  # whether a file may do without it


def reals(*shape: Size) -> Expected:
    """Finite numbers of single or double precision, read as float64."""
    return Expected(REALS, shape)


def any_reals(*shape: Size) -> Expected:
    """The same, but they may be NaN or infinite."""
    return Expected(ANY_REALS, shape)


def doubles(*shape: Size) -> Expected:
    """Finite float64, of files that are written by the workbench alone."""
    return Expected(DOUBLES, shape)


def doubles_or_nan(*shape: Size) -> Expected:
    """float64 that may be NaN or infinite."""
    return Expected(DOUBLES_OR_NAN, shape)


def wholes(*shape: Size) -> Expected:
    """Whole numbers of any size and sign, read as int64."""
    return Expected(WHOLES, shape)


def truths(*shape: Size) -> Expected:
    """True or false."""
    return Expected(TRUTHS, shape)


def texts(*shape: Size) -> Expected:
    """Texts, which `str` turns into Python's."""
    return Expected(TEXTS, shape)


def optional(expected: Expected) -> Expected:
    """The same, if it is there."""
    return replace(expected, optional=True)


def read_expected(archive: Archive, expected: Mapping[str, Expected]) -> dict[str, NDArray[Any]]:
    """The expected arrays by name, all headers being compared before any array is read.

    Other arrays are not read. Raises BadFile with what is missing, or which array is not what it
    must be.
    """
    headers = archive.headers
    if objects := [n for n in expected if n in headers and headers[n].dtype.hasobject]:
        raise BadFile(f"{listed(objects)} needs allow_pickle, which runs code of the file's")
    missing = [n for n, wanted in expected.items() if n not in headers and not wanted.optional]
    if missing:
        raise BadFile(f"{listed(missing)} missing; it holds {listed(headers)}")
    sizes: dict[str, tuple[int, str]] = {}
    there = {name: wanted for name, wanted in expected.items() if name in headers}
    for name, wanted in there.items():
        _compare(name, headers[name], wanted, sizes)
    found = {}
    for name, wanted in there.items():
        try:
            found[name] = wanted.kind.read(archive.array(name))
        except BadFile as error:
            said = str(error)
            raise BadFile(said if said.startswith(name) else f"{name} {said}") from error
    return found


def nothing_else(archive: Archive, expected: Iterable[str]) -> None:
    """Raise BadFile if a file that the workbench alone writes holds what it never writes."""
    others = [*(archive.headers.keys() - set(expected)), *archive.others]
    if others:
        raise BadFile(f"it also holds {listed(others)}, which do not belong there")


def check_numbers(name: str, numbers: Index, end: int) -> None:
    """Raise BadFile unless all numbers of things are from 0 to `end` - 1."""
    if numbers.size and not 0 <= numbers.min() <= numbers.max() < end:
        raise BadFile(f"{name} holds {numbers.min()} to {numbers.max()}, not 0 to {end - 1} alone")


def _compare(
    name: str, header: Header, wanted: Expected, sizes: dict[str, tuple[int, str]]
) -> None:
    """Raise BadFile unless a header says what is expected.

    `sizes` are those of letters that were met so far, each with the array that has it.
    """
    kind, shape = f"{header.dtype.kind}{header.dtype.itemsize}", header.shape
    empty = wanted.kind is TEXTS and kind == "f8" and not header.count  # as numpy writes []
    if not empty and kind not in wanted.kind.types and kind[0] not in wanted.kind.types:
        raise BadFile(f"{name} holds {header.dtype}, but must hold {wanted.kind.told}")
    met = [one for one in dict.fromkeys(wanted.shape) if one in sizes]
    fits = len(shape) == len(wanted.shape) and all(
        size == (sizes.setdefault(one, (size, name))[0] if isinstance(one, str) else one)
        for size, one in zip(shape, wanted.shape, strict=True)
    )
    if not fits:
        known = [f"{one} = {sizes[str(one)][0]}, as in {sizes[str(one)][1]}" for one in met]
        raise BadFile(
            f"{name} has shape {shape}, but must be {_told(wanted.shape)}"
            f"{' with ' if known else ''}{' and '.join(known)}"
        )


def _told(shape: tuple[Size, ...]) -> str:
    return f"({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})"


def _finite(array: NDArray[Any]) -> Array:
    finite = np.isfinite(array)
    if not finite.all():
        at = np.unravel_index(int(finite.argmin()), array.shape)
        raise BadFile(f"is {array[at]} at {[int(i) for i in at]}, but must be finite")
    return widened(array)


def _counted(array: NDArray[Any]) -> Index:
    if array.size and not -LARGEST <= int(array.min()) <= int(array.max()) <= LARGEST:
        raise BadFile(f"holds numbers from {array.min()} to {array.max()}, which count nothing")
    return array.astype(np.int64)


def _true(array: NDArray[Any]) -> Mask:
    return array.astype(np.bool_)  # a byte of a file may hold more than 0 and 1


def _written(array: NDArray[Any]) -> NDArray[np.str_]:
    return array if array.size else np.zeros(array.shape, dtype=np.str_)


REALS = Kind("real numbers, float32 or float64", frozenset({"f4", "f8"}), _finite)
ANY_REALS = Kind(REALS.told, REALS.types, widened)
DOUBLES = Kind("float64", frozenset({"f8"}), _finite)
DOUBLES_OR_NAN = Kind("float64", frozenset({"f8"}), widened)
WHOLES = Kind("whole numbers, int or uint", frozenset("iu"), _counted)
TRUTHS = Kind("true or false", frozenset("b"), _true)
TEXTS = Kind("texts", frozenset("U"), _written)
