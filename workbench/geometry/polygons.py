"""Polygons of mesh files as triangles, and the lines of such files, none of them endless."""

from collections.abc import Iterable, Iterator
from io import BytesIO, TextIOWrapper

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Index

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
