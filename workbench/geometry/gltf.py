"""glTF 2.0 read: the JSON and buffers of a .glb or .gltf, and the triangles its scene shows.

A file of a few bytes can claim billions of numbers that no bytes stand for, show one mesh a million
times, or hang its nodes on each other in a circle. So numbers are views of the file's own bytes,
each node is visited once, and what is shown again is paid for. A buffer is the binary part of a
.glb, text in base64, or another file, which is opened only if the caller names the folder of the
text, and only in this folder or below it: a file must not make a reader open whatever is on the
machine or on the web. (Khronos Group, glTF 2.0 Specification.)
"""

import base64
import binascii
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from workbench.arrays import Array, Index
from workbench.errors import shown
from workbench.reading.facts import bounded, parsed

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
MOST_ZEROS = 5_000_000  # numbers of a sparse accessor that has no bytes


@dataclass(frozen=True)
class GlbDocument:
    """The JSON of a file, and the bytes of its buffers."""

    json: dict[str, Any]
    buffers: list[bytes]

    def entry(self, key: str, index: Any) -> dict[str, Any]:
        """`key[index]`, an object. Raises ValueError if there is none."""
        entries = self.json.get(key)
        if isinstance(entries, list) and type(index) is int and 0 <= index < len(entries):
            entry = entries[index]
            if isinstance(entry, dict):
                return entry
        raise ValueError(f"there is no {key}[{shown(index)}]")

    def values(self, index: Any, kind: str, columns: int) -> Array:
        """The numbers (count, columns) of an accessor, sparse or not, normalized if it says so.

        Raises ValueError for numbers without bytes, as those that an extension compresses.
        """
        accessor, name = self.entry("accessors", index), f"accessors[{shown(index)}]"
        dtype, count = _dtype(accessor, kind, name), whole(accessor, "count")
        if "bufferView" in accessor:
            stored = self._view(accessor, dtype, count, columns, kind, name)
        elif "sparse" in accessor and count * columns <= MOST_ZEROS:
            stored = np.zeros((count, columns), dtype)
        else:
            raise ValueError(
                f"{name} says it holds {count:,} {kind} and has no bytes for them; of a file that "
                "is compressed, as by Draco, export one that is not"
            )
        if "sparse" in accessor:
            stored = self._replaced(accessor["sparse"], stored.copy(), kind, name)
        with np.errstate(invalid="ignore"):
            numbers = stored.astype(np.float64)
        if accessor.get("normalized") is True and dtype.kind in "iu":
            numbers = np.maximum(numbers / np.iinfo(dtype).max, -1.0)
        return numbers

    def _replaced(self, sparse: Any, numbers: NDArray[Any], kind: str, name: str) -> NDArray[Any]:
        """The numbers with some rows of their own, as a sparse accessor lists them."""
        if not isinstance(sparse, dict) or not isinstance(sparse.get("indices"), dict):
            raise ValueError(f"{name} is sparse and does not say where")
        if not isinstance(sparse.get("values"), dict):
            raise ValueError(f"{name} is sparse and does not say what")
        n_rows, indices = whole(sparse, "count"), sparse["indices"]
        unsigned = _dtype(indices | {"type": "SCALAR"}, "SCALAR", name)
        rows = self._view(indices, unsigned, n_rows, 1, "SCALAR", name).astype(np.int64).ravel()
        if n_rows and not (rows.min() >= 0 and rows.max() < len(numbers)):
            raise ValueError(f"{name} is sparse and names rows that it does not have")
        columns = numbers.shape[1]
        numbers[rows] = self._view(sparse["values"], numbers.dtype, n_rows, columns, kind, name)
        return numbers

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
        return self.buffers[int(index)]


def _dtype(accessor: dict[str, Any], kind: str, name: str) -> np.dtype[Any]:
    code = accessor.get("componentType")
    if accessor.get("type") != kind or type(code) is not int or code not in COMPONENTS:
        raise ValueError(f"{name} holds {shown(accessor.get('type'))}, but must hold {kind}")
    return np.dtype(COMPONENTS[code])


