"""Recorded points in C3D (c3d.org) and TRC files, in their own unit and axes."""

from array import array
from collections.abc import Mapping
from dataclasses import dataclass
from math import prod
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.errors import BadArgument, cut, shown, some
from workbench.geometry.meshes import text_lines
from workbench.motions.bones import different_names
from workbench.reading.arrays import damage, taken_for
from workbench.reading.facts import bounded
from workbench.writing import write_file

MOST_NUMBERS = 25_000_000  # coordinates of a recording: 80 markers for 14 minutes at 120 fps
LARGEST_NUMBER = 1e9  # of a coordinate, in any unit
MOST_BYTES = 2**29
LENGTHS = {
    "m": ("m", "meter", "meters", "metre", "metres"),
    "cm": ("cm", "centimeter", "centimeters"),
    "mm": ("mm", "millimeter", "millimeters"),
    "in": ("in", "inch", "inches"),
}


@dataclass(frozen=True, eq=False)
class Trajectories:
    """M points in T frames.

    Attributes:
        places: (T, M, 3) in the unit of the file, NaN where a point was not seen.
        labels: the different names of the points.
        fps: frames a second; None if the file does not say.
        unit: m, cm, mm or in; None if the file does not say.
        notes: sentences on what was left out or renamed.
    """

    places: Array
    labels: tuple[str, ...]
    fps: float | None
    unit: str | None
    notes: tuple[str, ...] = ()


def unit_named(text: str) -> str | None:
    """The unit that a file names, in whatever spelling; None for one that is not known."""
    plain = text.strip().lower()
    return next((unit for unit, names in LENGTHS.items() if plain in names), None)


def checked_places(places: Array) -> Array:
    """The same places. Raises ValueError for infinite numbers, and such as no recording has."""
    with np.errstate(invalid="ignore"):
        wrong = np.abs(places) > LARGEST_NUMBER
    if wrong.any():
        t, m, _ = (int(i) for i in np.argwhere(wrong)[0])
        raise ValueError(f"frame {t} has point {m} at {places[t, m]}, which is no place")
    return places


# C3D files, after The C3D File Format User Guide, Motion Lab Systems. Functions below raise
# ValueError with what is wrong; they read nothing beyond the bytes that are there.
BLOCK = 512  # bytes
PROCESSORS = {84: "<", 85: "dec", 86: ">"}
MOST_PARAMETERS = 10_000
COMPUTED = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS")  # points that are no places
MOST_RATE = 1e6  # frames a second
SAME_NUMBER = 1e-5  # how far two statements of a scale or a rate may differ, relative to either
Parameter = NDArray[np.float64] | tuple[str, ...]


def read_c3d(path: str | Path) -> Trajectories:
    """Read the points of a C3D file; one whose fourth number is negative was not seen.

    Whole numbers or floats, of all three kinds of processors. Points that the file says are
    computed (angles, forces, moments, powers, scalars) are left out, and measurements of other
    devices are passed over; `notes` say so. Where the header states another rate or scale than the
    parameters, these count, and a note says so. Raises BadFile for a file that is damaged, or whose
    header and parameters disagree on how many points a frame has, or of which kind of numbers.
    """
    with taken_for(path, "C3D file of markers", "export it again"), damage():
        return _c3d(bounded(path, MOST_BYTES))


@dataclass(frozen=True)
class _Numbers:
    """How numbers are written: `<` as on Intel, `>` as on MIPS, or `dec`, with floats of a VAX."""

    kind: str

    def words(self, content: bytes) -> NDArray[np.int64]:
        """Whole numbers of two bytes, with a sign."""
        order = ">" if self.kind == ">" else "<"
        return np.frombuffer(content, f"{order}i2").astype(np.int64)

    def floats(self, content: bytes) -> Array:
        """Numbers of four bytes. A VAX exchanges the two words of a float, and means a fourth."""
        with np.errstate(invalid="ignore"):
            if self.kind != "dec":
                return np.frombuffer(content, f"{self.kind}f4").astype(np.float64)
            swapped = np.frombuffer(content, "<u2").reshape(-1, 2)[:, ::-1]
            return np.ascontiguousarray(swapped).view("<f4").ravel().astype(np.float64) / 4


