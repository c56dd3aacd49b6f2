"""What a pickle's records mean: numpy arrays, scipy matrices, and three of chumpy's values."""

import re
from collections.abc import Callable
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array

from workbench.bodies.pickle_records import NUMPY, SPARSE, Made, Name
from workbench.bodies.pickles import DAMAGE, read_pickle
from workbench.bodies.raw import Raw, Unread
from workbench.errors import BadFile, UnsafePickle

MOST_ROWS = 10**7  # of a sparse matrix, whose shape takes no bytes in the file
DEEPEST = 16  # chumpy values inside chumpy values; files have two
PLAIN = re.compile(r"[biuf]\d{1,2}|[SU]\d{1,4}")  # types of numbers and of short texts


def read_pickled_arrays(path: Path) -> Raw:
    """The entries of a pickled dictionary: arrays, csr_arrays, plain values, and the `Unread`.

    Raises BadFile (UnsafePickle) if it is no such file.
    """
    content = read_pickle(path)
    if not isinstance(content, dict):
        raise BadFile(f"{path} holds no dictionary of arrays, but a {_kind(content)}")
    return {
        key.decode("latin1") if isinstance(key, bytes) else str(key): _read(path, value)
        for key, value in content.items()
    }


def _read(path: Path, value: Any) -> Any:
    try:
        return meaning(value)
    except UnsafePickle as error:
        raise UnsafePickle(f"{path}: {error}") from None
    except DAMAGE as error:
        return Unread(f"a {_kind(value)} that cannot be read ({error})")


def meaning(value: Any, depth: int = 0) -> Any:
    """The array that a record stands for; other values as they are.

    Raises ValueError and its kin for a record that stands for no array.
    """
    if not isinstance(value, Made):
        return value
    if depth > DEEPEST:
        raise ValueError(f"it is nested more than {DEEPEST} deep")
    where = value.name.module, value.name.name
    if value.name.module.split(".")[0] == "chumpy":
        if value.name.name not in CHUMPY:
            raise ValueError("chumpy would have to compute it; store its value instead")
        return CHUMPY[value.name.name](_state(value), depth + 1)
    if where in SPARSE:
        return _sparse(value.name.name[:3], _state(value), depth + 1)
    if where not in MEANINGS:
        raise ValueError("it stands for no array")
    return MEANINGS[where](value)


def _kind(value: Any) -> str:
    return str(value.name) if isinstance(value, Made) else type(value).__name__


def _state(made: Made) -> dict[str, Any]:
    """The attributes that an object was pickled with; of several, the first are its own."""
    state = made.state[0] if isinstance(made.state, tuple) else made.state
    if not isinstance(state, dict):
        raise ValueError("its attributes are missing")
    return state


def _numbers(value: Any, depth: int) -> NDArray[Any]:
    """An array that another value is made of; lists within lists could be endless."""
    array = meaning(value, depth)
    if not isinstance(array, np.ndarray):
        raise ValueError(f"it is made of a {_kind(array)}, not of an array")
    return array


def _array(made: Made) -> NDArray[Any]:
    """An ndarray from its type, shape and bytes; the file's shape allocates nothing."""
    if made.arguments[:1] != (Name("numpy", "ndarray"),):
        raise UnsafePickle(f"it makes an array of a kind that is not read: {made.arguments[:1]}")
    *_, shape, dtype, fortran, content = made.state
    return _shaped(content, dtype, shape, "F" if fortran else "C")


def _from_buffer(made: Made) -> NDArray[Any]:
    content, dtype, shape, order = made.arguments
    return _shaped(content, dtype, shape, order)


def _scalar(made: Made) -> Any:
    dtype, content = made.arguments
    return _shaped(content, dtype, (), "C")[()]


