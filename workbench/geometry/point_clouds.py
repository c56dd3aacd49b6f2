"""Point clouds in files: PCD of the Point Cloud Library, and text with a point in each line.

The header of a .pcd says how many points there are and what each holds. It is believed only as far
as the file has bytes for it. (Point Cloud Library, The PCD file format, version 0.7; the
compression is LZF, by Marc Lehmann.)
"""

from dataclasses import dataclass
from itertools import chain, islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.errors import cut, shown
from workbench.geometry.meshes import text_lines

LONGEST_HEADER = 2**16
TYPES = {f"{kind}{size}": f"<{kind.lower()}{size}" for kind in "IU" for size in (1, 2, 4, 8)} | {
    "F4": "<f4",
    "F8": "<f8",
}
KINDS = ("ascii", "binary", "binary_compressed")
POSITION, NORMAL = ("x", "y", "z"), ("normal_x", "normal_y", "normal_z")
PADDING = "_"  # the name of bytes that mean nothing
LARGEST_RATIO = 264 / 3  # LZF makes at most 264 bytes of 3
MOST_BYTES = 2**31  # of the points, once they are unpacked
RUN = 32  # control bytes below it are followed by bytes to take as they are


@dataclass(frozen=True, eq=False)
class PointCloudFile:
    """What a .pcd file holds, in the file's own unit and axes; numbers may be NaN.

    Attributes:
        points: (N, 3).
        normals: (N, 3) of any length, or None.
        viewpoint: (3,), from where the points were seen; None if the file does not say, or says
            0 0 0, which is what programs write that do not know it.
        unread: the names of the other fields.
    """

    points: Array
    normals: Array | None
    viewpoint: Array | None
    unread: tuple[str, ...]


@dataclass(frozen=True)
class _Header:
    fields: tuple[tuple[str, str, int], ...]  # name, type, and numbers in a point
    n_points: int
    viewpoint: Array | None
    kind: str
    start: int  # of the data

    @property
    def sizes(self) -> list[int]:
        """The bytes of each field in a point."""
        return [np.dtype(kind).itemsize * count for _, kind, count in self.fields]

    def places(self, names: tuple[str, ...]) -> list[int]:
        """Which fields have these names, if each is there once and one number; otherwise none."""
        named = [field[0] for field in self.fields]
        places = [named.index(name) for name in names if named.count(name) == 1]
        single = len(places) == len(names) and all(self.fields[k][2] == 1 for k in places)
        return places if single else []

    def checked_bytes(self, present: int, most: float = np.inf) -> int:
        """Of all points in binary. Raises ValueError where fewer are there."""
        claimed = self.n_points * sum(self.sizes)
        if claimed > min(present, most):
            raise ValueError(
                f"its header claims {shown(self.n_points)} points, and there are {present:,} bytes "
                "for them"
            )
        return claimed


def parse_pcd(content: bytes) -> PointCloudFile:
    """Points, and normals and viewpoint if the file has them. Raises ValueError with the reason."""
    header = _header(content)
    position, normal = header.places(POSITION), header.places(NORMAL)
    if not position:
        names = ", ".join(shown(name) for name, *_ in header.fields[:10])
        raise ValueError(
            f"its points have no x, y and z, one number each, but {names or 'nothing'}"
        )
    read = {"ascii": _in_text, "binary": _in_rows, "binary_compressed": _in_columns}[header.kind]
    with np.errstate(invalid="ignore"):  # NaN that signals is refused later, as other NaN
        columns = read(content, header, position + normal)
        numbers = np.column_stack(columns).astype(np.float64)
    read_fields = (*POSITION, *(NORMAL if normal else ()), PADDING)
    unread = tuple(dict.fromkeys(name for name, *_ in header.fields if name not in read_fields))
    points = np.ascontiguousarray(numbers[:, :3])
    return PointCloudFile(points, numbers[:, 3:] if normal else None, header.viewpoint, unread)


