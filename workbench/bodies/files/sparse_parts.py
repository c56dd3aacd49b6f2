"""Sparse matrices from their parts in a file, which are checked because SciPy trusts them."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array

from workbench.arrays import Index

COMPRESSED: dict[str, Callable[..., Any]] = {"csc": csc_array, "csr": csr_array}


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