def _shaped(content: Any, dtype: Any, shape: Any, order: Any) -> NDArray[Any]:
    kind, raw = _dtype(dtype), _bytes(content)
    if not (isinstance(shape, tuple) and all(type(n) is int and n >= 0 for n in shape)):
        raise ValueError("its shape is no tuple of sizes")
    if prod(shape) * kind.itemsize != len(raw):
        raise ValueError(f"{shape} numbers of {kind.itemsize} bytes, but {len(raw)} bytes")
    return np.frombuffer(raw, kind).reshape(shape, order="F" if order == "F" else "C")


def _dtype(made: Any) -> np.dtype[Any]:
    if not (isinstance(made, Made) and made.name == Name("numpy", "dtype")):
        raise ValueError("its type is no numpy.dtype")
    code = made.arguments[0]
    if not (isinstance(code, str) and PLAIN.fullmatch(code)):
        raise ValueError(f"an array of type {code!r}, not of numbers")
    order = made.state[1] if made.state else "="
    if order not in ("<", ">", "=", "|"):
        raise ValueError(f"byte order {order!r}")
    return np.dtype(code if order == "|" else order + code)


def _bytes(content: Any) -> bytes:
    """Bytes, however the protocols of Python 2 and 3 spell them."""
    if isinstance(content, Made) and content.name.name in ("encode", "bytearray"):
        content = content.arguments[0]
    if isinstance(content, str):
        return content.encode("latin1")
    if not isinstance(content, (bytes, bytearray)):
        raise ValueError("an array of Python objects, not of numbers")
    return bytes(content)


def _sparse(kind: str, state: dict[str, Any], depth: int) -> csr_array:
    """A csc, csr or coo matrix, its indices checked: scipy's own code trusts them."""
    if "coords" in state:  # what SciPy since 1.13 has for row and col
        state = state | dict(zip(("row", "col"), state["coords"], strict=True))
    names = ("data", "row", "col") if kind == "coo" else ("data", "indices", "indptr")
    parts = {name: _numbers(state[name], depth) for name in names}
    rows, columns = (int(n) for n in state["_shape"])
    if not 0 <= rows <= MOST_ROWS or not 0 <= columns <= MOST_ROWS:
        raise ValueError(f"a matrix of {rows} x {columns}")
    if any(parts[key].dtype.kind not in "iu" for key in parts if key != "data"):
        raise ValueError("its indices are no whole numbers")
    if kind == "coo":
        where = parts["row"], parts["col"]
        return csr_array(coo_array((parts["data"], where), shape=(rows, columns)))
    matrix = {"csc": csc_array, "csr": csr_array}[kind](
        (parts["data"], parts["indices"], parts["indptr"]), shape=(rows, columns)
    )
    matrix.check_format(full_check=True)
    return csr_array(matrix)


def _select(state: dict[str, Any], depth: int) -> NDArray[Any]:
    """chumpy's Select: some entries of `a`, counted row by row, in a shape of their own."""
    chosen = _numbers(state["a"], depth).ravel()[_numbers(state["idxs"], depth)]
    shape = meaning(state.get("preferred_shape"), depth)
    selected: NDArray[Any] = chosen
    return selected if shape is None else selected.reshape(tuple(int(n) for n in shape))


def _transpose(state: dict[str, Any], depth: int) -> NDArray[Any]:
    axes = meaning(state.get("axes"), depth)
    order = None if axes is None else tuple(int(n) for n in axes)
    return np.transpose(_numbers(state["a"], depth), order)


CHUMPY: dict[str, Callable[[dict[str, Any], int], Any]] = {
    "Ch": lambda state, depth: meaning(state["x"], depth),
    "Select": _select,
    "transpose": _transpose,
}
MEANINGS: dict[tuple[str, str], Callable[[Made], Any]] = {
    **{(f"{numpy}.multiarray", "_reconstruct"): _array for numpy in NUMPY},
    **{(f"{numpy}.multiarray", "scalar"): _scalar for numpy in NUMPY},
    **{(f"{numpy}.numeric", "_frombuffer"): _from_buffer for numpy in NUMPY},
}