def _c3d(content: bytes) -> Trajectories:
    numbers, parameters = _numbers_and_parameters(content)
    # points and other measurements in each frame, the numbers of the first and the last frame as
    # far as they fit into two bytes, and the block in which the frames begin, counted from 1
    head = [int(word) % 65536 for word in numbers.words(content[:BLOCK])]
    M, analog, first, last, start = head[1], head[2], head[3], head[4], head[8]
    used = _number(parameters, "POINT:USED")
    if used is not None and used % 65536 != M:
        raise ValueError(f"its header says {M} points, and POINT:USED says {used:g}")
    scale, fps, notes = _scale_and_fps(content, numbers, parameters)
    T = _frames(first, last, parameters)
    if not M or 3 * T * M > MOST_NUMBERS:
        raise ValueError(f"{T} frames of {M} points are none, or too many to be read")
    width = 4 if scale < 0 else 2  # floats, or whole numbers
    begin = ((start or int(_number(parameters, "POINT:DATA_START") or 0)) - 1) * BLOCK
    channels = _number(parameters, "ANALOG:USED") or 0.0
    samples = _number(parameters, "ANALOG:RATE") or 0.0
    others = int(channels) * round(samples / fps) if fps > 0 else 0
    ends = [begin - (-T * width * (4 * M + n) // BLOCK) * BLOCK for n in (analog, others)]
    if others > 0 and ends[0] != len(content) == ends[1]:  # the frames end in the file's last block
        notes.append(f"its header says {analog} measurements of other devices, ANALOG {others}")
        analog = others
    row = width * (4 * M + analog)
    if begin < BLOCK or begin + T * row > len(content):
        raise ValueError(f"it ends before {T:,} frames of {M} points, which it says it has")
    points = np.frombuffer(content, np.uint8, T * row, begin).reshape(T, row)[:, : 4 * width * M]
    read = numbers.floats if scale < 0 else numbers.words
    table = np.asarray(read(points.tobytes()), np.float64).reshape(T, M, 4)
    places = table[..., :3] * (1.0 if scale < 0 else scale)
    places[~(table[..., 3] >= 0)] = np.nan
    kept, names = _points_kept(parameters, M, notes)
    if analog:
        notes.append(f"{analog} measurements a frame of other devices are not read")
    labels, renamed = different_names(names, "point")
    unit = next((unit_named(text) for text in _texts(parameters, "POINT:UNITS")), None)
    places = checked_places(places)[:, kept]
    rate = fps if 0 < fps < MOST_RATE else None
    return Trajectories(places, labels, rate, unit, (*notes, *renamed))


def _numbers_and_parameters(content: bytes) -> tuple[_Numbers, dict[str, Parameter]]:
    """How numbers are written in a file, and its parameters."""
    if len(content) < BLOCK or content[1] != 0x50:
        raise ValueError("it does not begin as a C3D file does")
    position = (content[0] - 1) * BLOCK
    if not content[0] or len(content) < position + 4:
        raise ValueError("it ends before its parameters")
    processor = content[position + 3]
    if processor not in PROCESSORS:
        raise ValueError(f"its processor has the number {processor}, and there are 84 to 86")
    numbers = _Numbers(PROCESSORS[processor])
    return numbers, _parameters(content, position + 4, numbers)


def _scale_and_fps(
    content: bytes, numbers: _Numbers, parameters: Mapping[str, Parameter]
) -> tuple[float, float, list[str]]:
    """Scale and rate of a header, or of the parameters that contradict it, and notes on these."""
    scale, fps = (float(numbers.floats(content[i : i + 4])[0]) for i in (12, 20))
    notes = []
    for name, own in (("SCALE", scale), ("RATE", fps)):
        other = _number(parameters, f"POINT:{name}") or np.nan
        if not 0 < abs(other) < 1e6 or abs(own - other) <= SAME_NUMBER * max(abs(own), abs(other)):
            continue
        if name == "SCALE" and (own < 0) != (other < 0):  # floats have a negative one
            raise ValueError(f"its header says scale {own:g}, and POINT:SCALE says {other:g}")
        if name == "RATE" and other < 0:
            continue
        scale, fps = (other, fps) if name == "SCALE" else (scale, other)
        notes.append(f"its header says {own:g}, and POINT:{name} {other:g}, which counts")
    if not np.isfinite(scale) or not scale or abs(scale) > 1e6:
        raise ValueError(f"its scale is {scale:g}, which makes no lengths")
    return scale, fps, notes


def _points_kept(
    parameters: Mapping[str, Parameter], count: int, notes: list[str]
) -> tuple[list[int], list[str]]:
    """The numbers and names of the points that are not computed, and a note on the others."""
    names = [*_texts(parameters, "POINT:LABELS"), *[""] * count][:count]
    computed = {text for kind in COMPUTED for text in _texts(parameters, f"POINT:{kind}") if text}
    kept = [m for m, name in enumerate(names) if name not in computed]
    if not kept:
        raise ValueError("all of its points are computed, and none is a marker")
    if len(kept) < count:
        notes.append(f"left out are {some(n for n in names if n in computed)}, which are computed")
    return kept, [names[m] for m in kept]


def _frames(first: int, last: int, parameters: Mapping[str, Parameter]) -> int:
    """How many frames there are. Two bytes hold numbers up to 65,535, so that others may say it."""
    ends = []
    for name in ("START", "END"):
        words = parameters.get(f"TRIAL:ACTUAL_{name}_FIELD")
        if isinstance(words, np.ndarray) and len(words) == 2:
            low, high = (int(word) % 65536 for word in words)
            ends.append(low + 65536 * high)
    T = last - first + 1
    if len(ends) == 2:
        T = max(T, ends[1] - ends[0] + 1)
    if T < 1:
        raise ValueError(f"its frames go from {first} to {last}")
    said = _number(parameters, "POINT:FRAMES")
    return int(min(said, 1e9)) if said is not None and last == 65535 and said > T else T


def _parameters(content: bytes, position: int, numbers: _Numbers) -> dict[str, Parameter]:
    """Every parameter of every group. Groups are named after the parameters that belong to them."""
    groups: dict[int, str] = {}
    parameters: list[tuple[int, str, Parameter]] = []
    for _ in range(MOST_PARAMETERS):
        head = content[position : position + 2]
        if len(head) < 2 or not head[0]:
            break
        length, group = (abs(int(n)) for n in np.frombuffer(head, np.int8))
        is_parameter = np.frombuffer(head, np.int8)[1] > 0
        name = content[position + 2 : position + 2 + length].decode("latin-1").strip().upper()
        pointer = position + 2 + length
        if len(content) < pointer + 3:
            raise ValueError("it ends within its parameters")
        if is_parameter:
            parameters.append((group, name, _value(content, pointer + 2, numbers, name)))
        else:
            groups[group] = name
        step = int(numbers.words(content[pointer : pointer + 2])[0])
        if step == 0:
            break
        if step < 3:
            raise ValueError(f"the parameter {name[:30]!r} points back")
        position = pointer + step
    else:
        raise ValueError(f"it has more than {MOST_PARAMETERS:,} parameters")
    return {f"{groups.get(group, group)}:{name}": value for group, name, value in parameters}


def _value(content: bytes, position: int, numbers: _Numbers, name: str) -> Parameter:
    """A parameter: numbers in one row, or texts, whose first dimension is their length."""
    if len(content) < position + 2:
        raise ValueError("it ends within its parameters")
    kind = int.from_bytes(content[position : position + 1], "little", signed=True)
    dims = content[position + 1]
    shape = tuple(content[position + 2 : position + 2 + dims])
    width, count = abs(kind), prod(shape)
    data = content[position + 2 + dims : position + 2 + dims + width * count]
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


def _number(parameters: Mapping[str, Parameter], name: str) -> float | None:
    """The first number of a parameter; None if there is none."""
    value = parameters.get(name)
    return float(value[0]) if isinstance(value, np.ndarray) and value.size else None


def _texts(parameters: Mapping[str, Parameter], name: str) -> tuple[str, ...]:
    """The texts of a parameter and of those that continue it: LABELS, LABELS2, LABELS3, ..."""
    texts: list[str] = []
    continued, n = parameters.get(name), 2
    while isinstance(continued, tuple):
        texts += continued
        continued, n = parameters.get(f"{name}{n}"), n + 1
    return tuple(texts)


RATE_TOLERANCE = 0.01  # of the rate, by which the times of frames may be off it before this is said


def read_trc(path: str | Path) -> Trajectories:
    """Read the markers of a .trc file. Empty cells and NaN are markers that were not seen.

    Cells are separated by tabs, semicolons, commas or spaces; where commas do not separate, they
    may stand for decimal points. A header that is wrong about its frames, its markers or its rate
    is noted. Raises BadFile for one whose header and rows do not fit together.
    """
    with taken_for(path, "TRC file of markers", "export it again"), damage():
        return parse_trc(bounded(path, MOST_BYTES))


def parse_trc(content: bytes) -> Trajectories:
    """The markers in the text of a .trc file. Raises ValueError with what is wrong."""
    lines = text_lines(content.removeprefix(b"\xef\xbb\xbf"))
    head = [line.rstrip("\r\n") for _, line in zip(range(4), lines, strict=False)]
    if len(head) < 4 or not head[0].startswith("PathFileType"):
        raise ValueError(f"it begins with {shown(head[0] if head else '')}, and not PathFileType")
    separator = next((mark for mark in "\t;," if mark in head[3]), None)
    header = dict(zip(_cells(head[1], separator), _cells(head[2], separator), strict=False))
    names = [cell for cell in _cells(head[3], separator)[2:] if cell]
    M, width = len(names), 3 * len(names) + 2
    if not M:
        raise ValueError("it names no markers")
    numbers, times = array("d"), array("d")
    for n, line in enumerate(lines, start=5):
        cells = _cells(line, separator)
        first = next(filter(None, cells), "")
        if not first or first.upper() == "X1" or (n == 5 and not first.isdecimal()):
            continue  # the names of the axes
        if any(cells[width:]):
            raise ValueError(f"line {n} has more than {M} markers")
        if len(numbers) > MOST_NUMBERS:
            raise ValueError(f"it has more than {len(times):,} frames, too many to be read")
        try:
            row = [float(cell.replace(",", ".")) if cell else np.nan for cell in cells[:width]]
        except ValueError as error:
            raise ValueError(f"line {n}: {shown(str(error))}") from error
        row += [np.nan] * (width - len(row))
        times.append(row[1])
        numbers.extend(row[2:])
    T = len(times)
    if not T:
        raise ValueError("it has no frames")
    notes = [
        f"its header says {cut(header[key] or 'no')} {what}, and it has {count}, which are read"
        for key, what, count in (("NumFrames", "frames", T), ("NumMarkers", "markers", M))
        if header.get(key, str(count)) != str(count)
    ]
    fps, rate_notes = _rate(header, np.array(times))
    labels, renamed = different_names(names, "point")
    places = checked_places(np.array(numbers).reshape(T, M, 3))
    unit = unit_named(header.get("Units", ""))
    return Trajectories(places, labels, fps, unit, (*rate_notes, *notes, *renamed))


def _cells(line: str, separator: str | None) -> list[str]:
    """The cells of a line, which stand between marks, or spaces where the line has none."""
    if separator is not None and separator not in line:
        separator = None
    return [cell.strip() for cell in line.split(separator)]


def _rate(header: dict[str, str], times: np.ndarray) -> tuple[float, tuple[str, ...]]:
    """Frames a second by DataRate, else by CameraRate, else by the times, and what is doubtful."""
    with np.errstate(all="ignore"):
        step = float(times[-1] - times[0]) / max(1, len(times) - 1)
        for key in ("DataRate", "CameraRate"):
            try:
                fps = float(header.get(key, "").replace(",", "."))
            except ValueError:
                continue
            if not 0 < fps < MOST_RATE:
                continue
            notes = [f"its rate is CameraRate, for DataRate is {shown(header.get('DataRate'))}"]
            notes = notes if key != "DataRate" else []
            if len(times) > 1 and np.isfinite(step) and abs(step * fps - 1) > RATE_TOLERANCE:
                apart = f"{step:.6g} s apart by their times, and {1 / fps:.6g} s by {key}"
                notes.append(f"its frames are {apart}")
            return fps, tuple(notes)
    if len(times) > 1 and 0 < step < np.inf and 1 / step < MOST_RATE:
        return 1 / step, (f"its header says no rate; by its times it is {1 / step:.6g}",)
    raise ValueError(
        f"its DataRate is {shown(header.get('DataRate'))}, which is no number of frames a second"
    )


def write_trc(path: str | Path, markers: Trajectories) -> None:
    """Write markers as .trc, a place that was not seen as empty cells. Whole or not at all.

    Raises BadArgument for a recording of unknown rate or unit, which the header states, and for
    labels with tabs or line breaks, and BadFile.
    """
    if markers.fps is None or markers.unit is None:
        raise BadArgument(
            "a .trc states its rate and its unit, and this recording lacks one; say it"
        )
    if any({"\t", "\n", "\r"} & {*label} or not label.strip() for label in markers.labels):
        raise BadArgument("a label of a .trc is a text without tabs and line breaks; rename it")
    T, M = markers.places.shape[:2]
    header = {"DataRate": markers.fps, "CameraRate": markers.fps, "NumFrames": T, "NumMarkers": M}
    header |= {"Units": markers.unit, "OrigDataRate": markers.fps}
    header |= {"OrigDataStartFrame": 1, "OrigNumFrames": T}
    texts = {key: f"{v:.10g}" if isinstance(v, float) else str(v) for key, v in header.items()}
    axes = [f"{axis}{m}" for m in range(1, M + 1) for axis in "XYZ"]
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{Path(path).name}",
        "\t".join(texts),
        "\t".join(texts.values()),
        "Frame#\tTime\t" + "\t".join(f"{label}\t\t" for label in markers.labels),
        "\t\t" + "\t".join(axes),
        "",
    ]
    for t, frame in enumerate(markers.places):
        cells = [f"{x:.9g}" if np.isfinite(x) else "" for x in frame.ravel()]
        lines.append("\t".join([str(t + 1), f"{t / markers.fps:.6f}", *cells]))
    write_file(path, "\n".join(lines) + "\n")
