"""Meshes and their files: the same vertices in the same order, out and in.

In metres, y up, as glTF has it; nothing is scaled, turned, merged or re-ordered.
"""

import re
import warnings
from array import array
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from io import BytesIO, TextIOWrapper
from itertools import islice, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.environment import expanded
from workbench.errors import BadFile, BadMesh, cut, listed, shown
from workbench.geometry.gltf import parse_glb
from workbench.writing import write_file

if TYPE_CHECKING:
    import trimesh

LONGEST_LINE = 10**6  # characters; a line is split into its words before these are looked at
LONGEST_HEADER = 2**16  # bytes
COMMENTS = ("comment", "obj_info")  # in the header of a .ply
PLY_TYPES = {
    name: np.dtype(names.split()[1])
    for names in (
        *("char int8", "uchar uint8", "short int16", "ushort uint16"),
        *("int int32", "uint uint32", "float float32", "double float64"),
    )
    for name in names.split()
}
MOST_SOLIDS = 10_000  # in an .stl of text
OFF = tuple(f"{st}{c}{n}OFF" for st in ("", "ST") for c in ("", "C") for n in ("", "N"))

T = TypeVar("T")
Parts = tuple[Array, Index] | tuple[Array, Index, Array | None, Index | None]  # of a mesh


@dataclass(frozen=True, eq=False)
class Mesh:
    """Vertices (N, 3) in m and triangles (F, 3) of their numbers; a point cloud has none.

    What a file or another package has, `Mesh.of` takes, and `trimesh` gives back; the order of
    vertices and faces stays. Raises BadMesh if they do not fit together or a number is not finite.

    Texture coordinates are `uv` (M, 2), u to the right and v upwards, and `uv_faces` (F, 3), which
    of them the corners of each face have.

    >>> import trimesh
    >>> mesh = Mesh.of(trimesh.creation.box())
    >>> mesh.vertices.shape, mesh.trimesh().is_watertight
    ((8, 3), True)
    """

    vertices: Array
    faces: Index
    uv: Array | None = None
    uv_faces: Index | None = None

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
        textured = self.uv is not None or self.uv_faces is not None
        if textured and not fitting_texture(self.faces, self.uv, self.uv_faces):
            raise BadMesh(
                f"texture coordinates are finite uv (M, 2) with uv_faces ({len(self.faces)}, 3) "
                "of their numbers from 0; these are not"
            )

    @classmethod
    def of(
        cls, mesh: "Mesh | trimesh.Trimesh | ArrayLike", faces: ArrayLike | None = None
    ) -> "Mesh":
        """A mesh from a Mesh, a `trimesh.Trimesh`, or vertices (N, 3) m and faces (F, 3).

        Raises BadMesh for what is none.
        """
        if isinstance(mesh, Mesh):
            return mesh
        places: Any = mesh
        if faces is None:
            if not hasattr(places, "vertices") or not hasattr(places, "faces"):
                raise BadMesh(
                    f"a {type(mesh).__name__} is no mesh; give a Mesh, a trimesh.Trimesh, or "
                    "vertices and faces"
                )
            places, faces = places.vertices, places.faces
        try:
            vertices, triangles = np.array(places, np.float64, order="C"), np.asarray(faces)
        except (TypeError, ValueError) as error:
            raise BadMesh(f"vertices and faces must be arrays of numbers: {error}") from error
        if not triangles.size:
            triangles = np.zeros((0, 3), dtype=np.int64)
        if triangles.dtype.kind not in "iu":
            raise BadMesh(f"faces are {triangles.dtype}, but must be whole numbers of vertices")
        return cls(vertices, triangles.astype(np.int64))

    def trimesh(self) -> "trimesh.Trimesh":
        """The same vertices and faces in the same order, none merged or removed."""
        import trimesh  # a quarter of a second to import: not before it is needed

        return trimesh.Trimesh(self.vertices, self.faces, process=False, validate=False)

    def unwrapped(self) -> tuple[Index, Index, Array | None]:
        """Rows with one texture coordinate each, as glTF has them.

        Which vertex each row is (R,), faces (F, 3) of rows, and uv (R, 2), if there are any. The
        first N rows are the vertices; those on a seam have further rows after them.
        """
        N = len(self.vertices)
        if self.uv is None or self.uv_faces is None:
            return np.arange(N), self.faces, None
        pairs = np.column_stack([self.faces.ravel(), self.uv_faces.ravel()])
        used, of_corner = np.unique(pairs, axis=0, return_inverse=True)
        again = np.diff(used[:, 0], prepend=-1) == 0
        row = np.where(again, N + np.cumsum(again) - 1, used[:, 0])
        uv = np.zeros((N + int(again.sum()), 2))
        uv[row] = self.uv[used[:, 1]]
        origin = np.concatenate([np.arange(N), used[again, 0]])
        return origin, row[of_corner.ravel()].reshape(-1, 3), uv


