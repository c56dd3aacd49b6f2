"""PLY, ascii or binary: positions and polygons in the file's own order, whatever else it holds.

The header says how many there are of everything. It is believed only as far as the file has bytes
for it. (Greg Turk, The PLY Polygon File Format, 1994.)
"""

import warnings
from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array, Index
from workbench.errors import shown
from workbench.geometry.polygons import fans, vertex_numbers

LONGEST_HEADER = 2**16
TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"},
    **{"int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8"},
    **{"float32": "f4", "float64": "f8"},
}
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "="}
STRUCT = {  # the same for the module struct
    **{"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q"},
    **{"f4": "f", "f8": "d"},
}
CORNERS = ("vertex_indices", "vertex_index")
POSITION, NORMAL = ("x", "y", "z"), ("nx", "ny", "nz")


@dataclass(frozen=True)
class _Property:
    name: str
    dtype: np.dtype[Any]
    count: np.dtype[Any] | None  # the type of a list's length


@dataclass(frozen=True)
class _Element:
    name: str
    length: int
    properties: list[_Property] = field(default_factory=list)

    @property
    def smallest(self) -> int:
        """Bytes of a row whose lists are empty."""
        return sum((p.count or p.dtype).itemsize for p in self.properties)

    @property
    def in_text(self) -> "_Element":
        """The element with every number, and the length of every list, as float64."""
        real = np.dtype(np.float64)
        alike = [_Property(p.name, real, p.count and real) for p in self.properties]
        return _Element(self.name, self.length, alike)

    @property
    def corners(self) -> int:
        """Which property lists the corners of a face. Raises ValueError."""
        lists = [k for k, p in enumerate(self.properties) if p.count is not None]
        named = [k for k in lists if self.properties[k].name in CORNERS]
        if not named and len(lists) != 1:
            raise ValueError(f"its faces have no list called {CORNERS[0]}")
        return (named or lists)[0]


def parse_ply(content: bytes) -> tuple[Array, Index]:
    """Vertices (N, 3) and triangles (F, 3); a polygon is a fan around its first corner.

    Raises ValueError with what is wrong.
    """
    return parse_ply_and_normals(content)[:2]


def parse_ply_and_normals(content: bytes) -> tuple[Array, Index, Array | None]:
    """The same, and the normals (N, 3) that the vertices have, of any length; None without them."""
    order, elements, start = _header(content)
    data = _Rows(_in_binary(content[start:]) if order == "=" else memoryview(content)[start:])
    vertices, faces = np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    normals: Array | None = None
    wanted = {"vertex", "face"} & {element.name for element in elements}
    for element in elements:
        if not wanted:
            break  # what follows is not read
        columns = data.taken(element.in_text if order == "=" else element)
        if element.name == "vertex":
            vertices = _vectors(element, columns, POSITION)
            if set(NORMAL) <= {p.name for p in element.properties if p.count is None}:
                normals = _vectors(element, columns, NORMAL)
        elif element.name == "face" and element.length:
            corners, counts = columns[element.corners]
            faces = fans(vertex_numbers(corners), counts)
        wanted.discard(element.name)
    else:
        if len(data.left):
            raise ValueError("it holds more than its header says, or its lines have other columns")
    return vertices, faces, normals


Lists = tuple[NDArray[Any], Index]  # the entries of all lists, and how many each has
Columns = list[Any]  # of an element: numbers (length,), or Lists


def _vectors(element: _Element, columns: Columns, names: tuple[str, ...]) -> Array:
    where = {p.name: k for k, p in enumerate(element.properties) if p.count is None}
    if missing := set(names) - where.keys():
        raise ValueError(f"its vertices have no {', '.join(sorted(missing))}")
    with np.errstate(over="ignore", invalid="ignore"):  # the mesh refuses what is no number then
        return np.column_stack(
            [columns[where[axis]].astype(element.properties[where[axis]].dtype) for axis in names]
        ).astype(np.float64)


