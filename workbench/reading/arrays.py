"""Arrays in .npz and .npy files that may be damaged or made to do harm, and what they must hold.

Each array says its shape and type in its first bytes, so that these are checked before memory is
set aside for its numbers. Arrays of Python objects are never read: unpacking them runs code.

    EXPECTED = {"template": reals("N", 3), "faces": wholes("F", 3), "joint_names": texts("K")}

Letters stand for sizes that a file chooses; the same letter means the same size in all its arrays.
Functions here raise BadFile with the reason alone, as `weights has shape (3, 2), but must be
(N, K)`; `taken_for` makes it a sentence that names the file.
"""

import io
import struct
import tokenize
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.resources import as_file, files
from math import prod
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array, Index, Mask
from workbench.errors import BadFile, cut, listed

LONGEST_REASON = 400  # characters: what a file says may be as long as it likes
DAMAGE: tuple[type[Exception], ...] = (  # what zipfile and numpy's parser of headers raise
    *(zipfile.BadZipFile, zlib.error, EOFError, OSError, NotImplementedError, RuntimeError),
    *(struct.error, KeyError, IndexError, OverflowError, MemoryError),
    *(ValueError, SyntaxError, tokenize.TokenError, TypeError, AttributeError),
    Warning,  # where the caller turns warnings into errors
)


@contextmanager
def taken_for(path: str | Path, what: str, do: str) -> Iterator[None]:
    """Turn BadFile with a reason into BadFile with a sentence: `PATH is no WHAT (REASON); DO`.

    Where there is no such file, that is the sentence.
    """
    try:
        yield
    except BadFile as error:
        if isinstance(error.__cause__, FileNotFoundError):
            raise BadFile(f"there is no file {path}") from error
        raise BadFile(f"{path} is no {what} ({cut(error, LONGEST_REASON)}); {do}") from error


@contextmanager
def damage(name: str = "") -> Iterator[None]:
    """Turn whatever NumPy and zipfile raise for a damaged file into BadFile with the reason.

    `name` is the array that was being read.
    """
    try:
        yield
    except BadFile as error:
        raise BadFile(f"{name} {error}" if name else str(error)) from error.__cause__
    except DAMAGE as error:
        message = getattr(error, "strerror", None) or str(error) or type(error).__name__
        reason = cut(message, LONGEST_REASON)
        raise BadFile(f"{name}: {reason}" if name else reason) from error


def refuse_what_is_no_file(path: Path) -> None:
    """Raise BadFile for a pipe, which might never send anything, a folder or an endless device."""
    with damage():
        exists, is_file = path.exists(), path.is_file()
    if exists and not is_file:
        raise BadFile("it is no file but a folder, a pipe or a device")


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
        least = 1 if self.dtype.hasobject else max(1, self.dtype.itemsize)  # a pickle's are unknown
        needed = self.start + self.count * least
        if needed > size:
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


AGAIN = "install the workbench again"
MOST_BYTES = 2 * 2**30  # of all arrays in one file; licensed models reach a quarter of a GB
# Deflation makes zeros a thousand times smaller, and conversion to float64 makes bytes eight times
# larger, so a file of 2 MB could ask for 16 GB. Real arrays hardly shrink by more than a few times.
FREE_BYTES = 2**29  # that the arrays of any file may take as float64
MOST_PER_BYTE = 16  # further bytes that they may take for each byte of the file
PIECE_BYTES = 2**18  # bytes
LONGEST_DIRECTORY = 2**21  # bytes; a directory takes about 80 for each array


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
            self._fill(content, name)
            array: NDArray[Any] = content.view(header.dtype)
            array = array.reshape(header.shape, order="F" if header.fortran else "C")
            if array.dtype.kind == "U":
                check_letters(array)
        return array

    def pickled(self, name: str) -> bytes:
        """The pickle that an array of Python objects is in a file; nothing of it is run."""
        member = self._members[name]
        with damage(name):
            content = np.empty(member.file_size - self.headers[name].start, dtype=np.uint8)
            self._fill(content, name)
        return content.tobytes()

    def _check_memory(self, taken: int) -> None:
        if taken > FREE_BYTES + MOST_PER_BYTE * self.size:
            raise BadFile(
                f"it has {self.size / 2**20:.1f} MB, but its arrays take {taken / 2**30:.1f} GB in "
                "memory, as those of no ordinary file do; if you trust it, load it with numpy and "
                "save it with np.savez, which does not compress"
            )

    def _header(self, name: str) -> Header:
        member = self._members[name]
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise BadFile(f"{name} is compressed in another way than NumPy compresses arrays")
        with damage(name), self._archive.open(member) as stream:
            header = header_of(stream.read(LONGEST_HEADER))
            header.check(member.file_size)
        return header

    def _fill(self, content: NDArray[np.uint8], name: str) -> None:
        """The numbers, a few at a time, so that they are in memory once."""
        n_read = 0
        with self._archive.open(self._members[name]) as stream:
            stream.read(self.headers[name].start)
            while n_read < len(content):
                piece = np.frombuffer(stream.read(PIECE_BYTES), np.uint8)
                if not len(piece):
                    raise EOFError("it ends before its numbers do")
                content[n_read : n_read + len(piece)] = piece
                n_read += len(piece)


