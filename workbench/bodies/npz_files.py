"""Reading the arrays of an .npz file, never the Python objects that one can hide."""

import zipfile
import zlib
from collections import Counter
from math import prod
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from workbench.bodies.raw import MOST_BYTES, Raw, Unread
from workbench.errors import BadFile

DAMAGE = (
    *(zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError),
    *(NotImplementedError, RuntimeError, MemoryError),  # packed in a way, or with a password
)
OBJECTS = (
    "an array of Python objects, which are not read: unpacking them runs code of the file's "
    "choosing. Where you trust the file, load it there with allow_pickle=True and save "
    "this entry again as an array of numbers"
)

NO_ARRAY = "a file of another kind than .npy, which is not read"


def read_npz(path: Path) -> Raw:
    """The arrays of an .npz file by key; arrays of objects and other files in it are `Unread`.

    Raises BadFile if it is cut off or damaged, unpacks to over 2 GB, holds no arrays, or two of
    one name.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = [m for m in archive.infolist() if m.filename.endswith(".npy")]
            size = sum(member.file_size for member in members)
            if size > MOST_BYTES:
                raise BadFile(f"{path} unpacks to {size / 2**30:.1f} GB; over 2 GB is not read")
            if not members:
                raise BadFile(f"{path} is a zip archive without arrays, not an .npz file")
            names = Counter(member.filename for member in members)
            if names.most_common(1)[0][1] > 1:
                raise BadFile(f"{path} holds two arrays called {names.most_common(1)[0][0]}")
            others = {m.filename: Unread(NO_ARRAY) for m in archive.infolist() if m not in members}
            return others | {m.filename.removesuffix(".npy"): _read(archive, m) for m in members}
    except DAMAGE as error:
        raise BadFile(
            f"{path} is cut off or damaged ({error}); fetch or export it again"
        ) from error


def _read(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any] | Unread:
    with archive.open(member) as stream:
        shape, dtype = _header(stream)
    if dtype.hasobject:
        return Unread(OBJECTS)
    if prod(shape) * dtype.itemsize > member.file_size:  # before numpy sets memory aside for it
        raise ValueError(f"{member.filename} claims {shape} numbers, but is shorter")
    with archive.open(member) as stream:
        array: NDArray[Any] = np.lib.format.read_array(stream, allow_pickle=False)
    return array


def _header(stream: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of an .npy file, from its first bytes."""
    version = np.lib.format.read_magic(stream)
    if version == (1, 0):
        shape, _, dtype = np.lib.format.read_array_header_1_0(stream)
    else:
        shape, _, dtype = np.lib.format.read_array_header_2_0(stream)
    return shape, dtype
