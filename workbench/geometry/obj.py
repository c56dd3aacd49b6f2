"""Wavefront OBJ: positions and faces in the file's own order, whatever else it holds.

Readers made for drawing split a vertex wherever its texture or normal changes, and so lose the
order that registered meshes agree on. This one reads `v` and `f` and nothing else.
"""

from array import array
from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from workbench.arrays import Array, Index
from workbench.errors import shown


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