# what a node does whose file does not say it
IDENTITY = {"translation": (0, 0, 0), "rotation": (0, 0, 0, 1), "scale": (1, 1, 1)}


def local_motions(node: dict[str, Any], animated: Mapping[str, Array], count: int = 1) -> Array:
    """The motions (S, 4, 4) of a node within its parent: a matrix, or T R S.

    Those of its properties that are `animated` are (S, w).
    """
    if "matrix" in node and not animated:
        matrix = _reals_of(node["matrix"], 16).reshape(4, 4).T
        return np.broadcast_to(matrix, (count, 4, 4))
    parts = {k: animated.get(k, _reals_of(node.get(k, v), len(v))) for k, v in IDENTITY.items()}
    if not parts["rotation"].any(axis=-1).all():
        raise ValueError("the rotation of a node is zero, and not a unit quaternion")
    motions = np.zeros((count, 4, 4))
    with np.errstate(all="ignore"):
        motions[:, :3, :3] = Rotation.from_quat(parts["rotation"]).as_matrix()
        motions[:, :3, :3] *= parts["scale"].reshape(-1, 1, 3)
    motions[:, :3, 3], motions[:, 3, 3] = parts["translation"], 1.0
    return motions


def skin_joints(document: GlbDocument, number: Any) -> tuple[list[int], Array | None]:
    """The nodes of a skin's K joints, and its bind matrices (K, 4, 4), if it has some.

    Raises ValueError.
    """
    skin = document.entry("skins", number)
    joints = children(skin, "joints")[::-1]
    if any(type(joint) is not int for joint in joints):
        raise ValueError(f"skins[{number}] has joints that are no numbers")
    if len({*joints}) < len(joints):
        raise ValueError(f"skins[{number}] lists the same joint twice")
    if "inverseBindMatrices" not in skin:
        return joints, None
    flat = document.values(skin["inverseBindMatrices"], "MAT4", 16)[: len(joints)]
    if len(flat) < len(joints):
        raise ValueError(f"skins[{number}] has {len(joints)} joints, {len(flat)} bind matrices")
    return joints, flat.reshape(-1, 4, 4).swapaxes(1, 2)


def several(holder: dict[str, Any], key: str) -> list[dict[str, Any]]:
    """The objects of a list, which may be missing."""
    objects = holder.get(key, [])
    if not isinstance(objects, list) or not all(isinstance(entry, dict) for entry in objects):
        raise ValueError(f"its {key} are no list of objects")
    return objects


def children(holder: dict[str, Any], key: str) -> list[Any]:
    """The numbers of nodes in `holder[key]`, the last one first; empty if there is no such list."""
    nodes = holder.get(key, [])
    if not isinstance(nodes, list):
        raise ValueError(f"its {key} are no list of numbers")
    return nodes[::-1]  # the last that waits comes first


def whole(holder: dict[str, Any], key: str, otherwise: int | None = None) -> int:
    """A whole number from 0 on. Raises ValueError."""
    number = holder.get(key, otherwise)
    if type(number) is not int or not 0 <= number < 2**53:
        raise ValueError(f"its {key} is {shown(number)}, but must be a whole number from 0")
    return number


