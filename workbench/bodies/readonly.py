"""Read-only arrays, so that what a body has computed from them stays valid."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, issparse

from workbench.arrays import Array, Index
from workbench.blocks.checks import numbers, reals, texts
from workbench.errors import BadBody, NotNumbers


def readonly(what: str, value: object) -> Array:
    """The array as float64, contiguous and read-only; one that is so already is not copied.

    Raises NotNumbers.
    """
    if isinstance(value, np.ndarray) and value.dtype == np.float64 and _settled(value):
        return value
    return locked(np.array(numbers(what, value), dtype=np.float64, order="C"))


def readonly_index(what: str, value: object) -> Index:
    """The array as int64, contiguous and read-only. Raises NotNumbers unless all are whole."""
    if isinstance(value, np.ndarray) and value.dtype == np.int64 and _settled(value):
        return value
    array = numbers(what, value)
    if array.size and array.dtype.kind not in "iu":
        raise NotNumbers(what, str(array.dtype), "whole numbers")
    return locked(np.array(array, dtype=np.int64, order="C"))


def readonly_matrix(what: str, value: object) -> csr_array:
    """A matrix, dense or sparse, as a csr_array of its own around read-only float64 parts."""
    matrix: Any = value
    if not issparse(value):
        table = reals(what, value)
        if table.ndim != 2:
            raise NotNumbers(what, f"one of shape {table.shape}", "real numbers with two axes")
        matrix = csr_array(table)
    if matrix.dtype.kind not in "biuf":
        raise NotNumbers(what, f"a sparse matrix of {matrix.dtype}")
    as_wanted = isinstance(matrix, csr_array) and matrix.dtype == np.float64
    if not (as_wanted and all(_settled(part) for part in _parts(matrix))):
        matrix = csr_array(matrix, dtype=np.float64, copy=True)
        matrix.sum_duplicates()
    data, indices, indptr = (locked(part) for part in _parts(matrix))
    return csr_array((data, indices, indptr), shape=matrix.shape)


def readonly_extras(extras: Mapping[str, object]) -> dict[str, NDArray[Any]]:
    """Arrays of numbers or texts by key, in the type that they have, read-only.

    Raises NotNumbers.
    """
    arrays = {}
    for key, value in extras.items():
        array = np.asanyarray(value)
        if array.dtype.kind not in "biufUS":
            raise NotNumbers(f"extras[{key!r}]", f"{array.dtype}", "numbers or texts")
        arrays[key] = array if _settled(array) else locked(np.array(array, order="C"))
    return arrays


def readonly_mapping(what: str, value: object) -> Mapping[str, Any]:
    """A read-only copy of a mapping. Raises BadBody for anything else."""
    if not isinstance(value, Mapping):
        kind = type(value).__name__
        raise BadBody(f"{what} must be a dict from names, not something of type {kind}")
    return MappingProxyType(dict(value))


def locked(array: NDArray[Any]) -> NDArray[Any]:
    """The array, made read-only in place, so that it can be handed over without a copy."""
    for part in _memory(array):
        if isinstance(part, np.ndarray):
            part.setflags(write=False)
    return array


def readonly_parts(
    body: Any,
    reals: Iterable[str],
    matrices: Iterable[str],
    indices: Iterable[str],
    mappings: Iterable[str],
) -> dict[str, Any]:
    """A body's own read-only copies of its named arrays, mappings, parents and joint names.

    Arrays that may be left out stay None. Raises BadBody for what is no number, name or mapping.
    """
    who = f"body {body.name!r}"
    optional = {field.name for field in fields(body) if field.default is None}
    try:
        kinds = {readonly: reals, readonly_matrix: matrices, readonly_index: indices}
        parts: dict[str, Any] = {
            name: make(name, getattr(body, name))
            for make, names in kinds.items()
            for name in names
            if getattr(body, name) is not None or name not in optional
        }
        parts["parents"] = tuple(readonly_index("parents", body.parents).ravel().tolist())
        extras = readonly_mapping("extras", body.extras)
        parts["extras"] = MappingProxyType(readonly_extras(extras))
    except NotNumbers as error:
        raise BadBody(f"{who}: {error}") from None
    for name in mappings:
        parts[name] = readonly_mapping(f"{who}: {name}", getattr(body, name))
    return parts | {"joint_names": texts(f"{who}: joint_names", body.joint_names, BadBody)}


def maker_of(body: Any) -> Callable[[], Any]:
    """What makes the body again of its fields, as pickling needs it."""
    parts = {part.name: getattr(body, part.name) for part in fields(body) if part.init}
    plain = {n: dict(v) if isinstance(v, MappingProxyType) else v for n, v in parts.items()}
    kind: Callable[..., Any] = type(body)
    return partial(kind, **plain)


def _settled(array: NDArray[Any]) -> bool:
    """Whether it is a plain array in one piece, whose memory is read-only."""
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
