"""glTF 2.0 in its binary form (.glb), written: arrays in one buffer, and the JSON that names them.

Khronos Group, glTF 2.0 Specification, sections 3.6 (buffers and accessors) and 4.4 (the file).
"""

import json
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

CODES = {"float32": 5126, "uint32": 5125, "uint16": 5123, "uint8": 5121}  # glTF's component types
KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
ATTRIBUTES, ELEMENTS = 34962, 34963  # what a buffer view is for


class Chunk:
    """The numbers of a file, and where each array is in them."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, array: ArrayLike, kind: str, target: int | None = None) -> int:
        """The number of the accessor of an array (n,) or (n, width), stored as `kind`."""
        rows = np.ascontiguousarray(array, dtype=kind)
        rows = rows.reshape(len(rows), -1)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": rows.nbytes}
        self.views.append(view | ({} if target is None else {"target": target}))
        self.data += rows.astype(rows.dtype.newbyteorder("<")).tobytes()
        self.data += bytes(-len(self.data) % 4)
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": CODES[kind],
                "count": len(rows),
                "type": KINDS[rows.shape[1]],
                "min": rows.min(axis=0).tolist(),
                "max": rows.max(axis=0).tolist(),
            }
        )
        return len(self.accessors) - 1

    def file(self, document: dict[str, Any]) -> bytes:
        """The file: a document without the arrays, and these arrays."""
        whole = document | {
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.data)}],
        }
        text = json.dumps(whole, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        parts = [(b"JSON", text), (b"BIN\0", bytes(self.data))]
        body = b"".join(len(p).to_bytes(4, "little") + kind + p for kind, p in parts)
        return b"glTF" + (2).to_bytes(4, "little") + (12 + len(body)).to_bytes(4, "little") + body
