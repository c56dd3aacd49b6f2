"""One array as numpy writes it: its header is checked before anything else is read.

Functions here raise BadFile with the reason alone, as `weights has shape (3, 2), but must be
(N, K)`; `workbench.reading.damage.taken_for` makes it a sentence that names the file.
"""

import io
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.errors import BadFile
from workbench.reading.damage import damage, refuse_what_is_no_file

LONGEST_HEADER = 2**16  # bytes; numpy takes at most 10,000 characters
NUMBERS = "biuf"  # kinds of types that a reader may convert to float64
PER_LETTER = 4  # an empty list of JSON takes 3 letters of 4 bytes in the array, and 64 bytes read
LAST_LETTER = 0x10FFFF  # of Unicode


@dataclass(frozen=True)
class Header:
    """The header of an array, which is read before any of its numbers.

    Attributes:
        shape: its shape.
        dtype: the type of its numbers.
        fortran: whether the first index runs fastest.
        start: how many bytes of the file come before the numbers.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    fortran: bool
    start: int

    @property
    def count(self) -> int:
        """The number of entries of the array."""
        return prod(self.shape)

    @property
    def widened(self) -> int:
        """The bytes of the array in memory: numbers as float64, texts as Python's or as JSON."""
        size, kind = self.dtype.itemsize, self.dtype.kind
        return self.count * (max(size, 8) if kind in NUMBERS else PER_LETTER * size)

    def check(self, size: int) -> None:
        """Raise BadFile unless `size` bytes hold the array and nothing else."""
        # A type of no bytes, as <U0, would let any number of elements pass.
        if min(self.shape, default=1) < 0 or self.dtype.subdtype:
            raise BadFile(f"has the shape {self.shape} of {self.dtype}, which it cannot have")
        needed = self.start + self.count * max(1, self.dtype.itemsize)
        if needed > size and not self.dtype.hasobject:
            raise BadFile(f"claims {self.shape} numbers, but is shorter")
        if needed < size and not self.dtype.hasobject:
            raise BadFile(f"claims {self.shape} numbers, but is longer")


def header_of(head: bytes) -> Header:
    """From the first bytes of an .npy file; raises what numpy raises."""
    stream = io.BytesIO(head)
    version = np.lib.format.read_magic(stream)
    if version == (1, 0):
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    elif version in ((2, 0), (3, 0)):  # which differ in the encoding of names of columns
        shape, fortran, dtype = np.lib.format.read_array_header_2_0(stream)
    else:
        raise BadFile(f"is of version {version} of the format, which is not known")
    return Header(shape, dtype, fortran, stream.tell())


def widened(array: NDArray[Any]) -> Array:
    """Numbers as float64; a long double beyond its range becomes infinite.

    The order of axes in memory stays what it was: sums depend on it in their last digits.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # NaN of a file may be one that signals
        return np.asarray(array, dtype=np.float64)


def check_letters(array: NDArray[Any]) -> None:
    """Raise BadFile if an array of texts holds invalid characters, which Python does not check."""
    if array.size and array.itemsize:
        order = ">" if array.dtype.byteorder == ">" else "="
        letters = np.ascontiguousarray(array).reshape(-1).view(f"{order}u4")
        if letters.max() > LAST_LETTER:
            raise BadFile(f"holds the letter number {letters.max()}, and there are {LAST_LETTER}")
        if ((letters >= 0xD800) & (letters < 0xE000)).any():
            raise BadFile("holds half of a pair of surrogates, which is no letter")


def mapped_array(path: Path) -> NDArray[Any]:
    """The array in an .npy file, mapped into memory: only the parts that are used are read.

    Raises BadFile if it is damaged or an array of Python objects.
    """
    refuse_what_is_no_file(path)
    with damage():
        with path.open("rb") as file:
            header = header_of(file.read(LONGEST_HEADER))
        header.check(path.stat().st_size)
        if header.dtype.hasobject:
            raise BadFile("it is an array of Python objects, which are not read")
        if not header.count:  # nothing cannot be mapped
            return np.zeros(header.shape, header.dtype)
        order = "F" if header.fortran else "C"
        return np.memmap(path, header.dtype, "r", header.start, header.shape, order)  # type: ignore[call-overload,no-any-return]  # its stubs want one order literally