def _in_text(content: bytes, header: _Header, places: list[int]) -> list[NDArray[Any]]:
    """A point in each line."""
    firsts = np.cumsum([0, *(count for *_, count in header.fields)])
    lines = (line for line in text_lines(content[header.start :]) if line.strip())
    rows, numbers = list(islice(lines, 1)), np.zeros((0, len(places)))
    if rows:
        points = islice(chain(rows, lines), min(header.n_points, len(content)) + 1)
        numbers = np.loadtxt(points, usecols=firsts[places].tolist(), ndmin=2, comments=None)
    if len(numbers) != header.n_points:
        follow = "more" if len(numbers) > header.n_points else f"{len(numbers):,}"
        raise ValueError(f"its header says {header.n_points:,} POINTS, but {follow} follow")
    return [*numbers.T]


def _in_rows(content: bytes, header: _Header, places: list[int]) -> list[NDArray[Any]]:
    """Point after point."""
    header.checked_bytes(len(content) - header.start)
    fields = [(str(k), kind, (count,)) for k, (_, kind, count) in enumerate(header.fields)]
    rows = np.frombuffer(content, fields, header.n_points, header.start)
    return [rows[str(k)][:, 0] for k in places]


def _in_columns(content: bytes, header: _Header, places: list[int]) -> list[NDArray[Any]]:
    """Compressed, field after field."""
    sizes = np.frombuffer(content[header.start : header.start + 8], "<u4").tolist()
    packed = content[header.start + 8 :]
    if len(sizes) < 2 or sizes[0] > len(packed):
        raise ValueError("its compressed points are cut off")
    claimed = header.checked_bytes(sizes[1], min(LARGEST_RATIO * sizes[0], MOST_BYTES))
    unpacked = unpacked_lzf(packed[: sizes[0]], claimed)
    starts = np.cumsum([0, *(header.n_points * size for size in header.sizes)]).tolist()
    kinds = [kind for _, kind, _ in header.fields]
    return [np.frombuffer(unpacked, kinds[k], header.n_points, starts[k]) for k in places]


