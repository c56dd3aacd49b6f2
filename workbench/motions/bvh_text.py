"""The text of a BVH file (Biovision): a hierarchy of joints, and a row of numbers for each frame.

Meredith and Maddock, Motion Capture File Formats Explained, 2001. Functions here raise ValueError
with what is wrong.
"""

from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from workbench.arrays import Array
from workbench.errors import shown
from workbench.geometry.meshes import text_lines

CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")
MOST_JOINTS = 10_000
MOST_NUMBERS = 20_000_000  # of all frames together
LARGEST = 1e9  # of any length or angle


@dataclass
class BvhText:
    """What a BVH file says, in its own units: lengths, and degrees.

    Attributes:
        names: of its K joints, as written.
        parents: (K,) of each joint, -1 for the root.
        offsets: (K, 3) from the parent.
        channels: of each joint, in the order of its numbers in a row, such as Zrotation.
        end_parents: of each end site.
        end_offsets: (E, 3).
        frame_time: as written, in s.
        rows: (T, C), a number for each channel.
    """

    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[list[float]] = field(default_factory=list)
    channels: list[tuple[str, ...]] = field(default_factory=list)
    end_parents: list[int] = field(default_factory=list)
    end_offsets: list[list[float]] = field(default_factory=list)
    frame_time: str = ""
    rows: Array = field(default_factory=lambda: np.zeros((0, 0)))


def parse_bvh(content: bytes) -> BvhText:
    """The hierarchy and the motion of a BVH file. Raises ValueError."""
    found = BvhText()
    lines = _lines(content)
    _hierarchy(lines, found)
    _motion(lines, found)
    return found


def _lines(content: bytes) -> Iterator[tuple[int, str]]:
    """Lines that are not empty, with their numbers; a brace is a line of its own."""
    for number, line in enumerate(text_lines(content), start=1):
        for part in line.replace("{", "\n{\n").replace("}", "\n}\n").split("\n"):
            if part.strip():
                yield number, part.strip()


def _hierarchy(lines: Iterator[tuple[int, str]], found: BvhText) -> None:
    """Read up to the line MOTION."""
    open_now: list[int | None] = []  # the joints around a line; None is an end site
    begun: int | None = None  # the joint whose brace is still to come
    waiting, _complete = False, [False]
    number, line = next(lines, (0, ""))
    if line.upper() != "HIERARCHY":
        raise ValueError(f"it begins with {shown(line)}, and not with HIERARCHY")
    for number, line in lines:
        word, _, rest = line.partition(" ") if " " in line else line.partition("\t")
        match word.upper():
            case "{" if waiting:
                open_now.append(begun)
                waiting = False
            case "}" if open_now and not waiting:
                _check_closed(open_now.pop(), found, number)
            case "MOTION" if found.names and not open_now and not waiting:
                return
            case "ROOT" if not found.names and not waiting:
                begun, waiting = _joint(rest, -1, found), True
            case "ROOT" if not open_now:
                raise ValueError(f"line {number} begins a second skeleton; split the file")
            case "JOINT" if open_now and open_now[-1] is not None and not waiting:
                begun, waiting = _joint(rest, open_now[-1], found), True
            case "END" if open_now and open_now[-1] is not None and not waiting:
                found.end_parents.append(open_now[-1])
                begun, waiting = None, True
            case "OFFSET" if open_now and not waiting:
                owner = found.end_offsets if open_now[-1] is None else found.offsets
                count = len(found.end_parents) if open_now[-1] is None else open_now[-1] + 1
                if len(owner) != count - 1:
                    raise ValueError(f"line {number} gives an offset where none is expected")
                owner.append(_numbers(rest.split(), 3, number))
            case "CHANNELS" if open_now and open_now[-1] is not None and not waiting:
                if len(found.channels) != open_now[-1]:
                    raise ValueError(f"line {number} gives channels where none are expected")
                found.channels.append(_channels(rest.split(), number))
            case _:
                raise ValueError(f"line {number} is {shown(line)}, which is not expected there")
    raise ValueError(f"its hierarchy is not closed, or no MOTION follows, up to line {number}")


def _joint(name: str, parent: int, found: BvhText) -> int:
    k = len(found.names)
    if k >= MOST_JOINTS:
        raise ValueError(f"it has more than {MOST_JOINTS:,} joints")
    if parent >= 0 and (len(found.offsets) != k or len(found.channels) != k):
        raise ValueError(f"the joint {shown(found.names[k - 1])} has no OFFSET or no CHANNELS")
    found.names.append(" ".join(rest for rest in name.split()) or f"joint_{k}")
    found.parents.append(parent)
    return k


def _check_closed(joint: int | None, found: BvhText, number: int) -> None:
    if joint is None and len(found.end_offsets) != len(found.end_parents):
        raise ValueError(f"the end site that ends at line {number} has no OFFSET")
    if joint is not None and min(len(found.offsets), len(found.channels)) != len(found.names):
        raise ValueError(f"the joint {shown(found.names[-1])} has no OFFSET or no CHANNELS")


def _channels(words: list[str], number: int) -> tuple[str, ...]:
    by_name = {name.lower(): name for name in CHANNELS}
    known = tuple(by_name.get(word.lower(), "") for word in words[1:])
    if not words or words[0] != str(len(known)) or not all(known) or len(known) > 6:
        raise ValueError(
            f"line {number} has the channels {shown(' '.join(words))}; they are a count of up to "
            "6 and as many of Xposition, Yposition, Zposition, Xrotation, Yrotation, Zrotation"
        )
    if len({*known}) < len(known):
        raise ValueError(f"line {number} has the same channel twice")
    return known


def _motion(lines: Iterator[tuple[int, str]], found: BvhText) -> None:
    _, line = next(lines, (0, ""))
    word, _, count = line.partition(":")
    if word.strip().lower() != "frames" or not count.strip().isdecimal() or len(count) > 12:
        raise ValueError(f"after MOTION comes {shown(line)}, and not the number of Frames")
    number, line = next(lines, (0, ""))
    word, _, found.frame_time = line.partition(":")
    if [part.lower() for part in word.split()] != ["frame", "time"]:
        raise ValueError(f"after the number of frames comes {shown(line)}, and no Frame Time")
    wide, T = sum(map(len, found.channels)), int(count)
    if not T or not wide:
        raise ValueError(f"it has {T} frames of {wide} channels; a motion has one or more")
    if T * wide > MOST_NUMBERS:
        raise ValueError(f"{T:,} frames of {wide:,} channels are too many to be read")
    numbers, rows = array("d"), 0
    for number, line in lines:
        if rows == T:
            raise ValueError(f"line {number} follows the last of {T:,} frames")
        numbers.extend(_numbers(line.split(), wide, number))
        rows += 1
    if rows < T:
        raise ValueError(f"it has {rows:,} frames, and says {T:,}")
    found.rows = np.array(numbers).reshape(T, wide)


def _numbers(words: Iterable[str], count: int, number: int) -> list[float]:
    """So many finite numbers of a line."""
    given = list(words)
    try:
        numbers = [float(word) for word in given]
    except ValueError as error:
        raise ValueError(f"line {number}: {shown(str(error))}") from error
    if len(numbers) != count:
        raise ValueError(f"line {number} has {len(numbers)} numbers, and must have {count}")
    if not all(-LARGEST <= x <= LARGEST for x in numbers):
        wrong = next(x for x in numbers if not -LARGEST <= x <= LARGEST)
        raise ValueError(f"line {number} holds {wrong:g}, which is no length and no angle")
    return numbers