def _reals_of(entry: Any, count: int) -> Array:
    """The numbers (count,) of a node's place. Raises ValueError."""
    try:
        numbers = np.asarray(entry, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        numbers = np.zeros(0)
    if numbers.shape != (count,):
        raise ValueError(f"a node's place is {shown(entry)}, but must be {count} numbers")
    return numbers


MAGIC, JSON, BINARY = b"glTF", b"JSON", b"BIN\0"
MOST_BYTES = 2**30  # of all files beside a .gltf together
BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def document_of(content: bytes, folder: Path | None = None) -> GlbDocument:
    """The document of a .glb or of a .gltf. Raises ValueError (BadFile of its JSON), OSError.

    `folder` is where the file is: buffers in other files are read from there. Without it there are
    none, and the content must be that of a .glb.
    """
    text = content.removeprefix(BYTE_ORDER_MARK).lstrip()
    if content[:4] == MAGIC and content[4:8] == b"\2\0\0\0":
        chunks = _chunks(content)
    elif folder is not None and text[:1] == b"{":
        chunks = {JSON: text}
    else:
        raise ValueError("it does not begin as glTF 2.0 does")
    json = parsed(chunks.get(JSON, b"null").rstrip(b" \0"))
    if not isinstance(json, dict):
        raise ValueError("its JSON is no object")
    version = json["asset"].get("version") if isinstance(json.get("asset"), dict) else None
    if content[:4] != MAGIC and not (isinstance(version, str) and version.startswith("2.")):
        raise ValueError(f"its asset says version {shown(version)}, and glTF 2.0 is read")
    buffers, read = several(json, "buffers"), dict[Path, bytes]()
    contents = [_buffer_bytes(b, k, chunks, folder, read) for k, b in enumerate(buffers)]
    return GlbDocument(json, contents)


def _chunks(content: bytes) -> dict[bytes, bytes]:
    """The parts of a .glb by their kind."""
    chunks: dict[bytes, bytes] = {}
    start = 12
    while start + 8 <= len(content):
        length = int.from_bytes(content[start : start + 4], "little")
        kind = content[start + 4 : start + 8]
        if start + 8 + length > len(content):
            raise ValueError(f"a part of {length:,} bytes is cut off")
        if kind in (JSON, BINARY):  # others are to be passed over
            chunks.setdefault(kind, content[start + 8 : start + 8 + length])
        start += 8 + length
    return chunks


def _buffer_bytes(
    buffer: dict[str, Any],
    number: int,
    chunks: dict[bytes, bytes],
    folder: Path | None,
    read: dict[Path, bytes],
) -> bytes:
    """What a buffer holds; `known` are the files beside this one that were read."""
    uri, name = buffer.get("uri"), f"buffers[{number}]"
    if uri is None:
        return chunks.get(BINARY, b"") if number == 0 else b""
    head, _, text = uri.partition("base64,") if isinstance(uri, str) else ("", "", "")
    if not head.startswith("data:"):
        return _bytes_beside(folder, uri, name, whole(buffer, "byteLength", 0), read)
    try:
        return base64.b64decode(text)
    except binascii.Error as error:
        raise ValueError(f"{name} is no base64 ({error})") from error


def _bytes_beside(
    folder: Path | None, uri: Any, name: str, length: int, read: dict[Path, bytes]
) -> bytes:
    """The bytes of the file that a URI names; each is read once, and all have one limit together.

    The file is in the folder or below it.
    """
    if folder is None:
        raise ValueError(
            f"{name} is in another file, {shown(uri)}, which is not opened; export the mesh as one "
            ".glb"
        )
    inside = unquote(uri) if isinstance(uri, str) else ""
    parts, strange = PurePosixPath(inside).parts, set(":\\\0") & set(inside)
    if not parts or inside.startswith("/") or ".." in parts or strange or len(inside) > 1000:
        raise ValueError(
            f"{name} is said to be in {shown(uri)}, and only files in the folder of the .gltf, or "
            "below it, are opened; put the file there"
        )
    home = folder.resolve()
    path = home.joinpath(*parts).resolve()
    if not path.is_relative_to(home):  # a link that leads elsewhere
        raise ValueError(f"{name} is in {shown(uri)}, which leads out of the file's folder")
    if not path.is_file():
        raise ValueError(
            f"{name} is in the file {shown(uri)}, which is not in the folder; keep both together"
        )
    if path not in read:
        try:
            read[path] = bounded(path, MOST_BYTES - sum(map(len, read.values())))
        except OSError as error:
            raise ValueError(f"{name} is in {shown(uri)}, which cannot be read") from error
    if length > len(read[path]):
        raise ValueError(
            f"{name} has {length:,} bytes, and its file {shown(uri)} {len(read[path]):,}"
        )
    return read[path]


POINTS, TRIANGLES, STRIP, FAN = 0, 4, 5, 6  # modes of primitives; the others are lines
FREE_BYTES = 2**28  # that all parts together may take, however small the file is
MOST_PER_BYTE = 16  # further bytes that they may take for each byte of the file
LEAST_PART = 2**14  # bytes that a part counts as at least, for placing one takes time


def parse_glb(content: bytes) -> tuple[Array, Index, Array | None, Index | None]:
    """Vertices (N, 3) in m and triangles (F, 3) of all parts, one after the other.

    And texture coordinates (N, 2), v upwards, and the triangles again, which are theirs too; None
    twice unless all parts have them. What has a skin is posed by its joints, wherever its own node
    is (section 3.7.3.3). Raises ValueError (BadFile of its JSON) with what is wrong.
    """
    document = document_of(content)
    places = _mesh_motions(document)
    vertices, faces = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)]
    textures = list[Array | None]()
    count, bytes_left = 0, FREE_BYTES + MOST_PER_BYTE * len(content)
    for number, mesh in enumerate(several(document.json, "meshes")):
        motions = places.get(number, [])
        for primitive in several(mesh, "primitives") if motions else []:
            positions, triangles = _part(document, primitive)
            uv = _texture(document, primitive, len(positions))
            n_bytes = positions.nbytes + triangles.nbytes + (0 if uv is None else uv.nbytes)
            bytes_left -= len(motions) * max(n_bytes, LEAST_PART)
            if bytes_left < 0:
                raise ValueError(
                    "its scene shows the same parts again and again, so that all of them take more "
                    f"than {MOST_PER_BYTE} times the file's {len(content):,} bytes"
                )
            for motion in motions:
                if motion.ndim == 2:
                    vertices.append(_moved(positions, motion))
                else:
                    vertices.append(_skinned(document, primitive, positions, motion))
                faces.append(triangles + count)
                textures.append(uv)
                count += len(positions)
    corners, uv_of = np.concatenate(faces), [uv for uv in textures if uv is not None]
    if not uv_of or len(uv_of) < len(textures):
        return np.concatenate(vertices), corners, None, None
    return np.concatenate(vertices), corners, np.concatenate(uv_of), corners