class _InPieces:
    """A file that gives no more than `LONGEST_DIRECTORY` bytes at once."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self.seek, self.tell = file, file.seek, file.tell
        self.seekable, self.close = file.seekable, file.close

    def read(self, size: int = -1) -> bytes:
        """The next bytes; without a size zipfile asks for the last 64 kB alone."""
        if size > LONGEST_DIRECTORY:
            raise BadFile(
                f"its directory of members takes {size / 2**20:.0f} MB, as no archive's does"
            )
        return self._file.read(size)


@contextmanager
def open_zip(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open a zip archive, whose directory is read in pieces. Raises BadFile if it is damaged."""
    refuse_what_is_no_file(path)
    with damage():
        file = path.open("rb")
    with file:
        with damage():
            archive = zipfile.ZipFile(_InPieces(file))
        with archive:
            yield archive


@contextmanager
def open_arrays(path: Path) -> Iterator[Archive]:
    """Open the arrays in an .npz file. Raises BadFile as Archive does."""
    with open_zip(path) as archive:
        yield Archive(archive, path.stat().st_size)


@contextmanager
def opened(path: str | Path, what: str, do: str) -> Iterator[Archive]:
    """As `open_arrays`, with errors that are sentences: `PATH is no WHAT (REASON); DO`."""
    with taken_for(path, what, do), open_arrays(Path(path)) as archive:
        yield archive


@contextmanager
def shipped(name: str, what: str) -> Iterator[Archive]:
    """The arrays of a file of the workbench's own data, such as `poses/cmu_gaussian.npz`."""
    with as_file(files("workbench") / "data" / name) as path, opened(path, what, AGAIN) as archive:
        yield archive


Size = int | str
MOST_EXACT = 2**53  # beyond, whole numbers have no exact float64, and nothing is counted that far


@dataclass(frozen=True)
class Kind:
    """What the elements of an array must be. A kind is called with a shape: `reals("N", 3)`.

    Attributes:
        elements: what the elements are, for error messages.
        types: the types that a file may have, as numpy writes them without the order of bytes,
            such as `f8`.
        read: converts an array of the file to the type that is promised; raises BadFile.
    """

    elements: str
    types: frozenset[str]
    read: Callable[[NDArray[Any]], NDArray[Any]]

    def __call__(self, *shape: Size) -> "Expected":
        """The expectation that an array of a file has such elements, and this shape."""
        return Expected(self, shape)


@dataclass(frozen=True)
class Expected:
    """The kind and the shape that an array of a file must have.

    Attributes:
        kind: what its elements are.
        shape: its shape, with a letter for each size that the file chooses.
        optional: whether a file may lack it.
    """

    kind: Kind
    shape: tuple[Size, ...]
    optional: bool = False


def optional(expected: Expected) -> Expected:
    """The array may be missing; if it is there, it must be what is expected."""
    return replace(expected, optional=True)