@dataclass
class _Rows:
    """The bytes of rows, taken one element after the other."""

    left: memoryview

    def taken(self, element: _Element) -> Columns:
        """The columns of the next element. Raises ValueError."""
        if (found := self._alike(element)) is not None:
            return found
        if all(p.count is None for p in element.properties):
            raise ValueError(
                f"it says that it holds {element.length:,} times {shown(element.name)}, but is "
                "shorter"
            )
        return self._walked(element)

    def _alike(self, element: _Element) -> Columns | None:
        """The columns, if all rows are as long as the first; None if there are no such rows."""
        fields: list[tuple[Any, ...]] = []
        at = 0
        for k, p in enumerate(element.properties):
            if p.count is None:
                fields.append((f"{k}", p.dtype))
                at += p.dtype.itemsize
                continue
            room = len(self.left) - at - p.count.itemsize
            if element.length and room < 0:
                raise ValueError(f"{shown(element.name)} 0 is cut off")
            size = _length(p.count)(self.left, at)[0] if element.length else 0
            if not 0 <= size * p.dtype.itemsize <= max(room, 0):  # nor NaN
                raise ValueError(f"a list of {_shown(size)} numbers is cut off")
            size = int(size)
            fields += [(f"n{k}", p.count), (f"{k}", p.dtype, (size,))]
            at += p.count.itemsize + size * p.dtype.itemsize
        if not fields or not element.length:
            return [np.zeros(0)] * len(element.properties)
        dtype = np.dtype(fields)
        if dtype.itemsize * element.length > len(self.left):
            return None
        rows = np.frombuffer(self.left, dtype, element.length)
        lists = [k for k, p in enumerate(element.properties) if p.count is not None]
        if any((rows[f"n{k}"] != rows[f"{k}"].shape[1]).any() for k in lists):
            return None
        self.left = self.left[dtype.itemsize * element.length :]
        return [
            rows[f"{k}"] if p.count is None else (rows[f"{k}"].ravel(), rows[f"n{k}"].astype("i8"))
            for k, p in enumerate(element.properties)
        ]

    def _walked(self, element: _Element) -> Columns:
        """Row by row, for each may be of a length of its own; a face has at least 3 corners."""
        main = element.corners if element.name == "face" else -1
        plan = [
            (
                p.dtype.itemsize,
                0 if p.count is None else p.count.itemsize,
                None if p.count is None else _length(p.count),
                3 if k == main else 0,
            )
            for k, p in enumerate(element.properties)
        ]
        found = [bytearray() for _ in plan]
        counts = [array("q") for _ in plan]
        at, left, end = 0, self.left, len(self.left)
        for row in range(element.length):
            for (width, head, length, least), bytes_of, sizes in zip(
                plan, found, counts, strict=True
            ):
                if at + (head or width) > end:
                    raise ValueError(f"{shown(element.name)} {row} is cut off")
                size = 1
                if length is not None:
                    said, at = length(left, at)[0], at + head
                    if not least <= said <= (end - at) // width:  # nor NaN
                        raise ValueError(f"a list in row {row} has {_shown(said)} entries")
                    size = int(said)
                    sizes.append(size)
                bytes_of += left[at : at + size * width]
                at += size * width
        self.left = left[at:]
        return [
            numbers if p.count is None else (numbers, np.array(counts[k], dtype=np.int64))
            for k, p in enumerate(element.properties)
            for numbers in [np.frombuffer(found[k], p.dtype)]
        ]


def _shown(count: float) -> str:
    return f"{count:,}" if isinstance(count, int) else f"{count:g}"


def _length(count: np.dtype[Any]) -> Callable[[memoryview, int], tuple[Any, ...]]:
    """Reads the length of a list somewhere in a file: faster than numpy does for single numbers."""
    return Struct(count.str[0].replace("|", "<") + STRUCT[count.str[1:]]).unpack_from


def _in_binary(content: bytes) -> memoryview:
    """A text, which is nothing but numbers, as the bytes of these in float64."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # how numpy says what is no number
        try:
            return np.fromstring(content.decode("latin1"), sep=" ").data.cast("B")
        except (DeprecationWarning, ValueError):
            raise ValueError("it holds what is no number") from None


def _header(content: bytes) -> tuple[str, list[_Element], int]:
    """The order of bytes ("=" of text), the elements, and where the data begin."""
    head, found, _ = content[:LONGEST_HEADER].partition(b"end_header")
    if not content[:3].lower().startswith(b"ply") or not found:
        raise ValueError("it has no header from `ply` to `end_header`")
    end = content.find(b"\n", len(head))
    start = len(content) if end < 0 else end + 1
    order, elements = "", list[_Element]()
    for line in head.decode("latin1").splitlines()[1:]:
        match line.split():
            case ["format", kind, *_] if kind in ORDERS:
                order = ORDERS[kind]
            case ["element", name, count] if count.isdecimal() and len(count) < 16:
                elements.append(_Element(name, int(count)))
            case ["property", "list", size, kind, name] if elements and {size, kind} <= set(TYPES):
                types = np.dtype(order + TYPES[kind]), np.dtype(order + TYPES[size])
                elements[-1].properties.append(_Property(name, *types))
            case ["property", kind, name] if elements and kind in TYPES:
                elements[-1].properties.append(_Property(name, np.dtype(order + TYPES[kind]), None))
            case ["comment" | "obj_info", *_] | []:
                pass
            case _:
                raise ValueError(f"its header says {shown(line)}")
    if not order:
        raise ValueError(f"its format is none of {', '.join(ORDERS)}")
    claimed = sum(e.length * (len(e.properties) if order == "=" else e.smallest) for e in elements)
    if claimed > len(content):
        raise ValueError(
            f"its header claims {shown(max(elements, key=lambda e: e.length).name)} "
            f"{max(e.length for e in elements):,} times, and there are {len(content):,} bytes"
        )
    return order, elements, start
