"""What the arrays of a file must be, compared with their headers before any array is read.

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
LARGEST = 2**53  # beyond, whole numbers have no exact float64, and nothing is counted that far


@dataclass(frozen=True)
class Kind:
    """What the elements of an array must be. A kind is called with a shape: `reals("N", 3)`.

    Attributes:
        elements: what the elements are, for error messages.
        types: the types that a file may have, as numpy writes them without the order of bytes,
            such as `f8`.
        read: converts an array of the file to the type that is promised; raises BadFile.
    """

    elements: str
    types: frozenset[str]
    read: Callable[[NDArray[Any]], NDArray[Any]]

    def __call__(self, *shape: Size) -> "Expected":
        """The expectation that an array of a file has such elements, and this shape."""
        return Expected(self, shape)


@dataclass(frozen=True)
class Expected:
    """The kind and the shape that an array of a file must have.

    Attributes:
        kind: what its elements are.
        shape: its shape, with a letter for each size that the file chooses.
        optional: whether a file may lack it.
    """

    kind: Kind
    shape: tuple[Size, ...]
    optional: bool = False


def optional(expected: Expected) -> Expected:
    """The array may be missing; if it is there, it must be what is expected."""
    return replace(expected, optional=True)


def read_expected(archive: Archive, expected: Mapping[str, Expected]) -> dict[str, NDArray[Any]]:
    """The expected arrays by name, all headers being compared before any array is read.

    Other arrays are not read. Raises BadFile, which names what is missing or the array that has
    another kind or shape.
    """
    headers = archive.headers
    if objects := [n for n in expected if n in headers and headers[n].dtype.hasobject]:
        raise BadFile(f"{listed(objects)} needs allow_pickle, which would run code of the file")
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
            reason = str(error)
            raise BadFile(reason if reason.startswith(name) else f"{name} {reason}") from error
    return found


def nothing_else(archive: Archive, expected: Iterable[str]) -> None:
    """Raise BadFile if a file of the workbench's own holds an array that it never writes."""
    others = [*(archive.headers.keys() - set(expected)), *archive.others]
    if others:
        raise BadFile(f"it also holds {listed(others)}, which do not belong there")


def check_numbers(name: str, numbers: Index, end: int) -> None:
    """Raise BadFile unless all numbers lie between 0 and `end` - 1."""
    if numbers.size and not 0 <= numbers.min() <= numbers.max() < end:
        raise BadFile(f"{name} holds {numbers.min()} to {numbers.max()}, not 0 to {end - 1} alone")


def _compare(
    name: str, header: Header, wanted: Expected, sizes: dict[str, tuple[int, str]]
) -> None:
    """Raise BadFile unless a header says what is expected.

    `sizes` are those of the letters so far, each with the first array that has it.
    """
    kind, shape = f"{header.dtype.kind}{header.dtype.itemsize}", header.shape
    empty = wanted.kind is texts and kind == "f8" and not header.count  # as numpy writes []
    if not empty and kind not in wanted.kind.types and kind[0] not in wanted.kind.types:
        raise BadFile(f"{name} holds {header.dtype}, but must hold {wanted.kind.elements}")
    known = [
        f"{one} = {sizes[one][0]}, as in {sizes[one][1]}"
        for one in dict.fromkeys(wanted.shape)
        if isinstance(one, str) and one in sizes
    ]
    fits = len(shape) == len(wanted.shape) and all(
        size == (sizes.setdefault(one, (size, name))[0] if isinstance(one, str) else one)
        for size, one in zip(shape, wanted.shape, strict=True)
    )
    if not fits:
        raise BadFile(
            f"{name} has shape {shape}, but must be {_written_shape(wanted.shape)}"
            f"{' with ' if known else ''}{' and '.join(known)}"
        )


def _written_shape(shape: tuple[Size, ...]) -> str:
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


# Numbers may be NaN or infinite only where the name says so. Files that the workbench alone writes
# hold float64. Whole numbers have any size and sign and are read as int64.
reals = Kind("real numbers, float32 or float64", frozenset({"f4", "f8"}), _finite)
any_reals = Kind(reals.elements, reals.types, widened)
doubles = Kind("float64", frozenset({"f8"}), _finite)
doubles_or_nan = Kind("float64", frozenset({"f8"}), widened)
wholes = Kind("whole numbers, int or uint", frozenset("iu"), _counted)
truths = Kind("true or false", frozenset("b"), _true)
texts = Kind("texts", frozenset("U"), _written)
