"""The arrays that a pickle's records stand for: NumPy's, SciPy's, and three of chumpy's values.

A record may be part of many others, and of one of them many times. What a record means is
therefore found once. Every array is paid for from the `Allowance` of its file before it is made.
"""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.bodies.files.entries import Contents, Unread, from_places, from_pointers
from workbench.bodies.files.pickle_records import NUMPY, SPARSE, Made, Name
from workbench.bodies.files.pickles import DAMAGE, read_pickle
from workbench.errors import BadFile, UnsafePickle, cut, shown
from workbench.reading.arrays import check_letters

MOST_ROWS = 10**7  # of a sparse matrix, whose shape takes no bytes in the file
DEEPEST = 16  # chumpy values inside chumpy values; files have two
PLAIN = re.compile(r"[biuf]\d{1,2}|[SU]\d{1,4}")  # types of numbers and of short texts
NUMERIC = "biuf"  # kinds of what chumpy and scipy compute with
MOST_RECORDS = 2000  # arrays, matrices and chumpy's values that are looked into; files have sixty
MOST_ENTRIES = 10_000  # of the dictionary that the file is; files have thirty
SPARE_BYTES = 2**26  # that the arrays of any file may take, however small it is
# Further bytes for each byte of the file. A number of one byte becomes a float64 of eight, so that
# arrays which share no bytes are never refused.
PER_BYTE = 8
NUMBER = 8  # bytes of a float64, which all numbers of a body become


class Allowance:
    """What may still be spent on a file of `size` bytes. Raises BadFile when it is spent."""

    def __init__(self, size: int) -> None:
        self.size, self.records = size, MOST_RECORDS
        self.bytes = SPARE_BYTES + PER_BYTE * size

    def pay_record(self) -> None:
        """For looking into one record."""
        self.records -= 1
        if self.records < 0:
            raise BadFile(
                f"it is made of more than {MOST_RECORDS:,} arrays and chumpy values, and a body of "
                "a few dozen; export it again with nothing but the arrays of the body"
            )

    def pay(self, sizes: Iterable[int], itemsize: int = NUMBER) -> None:
        """For an array of these sizes; a size of 0 counts as 1, for nothing else bounds the rest.

        Numbers count as float64, texts as what they take.
        """
        self.bytes -= prod(max(n, 1) for n in sizes) * max(itemsize, NUMBER)
        if self.bytes < 0:
            raise BadFile(
                f"its arrays would take more than {PER_BYTE} times its own {self.size:,} bytes and "
                f"{SPARE_BYTES // 2**20} MB, because they name the same bytes again and again or "
                "are much larger than what they hold; export it again with arrays of their own"
            )


def read_pickled_arrays(path: Path) -> Contents:
    """The entries of a pickled dictionary: arrays, csr_arrays, plain values, and the `Unread`.

    Raises BadFile (UnsafePickle) if it is no such file, or asks for more memory or work than a
    body of its size has a use for.
    """
    content = read_pickle(path)
    if not isinstance(content, dict):
        raise BadFile(f"{path} holds no dictionary of arrays, but a {_kind(content)}")
    if len(content) > MOST_ENTRIES:
        raise BadFile(f"{path} holds {len(content):,} entries; a body has a few dozen")
    reading = _Reading(Allowance(path.stat().st_size))
    return {key: _read(path, reading, value) for key, value in content.items()}


@dataclass
class _Reading:
    """One file: what may still be spent on it, and what its records were found to mean."""

    allowance: Allowance
    found: dict[int, Any] = field(default_factory=dict)  # by the identity of a record

    def meaning(self, value: Any, depth: int = 0) -> Any:
        """The array that a record stands for; other values as they are.

        Raises ValueError and its kin for a record that stands for no array, BadFile for one that
        takes more than the allowance.
        """
        if not isinstance(value, Made):
            return value
        if id(value) not in self.found:  # the file's content holds it, so that no other gets its id
            self.allowance.pay_record()
            self.found[id(value)] = _meaning(self, value, depth)
        return self.found[id(value)]

    def numbers(self, value: Any, depth: int) -> NDArray[Any]:
        """An array of numbers that another value is made of; lists could be endless."""
        array = self.meaning(value, depth)
        if not isinstance(array, np.ndarray):
            raise ValueError(f"it is made of a {_kind(array)}, not of an array")
        if array.dtype.kind not in NUMERIC:
            raise ValueError(f"it is made of {array.dtype}, not of numbers")
        return array


