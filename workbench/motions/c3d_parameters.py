"""The header and the parameters of a C3D file, of all three kinds of processors.

The C3D File Format User Guide, Motion Lab Systems. Functions here raise ValueError with what is
wrong; they read nothing beyond the bytes that are there.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import prod

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array

BLOCK = 512  # bytes
PROCESSORS = {84: "<", 85: "dec", 86: ">"}
MOST_PARAMETERS = 10_000
Parameter = NDArray[np.float64] | tuple[str, ...]


@dataclass(frozen=True)
class Numbers:
    """How numbers are written: `<` as on Intel, `>` as on MIPS, or `dec`, with floats of a VAX."""

    kind: str

    @property
    def order(self) -> str:
        """The order of bytes of whole numbers."""
        return ">" if self.kind == ">" else "<"

    def words(self, content: bytes) -> NDArray[np.int64]:
        """Whole numbers of two bytes, with a sign."""
        return np.frombuffer(content, f"{self.order}i2").astype(np.int64)

    def floats(self, content: bytes) -> Array:
        """Numbers of four bytes. A VAX exchanges the two words of a float, and means a fourth."""
        if self.kind != "dec":
            with np.errstate(invalid="ignore"):
                return np.frombuffer(content, f"{self.order}f4").astype(np.float64)
        swapped = np.frombuffer(content, "<u2").reshape(-1, 2)[:, ::-1]
        with np.errstate(invalid="ignore"):
            found = np.ascontiguousarray(swapped).view("<f4").ravel().astype(np.float64) / 4
        return found


@dataclass(frozen=True)
class Header:
    """The first block: how many points, where the frames begin, and how they are scaled.

    Attributes:
        points: in each frame.
        analog: measurements of other devices in each frame.
        first: the number of the first frame.
        last: that of the last one, as far as it fits into two bytes.
        scale: from whole numbers to lengths; negative if the frames hold floats.
        start: the block in which the frames begin, counted from 1.
        rate: frames a second.
    """

    points: int
    analog: int
    first: int
    last: int
    scale: float
    start: int
    rate: float


def read_header(content: bytes) -> tuple[Header, Numbers, dict[str, Parameter]]:
    """The header, how numbers are written, and the parameters by name, such as POINT:LABELS."""
    if len(content) < BLOCK or content[1] != 0x50:
        raise ValueError("it does not begin as a C3D file does")
    at = (content[0] - 1) * BLOCK
    if not content[0] or len(content) < at + 4:
        raise ValueError("it ends before its parameters")
    if content[at + 3] not in PROCESSORS:
        raise ValueError(f"its processor has the number {content[at + 3]}, and there are 84 to 86")
    numbers = Numbers(PROCESSORS[content[at + 3]])
    unsigned = np.frombuffer(content[:BLOCK], f"{numbers.order}u2")
    header = Header(
        points=int(unsigned[1]),
        analog=int(unsigned[2]),
        first=int(unsigned[3]),
        last=int(unsigned[4]),
        scale=float(numbers.floats(content[12:16])[0]),
        start=int(unsigned[8]),
        rate=float(numbers.floats(content[20:24])[0]),
    )
    return header, numbers, _parameters(content, at + 4, numbers)


def _parameters(content: bytes, at: int, numbers: Numbers) -> dict[str, Parameter]:
    """Every parameter of every group. Groups are named after the parameters that belong to them."""
    groups: dict[int, str] = {}
    found: list[tuple[int, str, Parameter]] = []
    for _ in range(MOST_PARAMETERS):
        head = content[at : at + 2]
        if len(head) < 2 or not head[0]:
            break
        length, group = (abs(int(n)) for n in np.frombuffer(head, np.int8))
        own = np.frombuffer(head, np.int8)[1] > 0
        name = content[at + 2 : at + 2 + length].decode("latin-1").strip().upper()
        pointer = at + 2 + length
        if len(content) < pointer + 3:
            raise ValueError("it ends within its parameters")
        if own:
            found.append((group, name, _value(content, pointer + 2, numbers, name)))
        else:
            groups[group] = name
        step = int(numbers.words(content[pointer : pointer + 2])[0])
        if step == 0:
            break
        if step < 3:
            raise ValueError(f"the parameter {name[:30]!r} points back")
        at = pointer + step
    else:
        raise ValueError(f"it has more than {MOST_PARAMETERS:,} parameters")
    return {f"{groups.get(group, group)}:{name}": value for group, name, value in found}


def _value(content: bytes, at: int, numbers: Numbers, name: str) -> Parameter:
    """A parameter: numbers in one row, or texts, whose first dimension is their length."""
    if len(content) < at + 2:
        raise ValueError("it ends within its parameters")
    kind, dims = int(np.frombuffer(content[at : at + 1], np.int8)[0]), content[at + 1]
    shape = tuple(content[at + 2 : at + 2 + dims])
    width, count = abs(kind), prod(shape)
    data = content[at + 2 + dims : at + 2 + dims + width * count]
    if kind not in (-1, 1, 2, 4) or len(shape) < dims or len(data) < width * count or dims > 7:
        raise ValueError(f"the parameter {name[:30]!r} is damaged")
    match kind:
        case -1:
            long = shape[0] if shape else 1
            rows = [data[i : i + long] for i in range(0, len(data), long)] if long else []
            return tuple(
                row.decode("utf-8", errors="replace").replace("\0", " ").strip() for row in rows
            )
        case 1:
            return np.frombuffer(data, np.uint8).astype(np.float64)
        case 2:
            return numbers.words(data).astype(np.float64)
        case _:
            return numbers.floats(data)


def number_in(parameters: Mapping[str, Parameter], name: str) -> float | None:
    """The first number of a parameter; None if there is none."""
    value = parameters.get(name)
    if value is None or isinstance(value, tuple) or not value.size:
        return None
    return float(value[0])


def texts_in(parameters: Mapping[str, Parameter], name: str) -> tuple[str, ...]:
    """The texts of a parameter and of those that continue it: LABELS, LABELS2, LABELS3, ..."""
    found: list[str] = []
    more, n = parameters.get(name), 2
    while isinstance(more, tuple):
        found += more
        more, n = parameters.get(f"{name}{n}"), n + 1
    return tuple(found)