def _texture(document: GlbDocument, primitive: dict[str, Any], count: int) -> Array | None:
    """The first texture coordinates (count, 2) of a part; None where they cannot be used."""
    try:
        uv = document.values(primitive["attributes"]["TEXCOORD_0"], "VEC2", 2)
    except (KeyError, TypeError, ValueError):
        return None
    uv = np.column_stack([uv[:, 0], 1.0 - uv[:, 1]])
    return uv if len(uv) == count and np.isfinite(uv).all() else None


def _mesh_motions(document: GlbDocument) -> dict[int, list[Array]]:
    """The motions to where the scene shows each mesh, in the order of the nodes' names.

    They are (4, 4), or those of the joints (K, 4, 4) of the skin that a node has.
    """
    json = document.json
    scene = document.entry("scenes", json.get("scene", 0)) if "scenes" in json else {}
    waiting = [(child, np.eye(4)) for child in children(scene, "nodes")]
    worlds: dict[int, Array] = {}
    users: dict[int, list[tuple[str, int]]] = {}
    while waiting:
        number, motion = waiting.pop()
        node = document.entry("nodes", number)
        if number in worlds:
            raise ValueError(f"nodes[{number}] hangs on two others, or on itself")
        if not node.keys().isdisjoint({"matrix", *IDENTITY}):
            with np.errstate(all="ignore"):  # what is not finite then is refused as a vertex
                motion = motion @ local_motions(node, {})[0]
        worlds[number] = motion
        waiting += [(child, motion) for child in children(node, "children")]
        if "mesh" in node:
            document.entry("meshes", node["mesh"])
            users.setdefault(node["mesh"], []).append((str(node.get("name", number))[:100], number))
    skins: dict[int, Array] = {}
    shown_at: dict[int, list[Array]] = {mesh: [] for mesh in users}
    for mesh, named in users.items():
        for _, number in sorted(named):
            skin = json["nodes"][number].get("skin")
            if skin is not None and (type(skin) is not int or skin not in skins):
                skins[skin] = _joint_motions(document, skin, worlds)
            shown_at[mesh].append(worlds[number] if skin is None else skins[skin])
    return shown_at


