"""Meshes and their files: the same vertices in the same order, out and in.

In metres, y up, as glTF has it; nothing is scaled, turned, merged or re-ordered.
"""

import warnings
from array import array
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from io import BytesIO, TextIOWrapper
from itertools import pairwise
from pathlib import Path
from struct import Struct
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.arrays import Array, Index
from workbench.environment import expanded
from workbench.errors import BadFile, BadMesh, cut, listed, shown
from workbench.geometry.gltf import parse_glb
from workbench.writing import write_file

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Mesh:
    """Vertices (N, 3) in m and triangles (F, 3) of their numbers; a point cloud has none.

    Raises BadMesh if they do not fit together or a number is not finite.
    """

    vertices: Array
    faces: Index

    def __post_init__(self) -> None:
        for name, rows in (("vertices", self.vertices), ("faces", self.faces)):
            if rows.ndim != 2 or rows.shape[1] != 3:
                raise BadMesh(f"{name} have shape {rows.shape}, but must be (., 3)")
        if not np.isfinite(self.vertices).all():
            bad = int(np.argmax(~np.isfinite(self.vertices).all(axis=1)))
            raise BadMesh(f"vertex {bad} is {self.vertices[bad].tolist()}; remove or repair it")
        N, wrong = len(self.vertices), ((self.faces < 0) | (self.faces >= len(self.vertices)))
        if wrong.any():
            face = int(np.argmax(wrong.any(axis=1)))
            raise BadMesh(
                f"face {face} is {self.faces[face].tolist()}, but there are {N} vertices from 0"
            )


def read_mesh(path: str | Path, *, points_alone: bool = False) -> Mesh:
    """The mesh in a .glb, .obj, .off, .ply or .stl file, with the file's vertices in its order.

    An .stl holds three vertices per triangle and shares none; the parts of a .glb scene come
    one after the other, each where the scene puts it. Positions and triangles are all that is
    read: normals, colours, textures, materials, skins, morphs, animations, cameras and lines are
    left in the file. `points_alone` lets a file without faces pass, as a mesh with faces (0, 3).
    Raises BadFile if there is nothing to read.
    """
    path = Path(path)
    parts = parsed_mesh(path, _known(path, READERS))
    try:
        mesh = Mesh(*parts)
    except BadMesh as error:
        raise BadFile(f"cannot use the mesh {path}: {error}") from error
    if not len(mesh.vertices):
        raise BadFile(f"{path} holds no vertices; it is empty, or no {path.suffix} file")
    if not len(mesh.faces) and not points_alone:
        raise BadFile(
            f"{path} holds {len(mesh.vertices)} points and no faces; "
            "read_mesh(path, points_alone=True) takes them as they are"
        )
    return mesh


def parsed_mesh(path: Path, parse: Callable[[bytes], T]) -> T:
    """What a parser makes of the content of a file; what goes wrong is BadFile, a sentence.

    The arrays are as the file has them: positions may be NaN, and faces may name any vertex.
    """
    path = expanded(path)
    if not path.is_file():
        raise BadFile(f"there is no mesh file {path}")
    try:
        return parse(path.read_bytes())
    except OSError as error:
        raise BadFile(f"cannot use the mesh {path}: {error}") from error
    except (ValueError, BadFile, MemoryError) as error:
        raise BadFile(f"{path} is damaged, or no {path.suffix} file: {cut(error)}") from error


def read_registered(path: str | Path, *, points_alone: bool = False) -> Mesh:
    """The mesh in a file, whose vertices are to be taken by their numbers; see `read_mesh`.

    Raises BadFile for an .stl as well: it holds triangles that share no vertices, so the numbers
    of a mesh that was written to one are lost.
    """
    if Path(path).suffix.lower() in SOUPS:
        raise BadFile(
            f"{path}: an .stl holds three vertices of its own for every triangle, so which vertex "
            f"is which is lost; give the mesh as {listed(REGISTERED)}"
        )
    return read_mesh(path, points_alone=points_alone)


def same_faces(one: Index, other: Index) -> bool:
    """Whether two sets of faces (F, 3) are the same, in any order and from any first corner."""
    return _canonical(one) == _canonical(other)


def _canonical(faces: Index) -> bytes:
    """Bytes that do not depend on the order of faces, nor on the first corner of each."""
    first = faces.argmin(axis=1)
    turned = np.stack(
        [np.take_along_axis(faces, ((first + i) % 3)[:, None], 1)[:, 0] for i in range(3)], 1
    )
    return turned[np.lexsort(turned.T)].astype(np.int64).tobytes()


