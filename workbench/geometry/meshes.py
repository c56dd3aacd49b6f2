"""Meshes and their files: the same vertices in the same order, out and in.

In metres, y up, as glTF has it; nothing is scaled, turned, merged or re-ordered.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.errors import BadFile, BadMesh, cut, listed
from workbench.geometry.glb import parse_glb
from workbench.geometry.obj import obj_text, parse_obj
from workbench.geometry.off import parse_off
from workbench.geometry.ply import parse_ply
from workbench.geometry.polygons import text_lines
from workbench.geometry.stl import parse_stl
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
        for name, array in (("vertices", self.vertices), ("faces", self.faces)):
            if array.ndim != 2 or array.shape[1] != 3:
                raise BadMesh(f"{name} have shape {array.shape}, but must be (., 3)")
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