def _joint_motions(document: GlbDocument, number: int, worlds: dict[int, Array]) -> Array:
    """What the joints of a skin do to a mesh, (K, 4, 4): from its space to the scene."""
    joints, inverse = skin_joints(document, number)
    if not joints or any(joint not in worlds for joint in joints):
        raise ValueError(f"skins[{number}] has no joints, or one that its scene does not show")
    world = np.stack([worlds[joint] for joint in joints])
    with np.errstate(all="ignore"):
        return world if inverse is None else np.asarray(world @ inverse)


MOST_SETS = 8  # of four joints that a vertex follows


def _skinned(
    document: GlbDocument, primitive: dict[str, Any], positions: Array, motions: Array
) -> Array:
    """Vertices (N, 3) by linear blend skinning, with weights that are made to add up to one."""
    if not len(positions):
        return positions
    attributes = primitive["attributes"]
    sets = [n for n in range(MOST_SETS) if f"JOINTS_{n}" in attributes]
    if not sets:
        raise ValueError("a mesh has a skin, and its vertices follow no joints")
    joints, weights = (
        np.hstack([document.values(attributes.get(f"{kind}_{n}"), "VEC4", 4) for n in sets])
        for kind in ("JOINTS", "WEIGHTS")
    )
    if not len(joints) == len(weights) == len(positions):
        raise ValueError(f"{len(positions):,} vertices have the weights of {len(weights):,}")
    weights = np.where(weights > 0, weights, 0.0)
    weights[~weights.any(axis=1), 0] = 1.0  # as three.js has it
    joints = np.where(weights > 0, joints, 0)
    if not ((joints >= 0) & (joints < len(motions))).all():
        raise ValueError(f"a vertex follows a joint beyond the {len(motions)} of its skin")
    moved = np.zeros_like(positions)
    with np.errstate(all="ignore"):
        for k, weight in zip(joints.astype(np.int64).T, weights.T, strict=True):
            posed = np.einsum("nij,nj->ni", motions[k, :3, :3], positions) + motions[k, :3, 3]
            moved += weight[:, None] * posed
        return np.asarray(moved / weights.sum(axis=1, keepdims=True))


def _part(document: GlbDocument, primitive: dict[str, Any]) -> tuple[Array, Index]:
    """Vertices and triangles of one primitive; lines are left out, and points have no triangles."""
    mode, attributes = primitive.get("mode", TRIANGLES), primitive.get("attributes")
    none = np.zeros((0, 3), dtype=np.int64)
    if mode not in (POINTS, TRIANGLES, STRIP, FAN) or not isinstance(attributes, dict):
        return np.zeros((0, 3)), none
    positions = document.values(attributes.get("POSITION"), "VEC3", 3)
    if mode == POINTS:
        return positions, none
    order = np.arange(len(positions))
    if "indices" in primitive:
        with np.errstate(invalid="ignore"):  # what is no number is no vertex of the mesh either
            order = document.values(primitive["indices"], "SCALAR", 1).astype(np.int64).ravel()
    return positions, _triangles(order, mode)


def _triangles(order: Index, mode: int) -> Index:
    """Triangles (F, 3) of the vertices in this order."""
    if mode == TRIANGLES:
        if len(order) % 3:
            raise ValueError(f"{len(order):,} corners are no triangles of three")
        return order.reshape(-1, 3)
    if len(order) < 3:
        return np.zeros((0, 3), dtype=np.int64)
    if mode == FAN:
        first = np.full(len(order) - 2, order[0])
        return np.column_stack([first, order[1:-1], order[2:]])
    strip: Index = np.column_stack([order[:-2], order[1:-1], order[2:]])
    strip[1::2] = strip[1::2, [1, 0, 2]]
    a, b, c = strip.T
    area: Index = strip[(a != b) & (b != c) & (a != c)]  # the others lead from strip to strip
    return area


def _moved(positions: Array, motion: Array) -> Array:
    if np.array_equal(motion, np.eye(4)):
        return positions
    with np.errstate(all="ignore"):
        return np.asarray(positions @ motion[:3, :3].T + motion[:3, 3])
