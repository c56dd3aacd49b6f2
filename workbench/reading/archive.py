"""Reading arrays from .npz files that may be damaged or made to do harm.

Each array says its shape and type in its first bytes, so that these are checked before memory is
set aside for its numbers. Arrays of Python objects are never read: unpacking them runs code.

Functions here raise BadFile with the reason alone, as `weights has shape (3, 2), but must be
(N, K)`; `workbench.reading.damage.taken_for` makes it a sentence that names the file.
"""

import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from workbench.errors import BadFile
from workbench.reading.damage import damage, refuse_what_is_no_file, taken_for
from workbench.reading.npy import LONGEST_HEADER, Header, check_letters, header_of

AGAIN = "install the workbench again"
MOST_BYTES = 2 * 2**30  # of all arrays in one file; licensed models reach a quarter of a GB
# Deflation makes zeros a thousand times smaller, and conversion to float64 makes bytes eight times
# larger, so a file of 2 MB could ask for 16 GB. Real arrays hardly shrink by more than a few times.
FREE_BYTES = 2**29  # that the arrays of any file may take as float64
MOST_PER_BYTE = 16  # further bytes that they may take for each byte of the file
PIECE = 2**18  # bytes
LONGEST_READ = 2**21  # bytes; a directory takes about 80 for each array


class Archive:
    """The arrays in an open .npz file: all of their headers, and each array when it is asked for.

    Raises BadFile if the file is damaged, holds two members of one name, or asks for more memory
    than a file of its size should.

    Attributes:
        headers: the header of every array, by name.
        others: the names of members that are no arrays.
    """

    headers: Mapping[str, Header]
    others: tuple[str, ...]

    def __init__(self, archive: zipfile.ZipFile, size: int) -> None:
        self._archive, self.size = archive, size
        members = archive.infolist()
        if doubled := [name for name, n in Counter(m.filename for m in members).items() if n > 1]:
            raise BadFile(f"it holds two arrays called {doubled[0]}")
        self._members = {
            m.filename.removesuffix(".npy"): m for m in members if m.filename.endswith(".npy")
        }
        self._short: dict[str, bytes] = {}  # members whose first bytes are all, until they are read
        self.others = tuple(m.filename for m in members if not m.filename.endswith(".npy"))
        if not self._members:
            raise BadFile("it is a zip archive without arrays, not an .npz file")
        unpacked = sum(member.file_size for member in self._members.values())
        if unpacked > MOST_BYTES:
            raise BadFile(f"it unpacks to {unpacked / 2**30:.1f} GB; over 2 GB is not read")
        self._check_memory(unpacked)
        self.headers = {name: self._header(name) for name in self._members}
        self._check_memory(sum(h.widened for h in self.headers.values() if not h.dtype.hasobject))

    def array(self, name: str) -> NDArray[Any]:
        """One of the arrays, in the type that it has. Raises BadFile."""
        header = self.headers[name]
        if header.dtype.hasobject:
            raise BadFile(f"{name} is an array of Python objects, which are not read")
        with damage(name):
            content = np.empty(header.count * header.dtype.itemsize, dtype=np.uint8)
            if name in self._short:
                content[:] = np.frombuffer(self._short.pop(name), np.uint8)[header.start :]
            else:
                self._fill(content, name)
            array: NDArray[Any] = content.view(header.dtype)
            array = array.reshape(header.shape, order="F" if header.fortran else "C")
            if array.dtype.kind == "U":
                check_letters(array)
        return array

    def _check_memory(self, asked: int) -> None:
        if asked > FREE_BYTES + MOST_PER_BYTE * self.size:
            raise BadFile(
                f"it has {self.size / 2**20:.1f} MB, but its arrays take {asked / 2**30:.1f} GB in "
                "memory, as those of no ordinary file do; if you trust it, load it with numpy and "
                "save it with np.savez, which does not compress"
            )

    def _header(self, name: str) -> Header:
        member = self._members[name]
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise BadFile(f"{name} is compressed in another way than NumPy compresses arrays")
        with damage(name), self._archive.open(member) as stream:
            head = stream.read(LONGEST_HEADER)
            header = header_of(head)
            header.check(member.file_size)
        if member.file_size <= LONGEST_HEADER:
            self._short[name] = head
        return header

    def _fill(self, content: NDArray[np.uint8], name: str) -> None:
        """The numbers, a few at a time, so that they are in memory once."""
        at = 0
        with self._archive.open(self._members[name]) as stream:
            stream.read(self.headers[name].start)
            while at < len(content):
                piece = np.frombuffer(stream.read(PIECE), np.uint8)
                if not len(piece):
                    raise EOFError("it ends before its numbers do")
                content[at : at + len(piece)] = piece
                at += len(piece)


class _InPieces:
    """A file that gives no more than `LONGEST_READ` bytes at once.

    zipfile reads an archive's directory in one piece and makes an object of each of its entries,
    of which there may be as many as the file has bytes for; numbers it reads in small pieces.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file, self.seek, self.tell = file, file.seek, file.tell
        self.seekable, self.close = file.seekable, file.close

    def read(self, size: int = -1) -> bytes:
        """The next bytes; without a size zipfile asks for the last 64 kB alone."""
        if size > LONGEST_READ:
            raise BadFile(
                f"its directory of members takes {size / 2**20:.0f} MB, as no archive's does"
            )
        return self._file.read(size)


@contextmanager
def open_arrays(path: Path) -> Iterator[Archive]:
    """Open the arrays in an .npz file. Raises BadFile as Archive does."""
    refuse_what_is_no_file(path)
    with damage():
        file = path.open("rb")
    with file:
        with damage():
            archive = zipfile.ZipFile(_InPieces(file))
        with archive:
            yield Archive(archive, path.stat().st_size)


@contextmanager
def opened(path: str | Path, what: str, do: str) -> Iterator[Archive]:
    """The same; what is wrong with the file becomes a sentence: `PATH is no WHAT (REASON); DO`."""
    with taken_for(path, what, do), open_arrays(Path(path)) as archive:
        yield archive


@contextmanager
def shipped(name: str, what: str) -> Iterator[Archive]:
    """The arrays of a file of the workbench's own data, such as `poses/cmu_gaussian.npz`."""
    with as_file(files("workbench") / "data" / name) as path, opened(path, what, AGAIN) as archive:
        yield archive
