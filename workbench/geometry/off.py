"""Object File Format (.off): positions and polygons, in lines.

What follows a position in its line, texture coordinates, colour and normal, is left in the file.
"""

from array import array
from collections.abc import Iterator

import numpy as np

from workbench.arrays import Array, Index
from workbench.errors import shown
from workbench.geometry.polygons import fans, text_lines, vertex_numbers

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