def unpacked_lzf(packed: bytes, size: int) -> bytes:
    """The `size` bytes that LZF packed. Raises ValueError if there are more or fewer of them.

    A byte c below 32 says that the next c + 1 bytes are to be taken as they are. Any other repeats
    what was unpacked before: its upper three bits are a length, to which the next byte is added if
    they are 7, and its lower five bits are the upper part of how far back it begins. The lower part
    is the byte that follows. The length is two more than said, and the distance one more.

    >>> unpacked_lzf(bytes([2, 97, 98, 99, 4 << 5, 2]), 9)
    b'abcabcabc'
    """
    unpacked, position, end = bytearray(), 0, len(packed)
    while position < end and len(unpacked) <= size:
        control, position = packed[position], position + 1
        if control < RUN:
            unpacked += packed[position : position + control + 1]
            position += control + 1
            continue
        length, distance = control >> 5, (control & 31) << 8
        if position + (2 if length == 7 else 1) > end:
            break
        if length == 7:
            length, position = length + packed[position], position + 1
        distance, position = distance + packed[position] + 1, position + 1
        if distance > len(unpacked):
            raise ValueError("its compressed points repeat what is before their beginning")
        length += 2
        piece = bytes(unpacked[len(unpacked) - distance :][:length])
        unpacked += (piece * (-(-length // distance)))[:length]  # it may repeat itself
    if len(unpacked) != size or position != end:
        raise ValueError(f"its compressed points are not {size:,} bytes long")
    return bytes(unpacked)


def _header(content: bytes) -> _Header:
    header: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in header:
        end = content.find(b"\n", start, LONGEST_HEADER)
        if end < 0:
            raise ValueError("it has no header that ends in a line with DATA")
        line, start = content[start:end].decode("latin1"), end + 1
        match line.split():
            case []:
                pass
            case [word, *_] if word.startswith("#"):
                pass
            case [word, *values] if word.isupper() and word not in header:
                header[word] = values
            case _:
                raise ValueError(f"its header says {shown(line)}")
    kind = header["DATA"][0] if header["DATA"] else ""
    if kind not in KINDS:
        raise ValueError(f"its data are {shown(kind)}, which is none of {', '.join(KINDS)}")
    viewpoint = _viewpoint(header.get("VIEWPOINT", []))
    return _Header(_fields(header), _count(header), viewpoint, kind, start)


def _fields(header: dict[str, list[str]]) -> tuple[tuple[str, str, int], ...]:
    names = header.get("FIELDS", [])
    sizes, types = header.get("SIZE", []), header.get("TYPE", [])
    counts = header.get("COUNT", ["1"] * len(names))
    if not names or not len(names) == len(sizes) == len(types) == len(counts):
        raise ValueError(
            f"its header has {len(names)} FIELDS, {len(sizes)} SIZE, {len(types)} TYPE and "
            f"{len(counts)} COUNT, which should be as many"
        )
    fields = []
    for name, size, kind, count in zip(names, sizes, types, counts, strict=True):
        if kind + size not in TYPES:
            raise ValueError(f"field {shown(name)} is of type {shown(kind)} and size {shown(size)}")
        fields.append((name, TYPES[kind + size], _whole(count, "COUNT")))
    return tuple(fields)


def _count(header: dict[str, list[str]]) -> int:
    sizes = [_whole(header[word][0], word) for word in ("WIDTH", "HEIGHT") if header.get(word)]
    points = header.get("POINTS", [])
    if not points and len(sizes) < 2:
        raise ValueError("its header does not say how many POINTS there are")
    n_points = _whole(points[0], "POINTS") if points else sizes[0] * sizes[1]
    if len(sizes) == 2 and sizes[0] * sizes[1] != n_points:
        across, down = sizes
        raise ValueError(
            f"its header says {n_points:,} POINTS, but {across:,} times {down:,} (WIDTH, HEIGHT)"
        )
    return n_points


def _whole(word: str, what: str) -> int:
    if not (word.isascii() and word.isdecimal() and len(word) < 16):
        raise ValueError(f"its header has {what} {shown(word)}")
    return int(word)


def _viewpoint(words: list[str]) -> Array | None:
    """Where the points were seen from (3,); the rotation that follows is not needed for that."""
    try:
        place = np.array([float(word) for word in words[:3]])
    except ValueError:
        raise ValueError(f"its header has the viewpoint {cut(' '.join(words), 60)}") from None
    return place if len(place) == 3 and place.any() else None


MOST_HEAD = 20  # lines before the first point: titles of columns, or how many points there are
MOST_COLUMNS = 6  # that are read; what follows, colours and intensities, is left in the file
COMMENTS = ("#", "//")
SEPARATORS = (";", ",")  # otherwise blanks


def parse_xyz(content: bytes) -> tuple[Array, int]:
    """The first columns (N, 3) to (N, 6) of all lines, and how many columns the first line has.

    Lines before the first point that hold no three numbers are passed over, at most 20. Between
    semicolons, a comma is a decimal point. Raises ValueError with what is wrong.
    """
    lines = (_decimal_points(line) for line in text_lines(content) if line.strip())
    head = list(islice(lines, MOST_HEAD + 1))
    start = next((i for i, line in enumerate(head) if len(_leading_numbers(line)) >= 3), None)
    if start is None:
        first = shown(head[0].strip()) if head else "nothing"
        raise ValueError(f"its first lines hold no x, y and z; the first is {first}")
    columns, words = len(_leading_numbers(head[start])), _words(head[start])
    rows = (line for line in chain(head[start:], lines) if not line.lstrip().startswith(COMMENTS))
    read = range(min(columns, MOST_COLUMNS))
    try:
        numbers = np.loadtxt(
            rows, delimiter=_separator(head[start]), usecols=read, ndmin=2, comments=None
        )
    except ValueError as error:
        raise ValueError(f"after line {start + 1}: {cut(error)}") from error
    return np.asarray(numbers, dtype=np.float64), len(words)


def _decimal_points(line: str) -> str:
    return line.replace(",", ".") if line.count(";") > 1 else line


def _separator(line: str) -> str | None:
    return next((mark for mark in SEPARATORS if mark in line), None)


def _words(line: str) -> list[str]:
    words = line.split(_separator(line))
    return words if words and words[-1].strip() else words[:-1]


def _leading_numbers(line: str) -> list[float]:
    """The numbers with which a line begins; nothing if it is a comment."""
    numbers: list[float] = []
    for word in _words(line):
        try:
            numbers.append(float(word))
        except ValueError:
            break
    return numbers
