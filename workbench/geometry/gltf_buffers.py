"""A glTF 2.0 file taken apart: one .glb, or a .gltf of text with buffers beside it.

A buffer is the binary part of a .glb, text in base64, or another file. Other files are opened only
if the caller names the folder of the text, and only in this folder or below it; a file that says
where its numbers are must not make a reader open whatever is on the machine or on the web. (Khronos
Group, glTF 2.0 Specification, sections GLB File Format and URIs.)
"""

import base64
import binascii
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

from workbench.errors import shown
from workbench.geometry.glb_document import GlbDocument, several, whole
from workbench.reading.facts import bounded, parsed

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
    if content[:4] != MAGIC:
        _check_version(json)
    beside = _Beside(folder)
    buffers = several(json, "buffers")
    return GlbDocument(json, [_bytes(b, k, chunks, beside) for k, b in enumerate(buffers)])


def _check_version(json: dict[str, Any]) -> None:
    """Raises ValueError for text of another version, whose lists are objects."""
    asset = json.get("asset")
    version = asset.get("version") if isinstance(asset, dict) else None
    if not isinstance(version, str) or not version.startswith("2."):
        raise ValueError(f"its asset says version {shown(version)}, and glTF 2.0 is read")


def _chunks(content: bytes) -> dict[bytes, bytes]:
    """The parts of a .glb by their kind."""
    chunks: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= len(content):
        length, kind = int.from_bytes(content[at : at + 4], "little"), content[at + 4 : at + 8]
        if at + 8 + length > len(content):
            raise ValueError(f"a part of {length:,} bytes is cut off")
        if kind in (JSON, BINARY):  # others are to be passed over
            chunks.setdefault(kind, content[at + 8 : at + 8 + length])
        at += 8 + length
    return chunks


def _bytes(
    buffer: dict[str, Any], number: int, chunks: dict[bytes, bytes], beside: "_Beside"
) -> bytes:
    """What a buffer holds."""
    uri, name = buffer.get("uri"), f"buffers[{number}]"
    if uri is None:
        return chunks.get(BINARY, b"") if number == 0 else b""
    head, _, text = uri.partition("base64,") if isinstance(uri, str) else ("", "", "")
    if not head.startswith("data:"):
        return beside.read(uri, name, whole(buffer, "byteLength", 0))
    try:
        return base64.b64decode(text)
    except binascii.Error as error:
        raise ValueError(f"{name} is no base64 ({error})") from error


class _Beside:
    """The files of a folder that buffers name: each is read once; all have one limit together."""

    def __init__(self, folder: Path | None) -> None:
        self.folder, self.known, self.room = folder, dict[Path, bytes](), MOST_BYTES

    def read(self, uri: Any, name: str, length: int) -> bytes:
        """The bytes of the file that a URI names."""
        if self.folder is None:
            raise ValueError(
                f"{name} is in another file, {shown(uri)}, which is not opened; export the "
                "mesh as one .glb"
            )
        path = self._path(uri, name)
        if path not in self.known:
            try:
                content = bounded(path, self.room)
            except OSError as error:
                raise ValueError(f"{name} is in {shown(uri)}, which cannot be read") from error
            self.room -= len(content)
            self.known[path] = content
        if length > len(self.known[path]):
            raise ValueError(
                f"{name} has {length:,} bytes, and its file {shown(uri)} {len(self.known[path]):,}"
            )
        return self.known[path]

    def _path(self, uri: Any, name: str) -> Path:
        """The file in the folder or below it."""
        assert self.folder is not None
        inside = unquote(uri) if isinstance(uri, str) else ""
        parts = PurePosixPath(inside).parts
        strange = set(":\\\0") & set(inside)
        if not parts or inside.startswith("/") or ".." in parts or strange or len(inside) > 1000:
            raise ValueError(
                f"{name} is said to be in {shown(uri)}, and only files in the folder of the .gltf, "
                "or below it, are opened; put the file there"
            )
        home = self.folder.resolve()
        path = home.joinpath(*parts).resolve()
        if not path.is_relative_to(home):  # a link that leads elsewhere
            raise ValueError(f"{name} is in {shown(uri)}, which leads out of the file's folder")
        if not path.is_file():
            raise ValueError(
                f"{name} is in the file {shown(uri)}, which is not in the folder; keep both "
                "together"
            )
        return path
