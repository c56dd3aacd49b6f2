"""Markers in .trc files (Motion Analysis; OpenSim and Pose2Sim write them too): tables in text."""

from array import array
from pathlib import Path

import numpy as np

from workbench.errors import BadArgument, shown
from workbench.geometry.meshes import text_lines
from workbench.motions.trajectories import (
    MOST_NUMBERS,
    Trajectories,
    checked_places,
    different_labels,
    unit_named,
)
from workbench.reading.arrays import damage, taken_for
from workbench.reading.facts import bounded
from workbench.writing import write_file

MOST_BYTES = 2**29
OFF = 0.01  # of the rate, by which the times of frames may be off it before this is said


def read_trc(path: str | Path) -> Trajectories:
    """Read the markers of a .trc file. Empty cells and NaN are markers that were not seen.

    Raises BadFile for a file whose header and rows do not fit together.
    """
    with taken_for(path, "TRC file of markers", "export it again"), damage():
        return parse_trc(bounded(path, MOST_BYTES))


def parse_trc(content: bytes) -> Trajectories:
    """The markers in the text of a .trc file. Raises ValueError with what is wrong."""
    lines = text_lines(content)
    head = [line.rstrip("\r\n") for _, line in zip(range(5), lines, strict=False)]
    if len(head) < 5 or not head[0].startswith("PathFileType"):
        raise ValueError(f"it begins with {shown(head[0] if head else '')}, and not PathFileType")
    said = dict(zip(head[1].split(), head[2].split(), strict=False))
    names = [cell.strip() for cell in _cells(head[3])[2:] if cell.strip()]
    M, wide = len(names), 3 * len(names) + 2
    if _whole(said, "NumMarkers") != M or not M:
        raise ValueError(f"it names {M} markers, and says {said.get('NumMarkers', 'nothing')}")
    numbers, times = array("d"), array("d")
    for n, line in enumerate(lines, start=6):
        row = line.rstrip("\r\n")
        if not row.strip():
            continue
        cells = _cells(row)
        if any(cell.strip() for cell in cells[wide:]):
            raise ValueError(f"line {n} has more than {M} markers")
        if len(numbers) > MOST_NUMBERS:
            raise ValueError(f"it has more than {len(times):,} frames, too many to be read")
        try:
            found = [float(cell) if cell.strip() else np.nan for cell in cells[:wide]]
        except ValueError as error:
            raise ValueError(f"line {n}: {shown(str(error))}") from error
        found += [np.nan] * (wide - len(found))
        times.append(found[1])
        numbers.extend(found[2:])
    T, fps = len(times), _rate(said)
    if not T:
        raise ValueError("it has no frames")
    notes = _off_times(np.array(times), fps)
    if (told := _whole(said, "NumFrames")) != T:
        notes += (f"its header says {told} frames, and it has {T}, which are read",)
    labels, renamed = different_labels(names)
    places = checked_places(np.array(numbers).reshape(T, M, 3))
    return Trajectories(places, labels, fps, unit_named(said.get("Units", "")), notes + renamed)


def _cells(line: str) -> list[str]:
    return line.split("\t") if "\t" in line else line.split()


def _whole(said: dict[str, str], name: str) -> int:
    text = said.get(name, "")
    if not text.isdecimal() or len(text) > 12:
        raise ValueError(f"its {name} is {shown(text)}, which is no number")
    return int(text)


def _rate(said: dict[str, str]) -> float:
    text = said.get("DataRate", "")
    try:
        rate = float(text)
    except ValueError:
        rate = np.nan
    if not 0 < rate < 1e6:
        raise ValueError(f"its DataRate is {shown(text)}, which is no number of frames a second")
    return rate


def _off_times(times: np.ndarray, fps: float) -> tuple[str, ...]:
    """A note if the column of times says another rate."""
    with np.errstate(all="ignore"):
        took = (times[-1] - times[0]) / max(1, len(times) - 1)
        if len(times) < 2 or not np.isfinite(took) or abs(took * fps - 1) <= OFF:
            return ()
    return (f"its frames are {took:.6g} s apart by their times, and {1 / fps:.6g} s by DataRate",)


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
    said = {"DataRate": markers.fps, "CameraRate": markers.fps, "NumFrames": T, "NumMarkers": M}
    said |= {"Units": markers.unit, "OrigDataRate": markers.fps}
    said |= {"OrigDataStartFrame": 1, "OrigNumFrames": T}
    rates = {key: f"{v:.10g}" if isinstance(v, float) else str(v) for key, v in said.items()}
    axes = [f"{axis}{m}" for m in range(1, M + 1) for axis in "XYZ"]
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{Path(path).name}",
        "\t".join(rates),
        "\t".join(rates.values()),
        "Frame#\tTime\t" + "\t".join(f"{label}\t\t" for label in markers.labels),
        "\t\t" + "\t".join(axes),
        "",
    ]
    for t, frame in enumerate(markers.places):
        cells = [f"{x:.9g}" if np.isfinite(x) else "" for x in frame.ravel()]
        lines.append("\t".join([str(t + 1), f"{t / markers.fps:.6f}", *cells]))
    write_file(path, "\n".join(lines) + "\n")
