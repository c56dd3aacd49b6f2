"""Arrays inside a page: little-endian, compressed by gzip, in base64."""

import gzip
from base64 import b64encode

import numpy as np
from numpy.typing import ArrayLike

KINDS = {
    "f4": "<f4",
    "f8": "<f8",
    "u2": "<u2",
    "u4": "<u4",
}  # as `unpacked` in arrays.js knows them


def packed(array: ArrayLike, kind: str) -> dict[str, str]:
    """An array, row by row, as `unpacked` in arrays.js reads it; `kind` is one of `KINDS`.

    >>> packed([1.0, 2.0], "f4")["kind"]
    'f4'
    """
    numbers = np.ascontiguousarray(array, dtype=KINDS[kind])
    compressed = gzip.compress(numbers.tobytes(), 9, mtime=0)
    return {"kind": kind, "gzip": b64encode(compressed).decode("ascii")}
