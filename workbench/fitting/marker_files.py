"""Recordings of markers in .npz files: `markers` (T, M, 3), `labels` (M,) and, if known, `fps`."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.errors import BadFile, check_known, listed
from workbench.fitting.scan_up import TURNS
from workbench.reading.archive import opened
from workbench.reading.expected import any_reals, optional, read_expected, texts

RECORDED = {
    "markers": any_reals("T", "M", 3),
    "labels": texts("M"),
    "fps": optional(any_reals()),
}
UNITS = {"m": 1.0, "mm": 0.001}
BODY = (0.5, 3.0)  # m, how far the markers of one frame reach, from one end to the other
ZUP = 1.2  # how much longer a standing person is along the height than along the other sides


@dataclass(frozen=True, eq=False)
class MarkerRecording:
    """Markers in T frames.

    Attributes:
        markers: (T, M, 3) m, y up, NaN where a marker was not seen.
        labels: the name of each marker.
        fps: frames a second; None if the file does not say.
        notes: sentences on the unit and the axis that were taken, and on what was missing.
    """

    markers: Array
    labels: tuple[str, ...]
    fps: float | None
    notes: tuple[str, ...]


def read_markers(path: Path, *, unit: str | None = None, up: str | None = None) -> MarkerRecording:
    """Read an .npz of markers: metres or millimetres, y or z up; both are guessed and said.

    A marker that was not seen is NaN, or zero in all coordinates, as some systems write it. `unit`
    is `m` or `mm` and `up` an axis, such as `z`. Raises BadFile for a file of another layout, and
    for markers that are no body's in any unit; UnknownName for a unit or an axis.
    """
    if unit is not None:
        check_known("unit", unit, UNITS)
    if up is not None:
        check_known("axis", up, TURNS)
    with opened(path, "recording of markers", "give an .npz with markers and labels") as archive:
        arrays = read_expected(archive, RECORDED)
        given, labels = arrays["markers"], tuple(map(str, arrays["labels"]))
        fps = _frames_a_second(arrays.get("fps"))
        if len({*labels}) < len(labels):
            twice = [label for label in dict.fromkeys(labels) if labels.count(label) > 1]
            raise BadFile(f"labels has {listed(twice)} more than once; each marker needs its name")
        if np.isinf(given).any():
            raise BadFile("markers holds infinite numbers; a marker that was not seen is NaN")
        lost = ~np.isfinite(given).all(axis=2) | ~given.any(axis=2)
        places = np.where(lost[..., None], np.nan, given)
        if lost.all():
            raise BadFile("no marker was seen in any frame")
        metres, said = _unit(places, unit)
        places = places * metres
        axis, why = _up(places, up)
    share = f"{100 * lost.mean():.1f} % of the places of markers are missing"
    return MarkerRecording(places @ TURNS[axis].T, labels, fps, (said, why, share))


def _frames_a_second(given: NDArray[np.float64] | None) -> float | None:
    if given is None:
        return None
    if not 0 < float(given) < np.inf:
        raise BadFile(f"fps is {float(given):g}, but must be above zero")
    return float(given)


def _reach(places: Array) -> Array:
    """The extent (3,) of the markers of a usual frame, along each axis."""
    there = places[np.isfinite(places).all(axis=2).sum(axis=1) > 1]
    if not len(there):
        raise BadFile("no frame shows two markers")
    return np.asarray(np.median(np.nanmax(there, axis=1) - np.nanmin(there, axis=1), axis=0))


def _unit(places: Array, given: str | None) -> tuple[float, str]:
    reach = float(np.linalg.norm(_reach(places)))
    if given is not None:
        return UNITS[given], f"the unit {given} was given"
    for name, metres in UNITS.items():
        if BODY[0] <= reach * metres <= BODY[1]:
            return metres, (
                f"the unit is taken to be {name}, in which the markers of a frame reach "
                f"{reach * metres:.2f} m"
            )
    raise BadFile(
        f"the markers of a frame reach {reach:.3g}, which is no body in {listed(UNITS)}; "
        "give the unit, or scale them"
    )


def _up(places: Array, given: str | None) -> tuple[str, str]:
    if given is not None:
        return given, f"the axis {given} was given as up"
    reach = _reach(places)
    if reach[2] > ZUP * reach[:2].max():
        return "z", f"z is taken to be up, along which the markers reach {reach[2]:.2f} m"
    sure = "" if reach[1] > ZUP * reach[[0, 2]].max() else ", which their form does not tell"
    return "y", f"y is taken to be up{sure}"
