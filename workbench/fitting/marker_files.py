"""Recordings of markers: .trc and .c3d files, and .npz files of our own.

An .npz holds `markers` (T, M, 3), `labels` (M,) and, if it is known, `fps`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from workbench.arrays import Array, Mask
from workbench.errors import BadFile, listed, some
from workbench.geometry.guesses import (
    UNITS,
    UP_TO_Y,
    Sizes,
    check_given,
    extents,
    sizes_of,
    unit_of,
    up_of,
)
from workbench.motions.markers import Trajectories, checked_places, read_c3d, read_trc, write_trc
from workbench.motions.skeleton_names import renamed
from workbench.reading.arrays import any_reals, opened, optional, read_expected, taken_for, texts
from workbench.writing import write_arrays

HIGHEST_FPS = 1e6  # frames a second
RECORDED = {
    "markers": any_reals("T", "M", 3),
    "labels": texts("M"),
    "fps": optional(any_reals()),
}


@dataclass(frozen=True, eq=False)
class MarkerRecording:
    """Labelled markers in T frames, (T, M, 3) m, y up, NaN where one was not seen; `fps` is None if
    the file does not say it. The notes are on the unit and the axis that were taken, and on what
    was missing or left out.
    """

    markers: Array
    labels: tuple[str, ...]
    fps: float | None
    notes: tuple[str, ...]


def read_markers(
    path: Path,
    *,
    unit: str | None = None,
    up: str | None = None,
    sizes: Sizes | None = None,
    labels: Path | None = None,
) -> MarkerRecording:
    """Read markers from an .npz, .trc or .c3d file, in metres, y up.

    The unit is what the file says it is; in an .npz, and where a file does not say, it is guessed
    from the size of a body: `sizes`, or what the labels say it is, a hand or a person. So is the
    axis that points up, y or z; `notes` say both.
    A marker that was not seen is NaN, or zero in all coordinates, as some systems write it. `unit`
    is `m`, `cm`, `mm` or `in`, and `up` an axis, such as `z`; `labels` is a table of other labels
    (`skeleton_names.renamed`). Raises BadFile for a damaged file, or one of another layout, and for
    markers that are no body's in any unit; UnknownName for a unit or an axis.
    """
    check_given(unit, up)
    suffix = Path(path).suffix.lower()
    read = MARKER_READERS.get(suffix, read_marker_arrays)
    trajectories = read(path)
    if labels is not None:
        new, notes = renamed(trajectories.labels, labels)
        kept = [m for m, label in enumerate(new) if label]
        trajectories = replace(
            trajectories,
            places=trajectories.places[:, kept],
            labels=tuple(new[m] for m in kept),
            notes=(*trajectories.notes, *notes),
        )
    return upright(path, trajectories, unit, up, sizes)


def upright(
    path: str | Path,
    trajectories: Trajectories,
    unit: str | None,
    up: str | None,
    sizes: Sizes | None = None,
) -> MarkerRecording:
    """Trajectories of a file in metres, y up. Raises BadFile."""
    with taken_for(path, "recording of markers of a body", "see that they are those of a person"):
        seen = np.isfinite(trajectories.places).all(axis=2) & trajectories.places.any(axis=2)
        lost: Mask = np.asarray(~seen)
        if lost.all():
            raise BadFile("no marker was seen in any frame")
        places = np.where(lost[..., None], np.nan, trajectories.places)
        unit, unit_note = unit_of(
            float(extents(places).max()),
            unit,
            trajectories.unit,
            sizes=sizes or sizes_of(trajectories.labels),
            what="the markers of a frame reach {}",
        )
        places = places * UNITS[unit]
        axis, axis_note = up_of(places, up, names=trajectories.labels, what="the recording")
    missing_note = f"{100 * lost.mean():.1f} % of the places of markers are missing"
    notes = (unit_note, axis_note, missing_note, *trajectories.notes)
    return MarkerRecording(places @ UP_TO_Y[axis].T, trajectories.labels, trajectories.fps, notes)


def read_marker_arrays(path: str | Path) -> Trajectories:
    """The markers of an .npz in its own unit and axes. Raises BadFile."""
    with opened(path, "recording of markers", "give an .npz with markers and labels") as archive:
        arrays = read_expected(archive, RECORDED)
        markers, labels = arrays["markers"], tuple(map(str, arrays["labels"]))
        fps = float(arrays["fps"]) if "fps" in arrays else None
        if fps is not None and not 0 < fps < HIGHEST_FPS:
            raise BadFile(f"fps is {fps:g}, but must be above zero and below {HIGHEST_FPS:g}")
        if len({*labels}) < len(labels):
            twice = [label for label in dict.fromkeys(labels) if labels.count(label) > 1]
            raise BadFile(f"labels has {listed(twice)} more than once; each marker needs its name")
        try:
            checked_places(markers)
        except ValueError as error:
            raise BadFile(str(error)) from error
        others = [*sorted({*archive.headers} - {*RECORDED}), *archive.others]
    notes = (f"not read are {some(others)}",) if others else ()
    return Trajectories(markers, labels, fps, None, notes)


def holds_markers(path: str | Path) -> bool:
    """Whether a file is one of markers, by its suffix, or in an .npz by its entries."""
    suffix = Path(path).suffix.lower()
    if suffix != ".npz":
        return suffix in MARKER_READERS
    with opened(path, "file of a motion or of markers", "give another .npz") as archive:
        return "markers" in archive.headers and "trans" not in archive.headers


def write_markers(path: str | Path, recording: MarkerRecording) -> None:
    """Write markers, in metres, y up, as .trc or as .npz. Whole or not at all.

    Raises BadFile for another suffix, and what `write_trc` raises.
    """
    match Path(path).suffix.lower():
        case ".trc":
            write_trc(path, Trajectories(recording.markers, recording.labels, recording.fps, "m"))
        case ".npz":
            arrays = {"markers": recording.markers, "labels": np.array(recording.labels)}
            if recording.fps is not None:
                arrays["fps"] = np.array(recording.fps)
            write_arrays(path, arrays)
        case _:
            raise BadFile(f"markers are written as .trc or .npz, and {path} ends otherwise")


MARKER_READERS: dict[str, Callable[[str | Path], Trajectories]] = {
    ".npz": read_marker_arrays,
    ".trc": read_trc,
    ".c3d": read_c3d,
}