def _read(path: Path, reading: _Reading, value: Any) -> Any:
    try:
        if isinstance(value, str):
            reading.allowance.pay((len(value),))
            value.encode()  # raises UnicodeEncodeError for half a pair of surrogates
        elif isinstance(value, bytes | bytearray):
            reading.allowance.pay((len(value),), 1)
        return reading.meaning(value)
    except BadFile as error:
        raise type(error)(f"{path}: {error}") from None
    except DAMAGE as error:
        return Unread(f"a {_kind(value)} that cannot be read ({cut(error)})")


def _meaning(reading: _Reading, made: Made, depth: int) -> Any:
    if depth > DEEPEST:
        raise ValueError(f"it is nested more than {DEEPEST} deep")
    where = made.name.module, made.name.name
    if made.name.module.split(".")[0] == "chumpy":
        if made.name.name not in CHUMPY:
            raise ValueError("chumpy would have to compute it; store its value instead")
        return CHUMPY[made.name.name](reading, _state(made), depth + 1)
    if where in SPARSE:
        return _sparse(reading, made.name.name[:3], _state(made), depth + 1)
    if where not in MEANINGS:
        raise ValueError("it stands for no array")
    return MEANINGS[where](reading, made)


def _kind(value: Any) -> str:
    return str(value.name) if isinstance(value, Made) else type(value).__name__


def _state(made: Made) -> dict[str, Any]:
    """The attributes that an object was pickled with; of several, the first are its own."""
    state = made.state[0] if isinstance(made.state, tuple) else made.state
    if not isinstance(state, dict):
        raise ValueError("its attributes are missing")
    return state


def _array(reading: _Reading, made: Made) -> NDArray[Any]:
    """An ndarray from its type, shape and bytes; the file's shape allocates nothing."""
    if made.arguments[:1] != (Name("numpy", "ndarray"),):
        kind = _kind_named(made.arguments[:1])
        raise UnsafePickle(f"it makes an array of a kind that is not read: {kind}")
    if not (isinstance(made.state, tuple) and 4 <= len(made.state) <= 5):
        raise ValueError("its type, shape and bytes are missing")
    shape, dtype, fortran, content = made.state[-4:]
    return _shaped(reading, content, dtype, shape, "F" if fortran else "C")


def _kind_named(arguments: tuple[Any, ...]) -> str:
    return str(arguments[0]) if arguments and isinstance(arguments[0], Name) else shown(arguments)


def _from_buffer(reading: _Reading, made: Made) -> NDArray[Any]:
    content, dtype, shape, order = made.arguments
    return _shaped(reading, content, dtype, shape, order)


def _scalar(reading: _Reading, made: Made) -> Any:
    dtype, content = made.arguments
    return _shaped(reading, content, dtype, (), "C")[()]


def _shaped(reading: _Reading, content: Any, dtype: Any, shape: Any, order: Any) -> NDArray[Any]:
    kind, held = _dtype(dtype), _held(content)
    sizes = sizes_in(shape, "shape")
    if min(sizes, default=0) < 0:
        raise ValueError("its shape is no tuple of sizes")
    if prod(sizes) * kind.itemsize != len(held):
        raise ValueError(
            f"{shown(sizes)} numbers of {kind.itemsize} bytes, but {len(held):,} bytes"
        )
    reading.allowance.pay(sizes, kind.itemsize)
    flat = np.frombuffer(held.encode("latin1") if isinstance(held, str) else bytes(held), kind)
    if kind.kind == "U":
        try:
            check_letters(flat)
        except BadFile as error:  # a text that Python cannot show: this entry is left out
            raise ValueError(str(error)) from error
    return flat.reshape(sizes, order="F" if order == "F" else "C")