def read_expected(archive: Archive, expected: Mapping[str, Expected]) -> dict[str, NDArray[Any]]:
    """The expected arrays by name, all headers being compared before any array is read.

    Other arrays are not read. Raises BadFile, which names what is missing or the array that has
    another kind or shape.
    """
    headers = archive.headers
    if objects := [n for n in expected if n in headers and headers[n].dtype.hasobject]:
        raise BadFile(f"{listed(objects)} needs allow_pickle, which would run code of the file")
    missing = [n for n, one in expected.items() if n not in headers and not one.optional]
    if missing:
        raise BadFile(f"{listed(missing)} missing; it holds {listed(headers)}")
    sizes: dict[str, tuple[int, str]] = {}
    present = {name: one for name, one in expected.items() if name in headers}
    for name, one in present.items():
        _compare(name, headers[name], one, sizes)
    arrays = {}
    for name, one in present.items():
        try:
            arrays[name] = one.kind.read(archive.array(name))
        except BadFile as error:
            reason = str(error)
            raise BadFile(reason if reason.startswith(name) else f"{name} {reason}") from error
    return arrays


def nothing_else(archive: Archive, expected: Iterable[str]) -> None:
    """Raise BadFile if a file of the workbench's own holds an array that it never writes."""
    others = [*(archive.headers.keys() - set(expected)), *archive.others]
    if others:
        raise BadFile(f"it also holds {listed(others)}, which do not belong there")


def check_numbers(name: str, numbers: Index, end: int) -> None:
    """Raise BadFile unless all numbers lie between 0 and `end` - 1."""
    if numbers.size and not 0 <= numbers.min() <= numbers.max() < end:
        raise BadFile(f"{name} holds {numbers.min()} to {numbers.max()}, not 0 to {end - 1} alone")


def _compare(
    name: str, header: Header, expected: Expected, sizes: dict[str, tuple[int, str]]
) -> None:
    """Raise BadFile unless a header says what is expected."""
    kind, shape = f"{header.dtype.kind}{header.dtype.itemsize}", header.shape
    empty = expected.kind is texts and kind == "f8" and not header.count  # as numpy writes []
    if not empty and kind not in expected.kind.types and kind[0] not in expected.kind.types:
        raise BadFile(f"{name} holds {header.dtype}, but must hold {expected.kind.elements}")
    sizes_so_far = [
        f"{letter} = {sizes[letter][0]}, as in {sizes[letter][1]}"
        for letter in dict.fromkeys(expected.shape)
        if isinstance(letter, str) and letter in sizes
    ]
    fits = len(shape) == len(expected.shape) and all(
        size == (sizes.setdefault(letter, (size, name))[0] if isinstance(letter, str) else letter)
        for size, letter in zip(shape, expected.shape, strict=True)
    )
    if not fits:
        raise BadFile(
            f"{name} has shape {shape}, but must be {str(expected.shape).replace(chr(39), '')}"
            f"{' with ' if sizes_so_far else ''}{' and '.join(sizes_so_far)}"
        )


def _finite(array: NDArray[Any]) -> Array:
    finite = np.isfinite(array)
    if not finite.all():
        index = np.unravel_index(int(finite.argmin()), array.shape)
        raise BadFile(f"is {array[index]} at {[int(i) for i in index]}, but must be finite")
    return widened(array)


def _counted(array: NDArray[Any]) -> Index:
    if array.size and not -MOST_EXACT <= int(array.min()) <= int(array.max()) <= MOST_EXACT:
        raise BadFile(f"holds numbers from {array.min()} to {array.max()}, which count nothing")
    return array.astype(np.int64)


def _true(array: NDArray[Any]) -> Mask:
    return array.astype(np.bool_)  # a byte of a file may hold more than 0 and 1


def _written(array: NDArray[Any]) -> NDArray[np.str_]:
    return array if array.size else np.zeros(array.shape, dtype=np.str_)


# Numbers may be NaN or infinite only where the name says so. Files that the workbench alone writes
# hold float64. Whole numbers have any size and sign and are read as int64.
reals = Kind("real numbers, float32 or float64", frozenset({"f4", "f8"}), _finite)
any_reals = Kind(reals.elements, reals.types, widened)
doubles = Kind("float64", frozenset({"f8"}), _finite)
doubles_or_nan = Kind("float64", frozenset({"f8"}), widened)
wholes = Kind("whole numbers, int or uint", frozenset("iu"), _counted)
truths = Kind("true or false", frozenset("b"), _true)
texts = Kind("texts", frozenset("U"), _written)
