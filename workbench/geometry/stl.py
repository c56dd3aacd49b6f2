"""STL, binary or ascii: triangles that share no vertices."""

from array import array

import numpy as np

from workbench.arrays import Array, Index
from workbench.errors import shown
from workbench.geometry.polygons import text_lines

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
