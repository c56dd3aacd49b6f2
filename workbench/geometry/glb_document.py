"""The JSON and the buffers of a glTF 2.0 file, and the numbers that its accessors name.

A file of a few bytes can claim billions of numbers that no bytes stand for, so numbers are views of
the file's own bytes. (Khronos Group, glTF 2.0 Specification.)
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from workbench.arrays import Array
from workbench.errors import shown

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
MOST_ZEROS = 25_000_000  # numbers of an accessor that has no bytes


@dataclass(frozen=True)
class GlbDocument:
    """The JSON of a file, and the bytes of its buffers."""

    json: dict[str, Any]
    buffers: list[bytes]

    def entry(self, key: str, index: Any) -> dict[str, Any]:
        """`key[index]`, an object. Raises ValueError if there is none."""
        several = self.json.get(key)
        there = isinstance(several, list) and type(index) is int and 0 <= index < len(several)
        if not there or not isinstance(several, list) or not isinstance(several[index], dict):
            raise ValueError(f"there is no {key}[{shown(index)}]")
        found: dict[str, Any] = several[index]
        return found

    def numbers(self, index: Any, kind: str, columns: int) -> NDArray[Any]:
        """The numbers (count, columns) of an accessor, as a view of the file's bytes."""
        accessor, name = self.entry("accessors", index), f"accessors[{shown(index)}]"
        if "sparse" in accessor or "bufferView" not in accessor:
            raise ValueError(
                f"{name} is sparse, or compressed by an extension such as Draco's, which is not "
                "read; export the mesh without compression"
            )
        dtype = _dtype(accessor, kind, name)
        return self._view(accessor, dtype, whole(accessor, "count"), columns, kind, name)

    def values(self, index: Any, kind: str, columns: int) -> Array:
        """The numbers (count, columns) of an accessor, sparse or not, normalized if it says so.

        Raises ValueError for more numbers without bytes than a motion has.
        """
        accessor, name = self.entry("accessors", index), f"accessors[{shown(index)}]"
        dtype, count = _dtype(accessor, kind, name), whole(accessor, "count")
        if "bufferView" in accessor:
            found = self._view(accessor, dtype, count, columns, kind, name)
        elif count * columns <= MOST_ZEROS:
            found = np.zeros((count, columns), dtype)
        else:
            raise ValueError(f"{name} says it holds {count:,} {kind}, all of them zero")
        if "sparse" in accessor:
            found = self._replaced(accessor["sparse"], found.copy(), kind, name)
        with np.errstate(invalid="ignore"):
            numbers = found.astype(np.float64)
        if accessor.get("normalized") is True and dtype.kind in "iu":
            numbers = np.maximum(numbers / np.iinfo(dtype).max, -1.0)
        return numbers

    def _replaced(self, sparse: Any, found: NDArray[Any], kind: str, name: str) -> NDArray[Any]:
        """The numbers with some rows of their own, as a sparse accessor lists them."""
        if not isinstance(sparse, dict) or not isinstance(sparse.get("indices"), dict):
            raise ValueError(f"{name} is sparse and does not say where")
        if not isinstance(sparse.get("values"), dict):
            raise ValueError(f"{name} is sparse and does not say what")
        many, places = whole(sparse, "count"), sparse["indices"]
        unsigned = _dtype(places | {"type": "SCALAR"}, "SCALAR", name)
        at = self._view(places, unsigned, many, 1, "SCALAR", name).astype(np.int64).ravel()
        if many and not (at.min() >= 0 and at.max() < len(found)):
            raise ValueError(f"{name} is sparse and names rows that it does not have")
        columns = found.shape[1]
        found[at] = self._view(sparse["values"], found.dtype, many, columns, kind, name)
        return found

    def _view(
        self,
        holder: dict[str, Any],
        dtype: np.dtype[Any],
        count: int,
        columns: int,
        kind: str,
        name: str,
    ) -> NDArray[Any]:
        """Numbers (count, columns) where `holder` says that they are."""
        view = self.entry("bufferViews", holder.get("bufferView"))
        buffer, row = self.buffer(view.get("buffer")), dtype.itemsize * columns
        stride = whole(view, "byteStride", row)
        start, length = whole(view, "byteOffset", 0), whole(view, "byteLength")
        offset = whole(holder, "byteOffset", 0)
        end = offset + (count - 1) * stride + row if count else offset
        if stride < row or end > length or start + length > len(buffer):
            raise ValueError(f"{name} says it holds {count:,} {kind}, but its bytes are fewer")
        return np.ndarray((count, columns), dtype, buffer, start + offset, (stride, dtype.itemsize))

    def buffer(self, index: Any) -> bytes:
        """The bytes of a buffer. Raises ValueError if the file has none for it."""
        self.entry("buffers", index)
        if index >= len(self.buffers):
            raise ValueError(f"buffers[{index}] has no bytes in this file")
        number: int = index
        return self.buffers[number]


def _dtype(accessor: dict[str, Any], kind: str, name: str) -> np.dtype[Any]:
    code = accessor.get("componentType")
    if accessor.get("type") != kind or type(code) is not int or code not in COMPONENTS:
        raise ValueError(f"{name} holds {shown(accessor.get('type'))}, but must hold {kind}")
    return np.dtype(COMPONENTS[code])


LOCAL = ("matrix", "translation", "rotation", "scale")


def local_motion(node: dict[str, Any]) -> Array:
    """The motion (4, 4) of a node within its parent: a matrix, or T R S."""
    if "matrix" in node:
        return node_reals(node["matrix"], 16).reshape(4, 4).T
    motion = np.eye(4)
    quaternion = node_reals(node.get("rotation", (0, 0, 0, 1)), 4)
    if not quaternion.any():
        raise ValueError("the rotation of a node is zero, and not a unit quaternion")
    with np.errstate(all="ignore"):
        motion[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
        motion[:3, :3] *= node_reals(node.get("scale", (1, 1, 1)), 3)
    motion[:3, 3] = node_reals(node.get("translation", (0, 0, 0)), 3)
    return motion


def several(holder: dict[str, Any], key: str) -> list[dict[str, Any]]:
    """The objects of a list, which may be missing."""
    found = holder.get(key, [])
    if not isinstance(found, list) or not all(isinstance(one, dict) for one in found):
        raise ValueError(f"its {key} are no list of objects")
    return found


def children(holder: dict[str, Any], key: str) -> list[Any]:
    """The numbers of nodes in `holder[key]`, the last one first; empty if there is no such list."""
    found = holder.get(key, [])
    if not isinstance(found, list):
        raise ValueError(f"its {key} are no list of numbers")
    return found[::-1]  # the last that waits comes first


def whole(holder: dict[str, Any], key: str, otherwise: int | None = None) -> int:
    """A whole number from 0 on. Raises ValueError."""
    found = holder.get(key, otherwise)
    if type(found) is not int or not 0 <= found < 2**53:
        raise ValueError(f"its {key} is {shown(found)}, but must be a whole number from 0")
    return found


def node_reals(given: Any, count: int) -> Array:
    """The numbers (count,) of a node's place. Raises ValueError."""
    try:
        found = np.asarray(given, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        found = np.zeros(0)
    if found.shape != (count,):
        raise ValueError(f"a node's place is {shown(given)}, but must be {count} numbers")
    return found
