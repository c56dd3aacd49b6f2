"""The entries of a body's file, each asked for as what it must be."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array

from workbench.arrays import Array, Index
from workbench.errors import BadFile, shown
from workbench.reading.arrays import LARGEST, check_letters, widened

SPARSE_PARTS = ("data", "indices", "indptr", "shape")
LONGEST_NAME = 200  # characters of a joint's, a landmark's or a body's name, which messages show

MOST_BYTES = 2 * 2**30  # of one file, unpacked; licensed models reach a quarter of a GB

Contents = dict[str, Any]  # by key: arrays, csr_arrays, plain values, and what stayed unread
COMPRESSED: dict[str, Callable[..., Any]] = {"csc": csc_array, "csr": csr_array}


@dataclass(frozen=True)
class Unread:
    """An entry of a file that was not read.

    Attributes:
        reason: the end of the sentence "shapedirs is ...".
    """

    reason: str


@dataclass(frozen=True)
class Entries:
    """What the file `where` holds by key; every question raises BadFile if the answer is no."""

    raw: Contents
    where: str

    def __contains__(self, key: str) -> bool:
        return key in self.raw

    def array(self, key: str) -> NDArray[Any]:
        """The entry, if it is an array of numbers."""
        self._has(key)
        value = self.raw[key]
        if isinstance(value, Unread):
            raise BadFile(f"{self.where}: {key} is {value.reason}")
        if not isinstance(value, np.ndarray):
            raise BadFile(
                f"{self.where}: {key} is a {type(value).__name__}, but must be an array of numbers"
            )
        if value.dtype.kind not in "fiu":
            raise BadFile(f"{self.where}: {key} holds {value.dtype}, but must hold numbers")
        return value

    def reals(self, key: str) -> Array:
        """An array of any numbers as float64."""
        return np.ascontiguousarray(widened(self.array(key)))

    def wholes(self, key: str) -> Index:
        """Whole numbers, however they are stored."""
        array = self.array(key)
        if array.dtype.kind == "f":
            array = widened(array)
            if not ((abs(array) <= LARGEST) & (array == np.trunc(array))).all():
                raise BadFile(f"{self.where}: {key} must hold whole numbers, but holds others")
        return array.astype(np.int64)

    def directions(self, key: str, N: int) -> Array:
        """Blend shapes (N, 3, .), also from the flat (3 N, .), (., 3 N) and (N, 3 .)."""
        array = self.array(key)
        if array.ndim == 3 and array.shape[:2] == (N, 3):
            return np.ascontiguousarray(widened(array))
        if array.ndim == 2 and array.shape[0] != 3 * N and array.shape[1] == 3 * N:
            return np.ascontiguousarray(widened(array.T)).reshape(N, 3, -1)
        if array.ndim == 2 and array.shape[0] in (N, 3 * N) and array.size % (3 * N) == 0:
            return widened(array).reshape(N, 3, -1)
        raise BadFile(
            f"{self.where}: {key} has shape {array.shape}; with {N} vertices it must be "
            f"({N}, 3, .), ({3 * N}, .) or (., {3 * N})"
        )

    def matrix(self, key: str) -> csr_array:
        """A matrix, dense or sparse, or its parts under `key/data`, `key/indices`, ..."""
        if f"{key}/data" not in self:
            value = self.raw.get(key)
            if isinstance(value, csr_array):
                with np.errstate(over="ignore"):  # what is infinite then is refused
                    return value.astype(np.float64)
            return csr_array(widened(self._two_axes(key)))
        data, indices, indptr, shape = (
            self.reals(f"{key}/{part}") if part == "data" else self.wholes(f"{key}/{part}")
            for part in SPARSE_PARTS
            if self._has(f"{key}/{part}")
        )
        try:
            rows, columns = shape.tolist()  # of more axes: lists, which int refuses
            matrix = from_pointers("csr", data, indices, indptr, (int(rows), int(columns)))
        except (ValueError, IndexError, TypeError, OverflowError) as error:
            raise BadFile(f"{self.where}: {key} is no sparse matrix ({error})") from error
        return matrix

    def texts(self, key: str) -> tuple[str, ...]:
        """The entry, if it is a list of names."""
        array = self.raw.get(key)
        if not (isinstance(array, np.ndarray) and array.ndim == 1 and array.dtype.kind == "U"):
            raise BadFile(f"{self.where}: {key} must be a list of names")
        names = tuple(str(text) for text in self._written(key, array))
        for name in names:
            self._check_length(key, name)
        return names

    def name(self, key: str, otherwise: str) -> str:
        """A single text that is short enough to be shown in messages."""
        name = self.text(key, otherwise)
        self._check_length(key, name)
        return name

    def text(self, key: str, otherwise: str) -> str:
        """A single text, stored as text, as bytes or as an array of either."""
        value = self.raw.get(key)
        if isinstance(value, np.ndarray) and value.size == 1:
            value = self._written(key, value).item()
        if isinstance(value, bytes):
            value = value.decode("latin1")
        return value if isinstance(value, str) else otherwise

    def _check_length(self, key: str, name: str) -> None:
        if len(name) > LONGEST_NAME:
            raise BadFile(
                f"{self.where}: {key} holds a name of {len(name):,} characters, {shown(name)}; "
                f"names have at most {LONGEST_NAME}"
            )

    def _written(self, key: str, array: NDArray[Any]) -> NDArray[Any]:
        """The array; raises BadFile if its letters are not text that can be written."""
        try:
            if array.dtype.kind == "U":
                check_letters(array)
        except BadFile as error:
            raise BadFile(f"{self.where}: {key} {error}") from error
        return array

    def _two_axes(self, key: str) -> NDArray[Any]:
        array = self.array(key)
        if array.ndim != 2:
            raise BadFile(f"{self.where}: {key} has shape {array.shape}, but must be (K, N)")
        return array

    def _has(self, key: str) -> bool:
        if key not in self:
            raise BadFile(f"{self.where} has no {key}")
        return True


def from_pointers(
    kind: str,
    data: NDArray[Any],
    indices: NDArray[Any],
    indptr: NDArray[Any],
    shape: tuple[int, int],
) -> csr_array:
    """A matrix stored by columns ("csc") or rows ("csr"). Raises ValueError for bad parts.

    scipy checks some of this, but only where the matrix has entries, and reads beyond the end of
    `indices` if the pointers of one that has none point somewhere in between.
    """
    lines, width = shape if kind == "csr" else shape[::-1]
    numbers, places, pointers = _own(data), _wholes(indices), _wholes(indptr)
    if pointers.shape != (lines + 1,) or numbers.shape != places.shape or places.ndim != 1:
        raise ValueError(
            f"its parts of {data.shape}, {indices.shape} and {indptr.shape} do not fit {shape}"
        )
    if pointers[0] != 0 or pointers[-1] > len(places) or (np.diff(pointers) < 0).any():
        raise ValueError("its pointers do not rise from 0 to the number of its entries")
    _check(places, width)
    return csr_array(COMPRESSED[kind]((numbers, places, pointers), shape=shape))


def from_places(
    data: NDArray[Any], row: NDArray[Any], column: NDArray[Any], shape: tuple[int, int]
) -> csr_array:
    """A matrix stored as entries with their rows and columns. Raises ValueError for bad parts."""
    numbers, rows, columns = _own(data), _wholes(row), _wholes(column)
    if not numbers.shape == rows.shape == columns.shape or numbers.ndim != 1:
        raise ValueError(f"its parts of {data.shape}, {row.shape} and {column.shape} do not fit")
    _check(rows, shape[0])
    _check(columns, shape[1])
    return csr_array(coo_array((numbers, (rows, columns)), shape=shape))


def _check(places: Index, end: int) -> None:
    if len(places) and not 0 <= places.min() <= places.max() < end:
        raise ValueError(
            f"its indices go from {places.min()} to {places.max()}, not 0 to {end - 1}"
        )


def _wholes(array: NDArray[Any]) -> Index:
    if array.dtype.kind not in "iu":
        raise ValueError("its indices are no whole numbers")
    return array.astype(np.int64)


def _own(array: NDArray[Any]) -> NDArray[Any]:
    """The array in the order of bytes of this machine."""
    return array.astype(array.dtype.newbyteorder("="), copy=False)
