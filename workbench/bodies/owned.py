"""Arrays that nobody can write to, so that what a body derives from them stays true."""

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, issparse

from workbench.blocks.reals import numbers, reals
from workbench.errors import BadBody, NotNumbers

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def owned(what: str, given: object) -> Array:
    """float64, in one piece and read-only: the array itself if it is all that, else a copy.

    Raises NotNumbers.
    """
    if isinstance(given, np.ndarray) and given.dtype == np.float64 and _settled(given):
        return given
    return given_up(np.array(numbers(what, given), dtype=np.float64, order="C"))


def owned_index(what: str, given: object) -> Index:
    """The same in int64."""
    if isinstance(given, np.ndarray) and given.dtype == np.int64 and _settled(given):
        return given
    found = numbers(what, given)
    if found.size and found.dtype.kind not in "iu":
        raise NotNumbers(what, str(found.dtype), "whole numbers")
    return given_up(np.array(found, dtype=np.int64, order="C"))


def owned_matrix(what: str, given: object) -> csr_array:
    """A matrix, dense or sparse, as a csr_array of its own around read-only float64 parts."""
    matrix: Any = given if issparse(given) else csr_array(_table(what, given))
    if matrix.dtype.kind not in "biuf":
        raise NotNumbers(what, f"a sparse matrix of {matrix.dtype}")
    kept = isinstance(matrix, csr_array) and matrix.dtype == np.float64
    if not (kept and all(_settled(part) for part in _parts(matrix))):
        matrix = csr_array(matrix, dtype=np.float64, copy=True)
        matrix.sum_duplicates()
    data, indices, indptr = (given_up(part) for part in _parts(matrix))
    return csr_array((data, indices, indptr), shape=matrix.shape)


def owned_extras(given: Mapping[str, object]) -> dict[str, NDArray[Any]]:
    """Arrays of numbers or texts by key, in the type that they have, read-only.

    Raises NotNumbers.
    """
    found = {}
    for key, value in given.items():
        array = np.asanyarray(value)
        if array.dtype.kind not in "biufUS":
            raise NotNumbers(f"extras[{key!r}]", f"{array.dtype}", "numbers or texts")
        found[key] = array if _settled(array) else given_up(np.array(array, order="C"))
    return found


def owned_mapping(what: str, given: object) -> Mapping[str, Any]:
    """A mapping of its own that nobody can write to. Raises BadBody for what is no mapping."""
    if not isinstance(given, Mapping):
        kind = type(given).__name__
        raise BadBody(f"{what} must be a dict from names, not something of type {kind}")
    return MappingProxyType(dict(given))


def given_up(array: NDArray[Any]) -> NDArray[Any]:
    """The array, locked in place: for whoever made it and hands it over without a copy."""
    for part in _memory(array):
        if isinstance(part, np.ndarray):
            part.setflags(write=False)
    return array


def _table(what: str, given: object) -> Array:
    found = reals(what, given)
    if found.ndim != 2:
        raise NotNumbers(what, f"one of shape {found.shape}", "real numbers with two axes")
    return found


def _settled(array: NDArray[Any]) -> bool:
    """Whether it is a plain array in one piece whose memory nobody can write to."""
    plain = type(array) is np.ndarray and array.flags.c_contiguous
    return plain and all(
        isinstance(part, bytes) or (type(part) is np.ndarray and not part.flags.writeable)
        for part in _memory(array)
    )


def _memory(array: NDArray[Any]) -> Iterator[object]:
    """The array, what it is a view of, and so on down to who owns the memory."""
    part: object = array
    while part is not None:
        yield part
        part = part.base if isinstance(part, np.ndarray) else None


def _parts(matrix: csr_array) -> tuple[NDArray[Any], ...]:
    return matrix.data, matrix.indices, matrix.indptr