def _dtype(made: Any) -> np.dtype[Any]:
    if not (isinstance(made, Made) and made.name == Name("numpy", "dtype")):
        raise ValueError("its type is no numpy.dtype")
    code = made.arguments[0]
    if not (isinstance(code, str) and PLAIN.fullmatch(code)):
        raise ValueError(f"an array of type {shown(code)}, not of numbers")
    order = made.state[1] if made.state else "="
    if order not in ("<", ">", "=", "|"):
        raise ValueError(f"byte order {shown(order)}")
    return np.dtype(code if order == "|" else order + code)


def _held(content: Any) -> bytes | bytearray | str:
    """The bytes of an array, or a text with one byte per character, as Python 2 wrote them."""
    if isinstance(content, Made) and content.name.name in ("encode", "bytearray"):
        if content.arguments[1:] not in ((), ("latin1",), ("latin-1",)):
            raise ValueError("its bytes are encoded in another way than latin-1")
        content = content.arguments[0]
    if not isinstance(content, (bytes, bytearray, str)):
        raise ValueError("an array of Python objects, not of numbers")
    return content


def _sparse(reading: _Reading, kind: str, state: dict[str, Any], depth: int) -> csr_array:
    """A csc, csr or coo matrix."""
    row, column = state.get("row"), state.get("col")
    if "coords" in state:  # what SciPy since 1.13 has for row and col
        row, column = state["coords"]
    given = {"row": row, "col": column} if kind == "coo" else state
    names = ("row", "col") if kind == "coo" else ("indices", "indptr")
    data, *indices = (
        reading.numbers(part, depth) for part in (state["data"], *(given[n] for n in names))
    )
    rows, columns = sizes_in(state["_shape"], "shape", most=2)
    if not 0 <= rows <= MOST_ROWS or not 0 <= columns <= MOST_ROWS:
        raise ValueError(f"a matrix of {rows:,} x {columns:,}")
    reading.allowance.pay((rows + columns + 2 * data.size,))
    if kind == "coo":
        return from_places(data, indices[0], indices[1], (rows, columns))
    return from_pointers(kind, data, indices[0], indices[1], (rows, columns))


def _select(reading: _Reading, state: dict[str, Any], depth: int) -> NDArray[Any]:
    """chumpy's Select: some entries of `a`, counted row by row, in a shape of their own."""
    source = reading.numbers(state["a"], depth)
    which = reading.numbers(state["idxs"], depth)
    shape = reading.meaning(state.get("preferred_shape"), depth)
    reading.allowance.pay((which.size + source.size,))
    chosen: NDArray[Any] = source.ravel()[which]
    if shape is None:
        return chosen
    sizes = sizes_in(shape, "shape")
    reading.allowance.pay(sizes)  # of an empty array, they could be any
    return chosen.reshape(sizes)


def _transpose(reading: _Reading, state: dict[str, Any], depth: int) -> NDArray[Any]:
    axes = reading.meaning(state.get("axes"), depth)
    return np.transpose(
        reading.numbers(state["a"], depth), None if axes is None else sizes_in(axes, "axes")
    )


CHUMPY: dict[str, Callable[[_Reading, dict[str, Any], int], Any]] = {
    "Ch": lambda reading, state, depth: reading.meaning(state["x"], depth),
    "Select": _select,
    "transpose": _transpose,
}
MEANINGS: dict[tuple[str, str], Callable[[_Reading, Made], Any]] = {
    **{(f"{numpy}.multiarray", "_reconstruct"): _array for numpy in NUMPY},
    **{(f"{numpy}.multiarray", "scalar"): _scalar for numpy in NUMPY},
    **{(f"{numpy}.numeric", "_frombuffer"): _from_buffer for numpy in NUMPY},
}


def sizes_in(value: Any, what: str, most: int = 32) -> tuple[int, ...]:
    """A shape, or an order of axes: a few whole numbers of 32 bits. Raises ValueError."""
    if isinstance(value, np.ndarray) and value.size <= most:
        value = value.tolist()
    if not (isinstance(value, (tuple, list)) and len(value) <= most):
        raise ValueError(f"its {what} is no tuple of sizes")
    if not all(type(n) is int and -1 <= n < 2**31 for n in value):
        raise ValueError(f"its {what} is no tuple of sizes from 0 to {2**31 - 1:,}")
    return tuple(value)
