"""Markers in C3D files (c3d.org): whole numbers or floats, of all three kinds of processors."""

from pathlib import Path

import numpy as np

from workbench.arrays import Array
from workbench.errors import some
from workbench.motions.c3d_parameters import (
    BLOCK,
    Header,
    Numbers,
    Parameter,
    number_in,
    read_header,
    texts_in,
)
from workbench.motions.trajectories import (
    MOST_NUMBERS,
    Trajectories,
    checked_places,
    different_labels,
    unit_named,
)
from workbench.reading.arrays import damage, taken_for
from workbench.reading.facts import bounded

MOST_BYTES = 2**29
COMPUTED = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS")  # points that are no places
SAME = 1e-5  # how far two statements of a scale or a rate may differ, relative to either


def read_c3d(path: str | Path) -> Trajectories:
    """Read the points of a C3D file; one whose fourth number is negative was not seen.

    Points that the file says are computed (angles, forces, moments, powers, scalars) are left out,
    and measurements of other devices are not read; `notes` say so. Raises BadFile for a file that
    is damaged, or whose header and parameters disagree on what its frames hold.
    """
    with taken_for(path, "C3D file of markers", "export it again"), damage():
        return parse_c3d(bounded(path, MOST_BYTES))


def parse_c3d(content: bytes) -> Trajectories:
    """The points in the bytes of a C3D file. Raises ValueError with what is wrong."""
    header, numbers, parameters = read_header(content)
    _agree(header, parameters)
    T = _frames(header, parameters)
    if not header.points or 3 * T * header.points > MOST_NUMBERS:
        raise ValueError(f"{T} frames of {header.points} points are none, or too many to be read")
    places = checked_places(_places(content, header, numbers, parameters, T))
    names = list(texts_in(parameters, "POINT:LABELS"))[: header.points]
    names += [""] * (header.points - len(names))
    computed = {
        label for kind in COMPUTED for label in texts_in(parameters, f"POINT:{kind}") if label
    }
    kept = [m for m, name in enumerate(names) if name not in computed]
    notes = []
    if len(kept) < len(names):
        notes.append(f"left out are {some(n for n in names if n in computed)}, which are computed")
    if not kept:
        raise ValueError("all of its points are computed, and none is a marker")
    if header.analog:
        notes.append(f"{header.analog} measurements a frame of other devices are not read")
    labels, renamed = different_labels([names[m] for m in kept])
    rate = number_in(parameters, "POINT:RATE")
    fps = header.rate if rate is None or not rate > 0 else rate
    units = texts_in(parameters, "POINT:UNITS")
    return Trajectories(
        places[:, kept],
        labels,
        fps if 0 < fps < 1e6 else None,
        unit_named(units[0]) if units else None,
        (*notes, *renamed),
    )


def _agree(header: Header, parameters: dict[str, Parameter]) -> None:
    """Raise ValueError if the header and the parameters say different things of the frames."""
    said = {
        "USED": (float(header.points), number_in(parameters, "POINT:USED")),
        "SCALE": (header.scale, number_in(parameters, "POINT:SCALE")),
        "RATE": (header.rate, number_in(parameters, "POINT:RATE")),
    }
    for name, (one, other) in said.items():
        if other is None:
            continue
        whole = name == "USED" and one == other % 65536
        if not whole and not abs(one - other) <= SAME * max(abs(one), abs(other)):
            raise ValueError(f"its header says {one:g}, and POINT:{name} says {other:g}")
    if not np.isfinite(header.scale) or not header.scale or abs(header.scale) > 1e6:
        raise ValueError(f"its scale is {header.scale:g}, which makes no lengths")


def _frames(header: Header, parameters: dict[str, Parameter]) -> int:
    """How many frames there are. Two bytes hold numbers up to 65,535, so that others may say it."""
    ends = [parameters.get(f"TRIAL:ACTUAL_{end}_FIELD") for end in ("START", "END")]
    counted = []
    for words in ends:
        if isinstance(words, np.ndarray) and len(words) == 2:
            low, high = (int(word) % 65536 for word in words)
            counted.append(low + 65536 * high)
    T = header.last - header.first + 1
    if len(counted) == 2 and counted[1] - counted[0] + 1 >= T:
        T = counted[1] - counted[0] + 1
    if T < 1:
        raise ValueError(f"its frames go from {header.first} to {header.last}")
    said = number_in(parameters, "POINT:FRAMES")
    if said is not None and header.last == 65535 and said > T:
        T = int(min(said, 1e9))
    return T


def _places(
    content: bytes,
    header: Header,
    numbers: Numbers,
    parameters: dict[str, Parameter],
    T: int,
) -> Array:
    """The places (T, M, 3) in the unit of the file, NaN where a point was not seen."""
    floats, M = header.scale < 0, header.points
    width = 4 if floats else 2
    row = width * (4 * M + header.analog)
    block = header.start or int(number_in(parameters, "POINT:DATA_START") or 0)
    start = (block - 1) * BLOCK
    if block < 2 or start + T * row > len(content):
        raise ValueError(f"it ends before {T:,} frames of {M} points, which it says it has")
    each = np.frombuffer(content, np.uint8, T * row, start).reshape(T, row)[:, : 4 * width * M]
    data = each.tobytes()
    table = (numbers.floats(data) if floats else numbers.words(data).astype(np.float64)).reshape(
        T, M, 4
    )
    places = table[..., :3] * (1.0 if floats else header.scale)
    places[~(table[..., 3] >= 0)] = np.nan
    return places