def write_mesh(path: str | Path, vertices: ArrayLike, faces: ArrayLike) -> None:
    """Write vertices (N, 3) in m and faces (F, 3), from 0, as the suffix of `path` says.

    .obj, .off and .ply keep every digit (float64), .glb and .stl are of single precision by
    their definition. Whole or not at all. Points without faces go into .obj, .off and .ply.
    Raises BadFile for another suffix or a place that cannot be written, BadMesh for numbers
    that are no mesh.
    """
    path = Path(path)
    write = _known(path, WRITERS)
    triangles = np.asarray(faces, dtype=np.int64)
    if not triangles.size:
        triangles = np.zeros((0, 3), dtype=np.int64)
    mesh = Mesh(np.asarray(vertices, dtype=np.float64), triangles)
    if not len(mesh.vertices):
        raise BadMesh(f"there are no vertices to write to {path}")
    if not len(triangles) and path.suffix.lower() in (".glb", ".stl"):
        raise BadFile(f"{path}: a {path.suffix} holds triangles; write points as .ply")
    content = write(mesh)
    write_file(path, content)


def _known(path: Path, formats: dict[str, Callable[[Any], Any]]) -> Callable[[Any], Any]:
    if path.suffix.lower() not in formats:
        raise BadFile(
            f"{path}: no mesh format is called {path.suffix!r}; there are {listed(formats)}"
        )
    return formats[path.suffix.lower()]


def _write_ply(mesh: Mesh) -> bytes:
    triangles = np.empty(len(mesh.faces), dtype=[("corners", "u1"), ("faces", "<i4", 3)])
    triangles["corners"], triangles["faces"] = 3, mesh.faces
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment metres, y up\n"
        f"element vertex {len(mesh.vertices)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    return header.encode() + mesh.vertices.astype("<f8").tobytes() + triangles.tobytes()


def _write_off(mesh: Mesh) -> bytes:
    positions = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in mesh.vertices.tolist())
    triangles = "".join(f"3 {a} {b} {c}\n" for a, b, c in mesh.faces.tolist())
    return f"OFF\n{len(mesh.vertices)} {len(mesh.faces)} 0\n{positions}{triangles}".encode()


def _write_with_trimesh(kind: str) -> Callable[[Mesh], bytes]:
    def write(mesh: Mesh) -> bytes:
        import trimesh  # a quarter of a second to import: not before it is needed

        same = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False, validate=False)
        content = same.export(file_type=kind)
        assert isinstance(content, bytes)  # of one file, that is not text
        return content

    return write


def parse_obj(lines: Iterable[str]) -> tuple[Array, Index]:
    """Vertices (N, 3) and triangles (F, 3), from 0; a polygon is a fan around its first corner.

    Raises ValueError with the number of a line that cannot be read.
    """
    vertices, faces, so_far = array("d"), array("q"), 0
    for number, line in enumerate(lines, start=1):
        match line.split():
            case ["v", *numbers]:
                vertices.extend(_position(numbers, number))
                so_far += 1
            case ["f", *corners]:
                if len(corners) < 3:
                    raise ValueError(f"line {number}: a face has at least 3 corners")
                first, *others = (_corner(c, so_far, number) for c in corners)
                for second, third in pairwise(others):
                    faces.extend((first, second, third))
    return np.array(vertices).reshape(-1, 3), np.array(faces, dtype=np.int64).reshape(-1, 3)


def _position(numbers: list[str], line: int) -> list[float]:
    try:
        x, y, z = (float(n) for n in numbers[:3])  # a colour or a weight may follow
    except ValueError:
        raise ValueError(f"line {line}: {shown(' '.join(numbers[:4]))} is no position") from None
    return [x, y, z]


def _corner(corner: str, so_far: int, line: int) -> int:
    """The vertex of `vertex/texture/normal`, counted from 1, or from -1 backwards."""
    try:
        index = int(corner.partition("/")[0])
    except ValueError:
        raise ValueError(f"line {line}: {shown(corner)} is no corner of a face") from None
    if abs(index) >= 2**53:
        raise ValueError(f"line {line}: there is no vertex {shown(index)}")
    if index == 0:
        raise ValueError(f"line {line}: vertices are counted from 1, but a face names vertex 0")
    return index - 1 if index > 0 else so_far + index