def fitting_texture(faces: Index, uv: Array | None, uv_faces: Index | None) -> bool:
    """Whether these are texture coordinates (M, 2) and their numbers at the corners of faces."""
    if uv is None or uv_faces is None or uv.ndim != 2 or uv.shape[1] != 2:
        return False
    numbered = uv_faces.shape == faces.shape and not ((uv_faces < 0) | (uv_faces >= len(uv))).any()
    return numbered and bool(np.isfinite(uv).all())


def read_mesh(path: str | Path, *, points_alone: bool = False) -> Mesh:
    """The mesh in a .glb, .obj, .off, .ply or .stl file, with the file's vertices in its order.

    An .stl holds three vertices per triangle and shares none; the parts of a .glb scene come
    one after the other, each where the scene puts it. Positions, triangles and, of an .obj and a
    .glb, texture coordinates that all faces have, are all that is read: normals, colours, textures,
    materials, skins, morphs, animations, cameras and lines are left in the file. `points_alone`
    lets a file without faces pass, as a mesh with faces (0, 3). Raises BadFile if there is nothing
    to read.
    """
    path = Path(path)
    parts = parsed_mesh(path, _format_of(path, MESH_READERS))
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
    if Path(path).suffix.lower() in UNSHARED:
        raise BadFile(
            f"{path}: an .stl holds three vertices of its own for every triangle, so which vertex "
            f"is which is lost; give the mesh as {listed(WITH_VERTEX_ORDER)}"
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


def write_mesh(
    path: str | Path, mesh: "Mesh | trimesh.Trimesh | ArrayLike", faces: ArrayLike | None = None
) -> None:
    """Write a Mesh, a `trimesh.Trimesh`, or vertices (N, 3) m and faces (F, 3) from 0.

    The suffix of `path` says how: .obj, .off and .ply keep every digit (float64), .glb and .stl are
    of single precision by their definition. Whole or not at all. Points without faces go into
    .obj, .off and .ply. Texture coordinates go into .obj and .glb; in a .glb, vertices on a seam
    are repeated after all others. Raises BadFile for another suffix or a place that cannot be
    written, BadMesh for what is no mesh.
    """
    path = Path(path)
    write = _format_of(path, MESH_WRITERS)
    mesh = Mesh.of(mesh, faces)
    if not len(mesh.vertices):
        raise BadMesh(f"there are no vertices to write to {path}")
    if not len(mesh.faces) and path.suffix.lower() in (".glb", ".stl"):
        raise BadFile(f"{path}: a {path.suffix} holds triangles; write points as .ply")
    write_file(path, write(mesh))


def _format_of(path: Path, formats: dict[str, Callable[[Any], Any]]) -> Callable[[Any], Any]:
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
        shown, (origin, faces, uv) = mesh.trimesh(), mesh.unwrapped()
        if kind == "glb" and uv is not None:
            import trimesh

            visual: Any = trimesh.visual
            shown = Mesh(mesh.vertices[origin], faces).trimesh()
            shown.visual = visual.TextureVisuals(uv, visual.material.PBRMaterial())
        content = shown.export(file_type=kind)
        assert isinstance(content, bytes)  # of one file, that is not text
        return content

    return write


def parse_obj(lines: Iterable[str]) -> Parts:
    """Vertices (N, 3) and triangles (F, 3), from 0; a polygon is a fan around its first corner.

    Readers made for drawing split a vertex wherever its texture or normal changes, and so lose the
    order that registered meshes agree on. This one reads `v`, `f`, and `vt` where all corners of
    faces have one. Raises ValueError with the number of a line that cannot be read.
    """
    vertices, faces, so_far = array("d"), array("q"), 0
    coordinates, at_corners = array("d"), array("q")
    for number, line in enumerate(lines, start=1):
        match line.split():
            case ["v", *numbers]:
                vertices.extend(_position(numbers, f"line {number}"))
                so_far += 1
            case ["f", *corners]:
                if len(corners) < 3:
                    raise ValueError(f"line {number}: a face has at least 3 corners")
                faces.extend(_fan([_corner(c, so_far, number) for c in corners]))
                if "/" in line:
                    texture = [_texture_corner(c, len(coordinates) // 2) for c in corners]
                    at_corners.extend(_fan(texture))
            case ["vt", *words]:
                coordinates.extend(_coordinate(words))
    places, uv = np.array(vertices).reshape(-1, 3), np.array(coordinates).reshape(-1, 2)
    triangles, uv_faces = (np.array(n, np.int64).reshape(-1, 3) for n in (faces, at_corners))
    fits = len(uv) and fitting_texture(triangles, uv, uv_faces)
    return (places, triangles, uv, uv_faces) if fits else (places, triangles)


def _coordinate(words: list[str]) -> tuple[float, float]:
    try:
        u, v = (float(word) for word in words[:2])
    except ValueError:
        return np.nan, np.nan  # which no texture has
    return u, v


def _texture_corner(corner: str, so_far: int) -> int:
    """The texture coordinate of `vertex/texture/normal`, from 0; -1 where there is none."""
    number = corner.partition("/")[2].partition("/")[0]
    if not number.removeprefix("-").isdecimal() or len(number) > 15 or int(number) == 0:
        return -1
    return int(number) - 1 if number[0] != "-" else max(so_far + int(number), -1)


def _fan(polygon: list[int]) -> Iterator[int]:
    """The corners of a polygon's triangles around its first corner."""
    for pair in pairwise(polygon[1:]):
        yield from (polygon[0], *pair)


def _position(words: list[str], where: str) -> list[float]:
    try:
        x, y, z = (float(word) for word in words[:3])  # a colour or a weight may follow
    except ValueError:
        raise ValueError(f"{where}: {shown(' '.join(words[:4]))} is no position") from None
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


def obj_text(mesh: Mesh) -> str:
    """The mesh as an OBJ, every number with all its digits."""
    lines = [f"v {x!r} {y!r} {z!r}\n" for x, y, z in mesh.vertices.tolist()]
    if mesh.uv is None or mesh.uv_faces is None:
        lines += (f"f {a} {b} {c}\n" for a, b, c in (mesh.faces + 1).tolist())
        return "".join(lines)
    lines += (f"vt {u!r} {v!r}\n" for u, v in mesh.uv.tolist())
    corners = (np.hstack([mesh.faces, mesh.uv_faces]) + 1).tolist()
    lines += (f"f {a}/{x} {b}/{y} {c}/{z}\n" for a, b, c, x, y, z in corners)
    return "".join(lines)


def text_lines(content: bytes) -> Iterator[str]:
    """The lines of a text. Raises ValueError for a line that is too long for a mesh file."""
    text = TextIOWrapper(BytesIO(content), encoding="utf-8-sig", errors="replace")
    number = 0
    while line := text.readline(LONGEST_LINE + 1):
        number += 1
        if len(line) > LONGEST_LINE:
            raise ValueError(f"line {number} has more than {LONGEST_LINE:,} characters")
        yield line


def parse_ply_and_normals(content: bytes) -> tuple[Array, Index, Array | None]:
    """Vertices (N, 3), triangles (F, 3), and the normals (N, 3) of vertices, of any length, if any.

    A polygon is a fan around its first corner. In a text whose polygons have different numbers of
    corners, triangles come first. Raises ValueError with what is wrong. (Greg Turk, The PLY Polygon
    File Format, 1994.)
    """
    from trimesh.exchange.ply import load_ply

    sizes, properties, content = _ply_header(content)
    try:
        elements = _by_trimesh(load_ply, content, fix_texture=False, skip_materials=True)
    except ValueError as error:
        if "unexpected length" not in str(error):
            raise
        content, triangles = _triangulated(content, sizes, properties)
        elements = _by_trimesh(load_ply, content, fix_texture=False, skip_materials=True)
        elements["faces"], sizes["face"] = triangles, len(triangles)
    with np.errstate(invalid="ignore"):  # what is no number then is refused by the mesh
        vertices = np.asarray(elements.get("vertices", np.zeros((0, 3))), dtype=np.float64)
        normals = elements.get("vertex_normals")
        normals = None if normals is None else np.asarray(normals, dtype=np.float64)
    faces = np.asarray(elements.get("faces", ()))
    if not faces.size:
        faces = np.zeros((0, 3), dtype=np.int64)
    if faces.dtype.kind not in "iu" or faces.ndim != 2 or faces.shape[1] < 3:
        raise ValueError("its faces are no lists of three or more whole numbers")
    corners = [(0, k, k + 1) for k in range(1, faces.shape[1] - 1)]
    faces = faces[:, corners].reshape(-1, 3).astype(np.int64)
    _check_counts(vertices, len(faces), sizes.get("vertex", 0), sizes.get("face", 0))
    return vertices, faces, normals


def _triangulated(
    content: bytes, rows: dict[str, int], properties: dict[str, list[list[str]]]
) -> tuple[bytes, Index]:
    """A binary .ply without its faces, and its polygons of different numbers of corners as fans.

    trimesh reads lists of one length alone. Faces come last, after elements without lists, as all
    programs write them. Raises ValueError.
    """
    head, _, body = content.partition(b"end_header\n")
    order: Literal["<", ">"] = "<" if b"binary_little" in head else ">"
    *before, last = properties
    face = properties.get("face", [])
    lists = [k for k, words in enumerate(face) if words[0] == "list"]
    others = [words for name in before for words in properties[name]]
    if last != "face" or len(lists) != 1 or any(words[0] == "list" for words in others):
        raise ValueError("it is cut off, or has lists beside the corners of its faces")
    _, count_type, corner_type, *_ = face[lists[0]]
    kinds = [words[0] for words in (*others, *face) if words[0] != "list"]
    if unknown := [kind for kind in (*kinds, count_type, corner_type) if kind not in PLY_TYPES]:
        raise ValueError(f"its header names the type {shown(unknown[0])}")

    def n_bytes(several: list[list[str]]) -> int:
        return sum(PLY_TYPES[words[0]].itemsize for words in several)

    first_face = sum(rows[name] * n_bytes(properties[name]) for name in before)
    ahead, behind = n_bytes(face[: lists[0]]), n_bytes(face[lists[0] + 1 :])
    counts, corners = (PLY_TYPES[name].newbyteorder(order) for name in (count_type, corner_type))
    triangles, start = array("q"), first_face
    for _ in range(rows["face"]):
        start += ahead
        k = int(np.frombuffer(body, counts, 1, start)[0])
        polygon = np.frombuffer(body, corners, k, start + counts.itemsize).tolist()
        start += counts.itemsize + k * corners.itemsize + behind
        if k < 3:
            raise ValueError("a face has at least 3 corners")
        triangles.extend(_fan(polygon))
    without = head[: head.rindex(b"element face")] + b"end_header\n" + body[:first_face]
    return without, np.array(triangles, dtype=np.int64).reshape(-1, 3)


def _ply_header(content: bytes) -> tuple[dict[str, int], dict[str, list[list[str]]], bytes]:
    """How many there are of each element, believed only as far as there are bytes for them.

    And the words of their properties. The content that is returned has no comments in its header,
    whose letters trimesh may not know, and another name for edges, of which it would make a path.
    """
    head, end, _ = content[:LONGEST_HEADER].partition(b"end_header")
    lines = head.decode("latin1").splitlines()
    lines = [line for line in lines if line.strip() and line.split()[0] not in COMMENTS]
    if not content[:3].lower().startswith(b"ply") or not end:
        raise ValueError("it has no header from `ply` to `end_header`")
    if not lines[1:] or not re.fullmatch(
        r"format (ascii|binary_(little|big)_endian) \S+", lines[1].strip()
    ):
        raise ValueError(f"its second line is {shown(''.join(lines[1:2]))}, and no format")
    sizes, properties = dict[str, int](), dict[str, list[list[str]]]()
    for line in lines[2:]:
        match line.split():
            case ["element", name, count] if (
                count.isdecimal() and len(count) < 16 and name not in sizes
            ):
                sizes[name], properties[name] = int(count), []
            case ["property", *words] if sizes and (
                len(words) == 2 or (len(words) == 4 and words[0] == "list")
            ):
                properties[[*sizes][-1]].append(words)
            case _:
                raise ValueError(f"its header says {shown(line)}")
    least = sum(size * len(properties[name]) for name, size in sizes.items())
    rows = content.count(b"\n", len(head)) if "ascii" in lines[1] else 0
    if least > len(content) or rows > sum(sizes.values()) + 2:
        raise ValueError(
            f"its header counts {sum(sizes.values()):,} elements, and there are {len(content):,} "
            f"bytes{f' in {rows:,} lines' if rows else ''}"
        )
    plain = "\n".join([*lines, ""]).replace("element edge ", "element line ")
    return sizes, properties, plain.encode("ascii", "replace") + content[len(head) :]


def parse_off(content: bytes) -> tuple[Array, Index]:
    """Vertices (N, 3) and triangles (F, 3) of an Object File Format; a polygon is a fan.

    What follows a position in its line, texture coordinates, colour and normal, is left in the
    file. trimesh takes no polygons of more than four corners from it, and passes over a last face
    that is cut off. Raises ValueError with what is wrong.
    """
    lines = (words for line in text_lines(content) if (words := line.partition("#")[0].split()))
    first = next(lines, [])
    if not first or first[0].upper() not in OFF:
        raise ValueError("it does not begin with OFF")
    sizes = (first[1:] or next(lines, []))[:2]
    if len(sizes) < 2 or not all(size.isdecimal() and len(size) < 16 for size in sizes):
        raise ValueError(f"it claims to hold {shown(sizes)} vertices and faces")
    n_vertices, n_faces = map(int, sizes)
    vertices, faces, read = array("d"), array("q"), 0
    for words in islice(lines, n_vertices):
        vertices.extend(_position(words, "vertices"))
    for read, words in enumerate(islice(lines, n_faces), start=1):
        try:
            size, *corners = (int(word) for word in words[: int(words[0]) + 1])
        except (ValueError, OverflowError):
            size, corners = -1, []
        if size != len(corners) or size < 3 or max(map(abs, corners)) >= 2**53:
            raise ValueError(f"face {read - 1} is {shown(words[:4])}")
        faces.extend(_fan(corners))
    places = np.array(vertices).reshape(-1, 3)
    _check_counts(places, read, n_vertices, n_faces)
    return places, np.array(faces, dtype=np.int64).reshape(-1, 3)


def parse_stl(content: bytes) -> tuple[Array, Index]:
    """Vertices (3 F, 3), three for every triangle, and triangles (F, 3); binary or text.

    Raises ValueError with what is wrong.
    """
    from trimesh.exchange.stl import load_stl

    text = content.lstrip()[:5].lower() == b"solid"
    if text and content.lower().count(b"endsolid") > MOST_SOLIDS:
        raise ValueError(f"it holds more than {MOST_SOLIDS:,} solids")
    scene = _by_trimesh(load_stl, content)
    parts = scene.get("geometry", {"": scene}).values()
    with np.errstate(invalid="ignore"):  # what is no number then is refused by the mesh
        vertices = np.concatenate([np.zeros((0, 3)), *(part["vertices"] for part in parts)])
    binary = len(content) == 84 + 50 * (len(vertices) // 3)
    if not binary and (not text or content.lower().count(b"vertex") != len(vertices)):
        raise ValueError("it is cut off: there are other triangles than it says")
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


def _by_trimesh(load: Callable[..., dict[str, Any]], content: bytes, **how: Any) -> dict[str, Any]:
    """What a reader of trimesh makes of a file. Raises ValueError for whatever it stumbles over."""
    with warnings.catch_warnings(), np.errstate(over="ignore", invalid="raise"):
        # by a warning NumPy says that a text stops being numbers, and stops reading
        warnings.filterwarnings("error", message="string or file could not be read")
        try:
            return load(BytesIO(content), **how)
        except Exception as error:
            raise ValueError(f"trimesh does not read it ({cut(error)})") from error


def _check_counts(vertices: Array, n_read: int, n_vertices: int, n_faces: int) -> None:
    """Raise ValueError for less than a header says, which trimesh reads without a word."""
    if len(vertices) != n_vertices or n_read < n_faces:
        raise ValueError(
            f"its header says {n_vertices:,} vertices and {n_faces:,} faces, but "
            f"{len(vertices):,} and {n_read:,} follow"
        )


MESH_READERS: dict[str, Callable[[bytes], Parts]] = {
    ".obj": lambda content: parse_obj(text_lines(content)),
    ".ply": lambda content: parse_ply_and_normals(content)[:2],
    ".glb": parse_glb,
    ".stl": parse_stl,
    ".off": parse_off,
}
MESH_WRITERS: dict[str, Callable[[Mesh], bytes]] = {
    ".obj": lambda mesh: obj_text(mesh).encode(),
    ".ply": _write_ply,
    ".off": _write_off,
    ".glb": _write_with_trimesh("glb"),
    ".stl": _write_with_trimesh("stl"),
}
UNSHARED = (".stl",)  # what holds triangles, and no vertices that they share
WITH_VERTEX_ORDER = tuple(sorted(MESH_READERS.keys() - set(UNSHARED)))