def obj_text(vertices: Array, faces: Index) -> str:
    """The mesh as an OBJ, every number with all its digits."""
    positions = (f"v {x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist())
    triangles = (f"f {a} {b} {c}\n" for a, b, c in (faces + 1).tolist())
    return "".join((*positions, *triangles))


NAMES = tuple(f"{st}{c}{n}OFF" for st in ("", "ST") for c in ("", "C") for n in ("", "N"))


def parse_off(content: bytes) -> tuple[Array, Index]:
    """Vertices (N, 3) and triangles (F, 3); a polygon is a fan around its first corner.

    Raises ValueError with what is wrong.
    """
    lines = _words(content)
    first = next(lines, [])
    if not first or first[0].upper() not in NAMES:
        raise ValueError("it does not begin with OFF")
    sizes = first[1:] or next(lines, [])
    n_vertices, n_faces = (_count(word, len(content)) for word in (sizes + ["", ""])[:2])
    positions = array("d")
    for _ in range(n_vertices):
        words = next(lines, [])
        try:
            x, y, z = (float(word) for word in words[:3])
        except ValueError:
            raise ValueError(f"a position is {shown(words[:3])}") from None
        positions.extend((x, y, z))
    corners, counts = array("q"), array("q")
    for face in range(n_faces):
        words = next(lines, [])
        try:
            size = int(words[0])
            corners.extend(int(word) for word in words[1 : 1 + max(size, 0)])
            whole = len(words) > size >= 0
        except (ValueError, IndexError, OverflowError):
            whole = False
        if not whole:
            raise ValueError(f"face {face} is {shown(words[:4])}")
        counts.append(size)
    vertices = np.array(positions, dtype=np.float64).reshape(-1, 3)
    return vertices, fans(vertex_numbers(np.array(corners, dtype=np.int64)), np.array(counts))


def _words(content: bytes) -> Iterator[list[str]]:
    """The words of each line that has any, without comments."""
    for line in text_lines(content):
        if words := line.partition("#")[0].split():
            yield words


def _count(word: str, most: int) -> int:
    """How many lines there are; each has a byte at least."""
    count = int(word) if word.isdecimal() and len(word) < 16 else -1
    if not 0 <= count <= most:
        raise ValueError(f"it claims to hold {shown(word)} vertices or faces in {most:,} bytes")
    return count


HEADER, ROW = 84, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def parse_stl(content: bytes) -> tuple[Array, Index]:
    """Vertices (3 F, 3), three for every triangle, and triangles (F, 3).

    A file is binary if its length is the one that its header gives. The first word does not decide:
    text files begin with `solid`, and so do many binary ones. Raises ValueError with what is wrong.
    """
    count = int.from_bytes(content[80:HEADER], "little")
    if len(content) == HEADER + count * ROW.itemsize:
        rows = np.frombuffer(content, ROW, count, HEADER)
        with np.errstate(invalid="ignore"):  # what is no number then is refused by the mesh
            vertices = rows["corners"].reshape(-1, 3).astype(np.float64)
    elif content.lstrip()[:5].lower() == b"solid" or len(content) < HEADER:
        vertices = _spoken(content)
    else:
        raise ValueError(
            f"its header counts {count:,} triangles, which {len(content):,} bytes do not hold"
        )
    if len(vertices) % 3:
        raise ValueError(f"{len(vertices):,} vertices are no triangles of three")
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


def _spoken(content: bytes) -> Array:
    found = array("d")
    for number, line in enumerate(text_lines(content), start=1):
        words = line.split()
        if words and words[0].lower() == "vertex":
            try:
                x, y, z = (float(word) for word in words[1:4])
            except ValueError:
                raise ValueError(f"line {number}: {shown(line)} is no vertex") from None
            found.extend((x, y, z))
    return np.array(found, dtype=np.float64).reshape(-1, 3)


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


LONGEST_LINE = 10**6  # characters; a line is split into its words before these are looked at


def text_lines(content: bytes) -> Iterator[str]:
    """The lines of a text. Raises ValueError for a line that is too long for a mesh file."""
    text = TextIOWrapper(BytesIO(content), encoding="utf-8", errors="replace")
    number = 0
    while line := text.readline(LONGEST_LINE + 1):
        number += 1
        if len(line) > LONGEST_LINE:
            raise ValueError(f"line {number} has more than {LONGEST_LINE:,} characters")
        yield line


def fans(corners: Index, counts: Index) -> Index:
    """Triangles (F, 3) of polygons: a fan around the first corner of each, in the file's order.

    `corners` are those of all polygons one after the other, `counts` how many each has. Raises
    ValueError for a polygon of fewer than three.
    """
    if len(counts) and counts.min() < 3:
        face = int(np.argmin(counts))
        raise ValueError(f"face {face} has {counts[face]} corners, and a face has at least 3")
    ends = np.cumsum(counts)
    first = np.repeat(ends - counts, counts - 2)  # of the polygon that each triangle is part of
    before = np.repeat(np.cumsum(counts - 2) - (counts - 2), counts - 2)
    step = np.arange(len(first)) - before
    return np.column_stack([corners[first], corners[first + step + 1], corners[first + step + 2]])


def vertex_numbers(numbers: NDArray[np.generic] | Iterable[int]) -> Index:
    """Numbers of vertices. Raises ValueError for anything but whole numbers from 0."""
    found = np.asarray(numbers)
    if found.dtype.kind == "f":
        whole = (found >= 0) & (found < 2.0**53) & (found == np.trunc(found))
        if not whole.all():
            raise ValueError(f"a face names the vertex {found[~whole][0]:g}")
    return found.astype(np.int64)


READERS: dict[str, Callable[[bytes], tuple[Array, Index]]] = {
    ".obj": lambda content: parse_obj(text_lines(content)),
    ".ply": parse_ply,
    ".glb": parse_glb,
    ".stl": parse_stl,
    ".off": parse_off,
}
WRITERS: dict[str, Callable[[Mesh], bytes]] = {
    ".obj": lambda mesh: obj_text(mesh.vertices, mesh.faces).encode(),
    ".ply": _write_ply,
    ".off": _write_off,
    ".glb": _write_with_trimesh("glb"),
    ".stl": _write_with_trimesh("stl"),
}
SOUPS = (".stl",)  # what holds triangles, and no vertices that they share
REGISTERED = tuple(sorted(READERS.keys() - set(SOUPS)))
