"""Recorded points as a file has them: in its own unit and axes, frame by frame."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array

MOST_NUMBERS = 25_000_000  # coordinates of a recording: 80 markers for 14 minutes at 120 fps
LARGEST = 1e9  # of a coordinate, in any unit
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


def different_labels(given: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Labels of which each occurs once, and a note if some had to be changed."""
    found: list[str] = []
    taken, changed = {*given}, 0
    seen: set[str] = set()
    for m, label in enumerate(given):
        new, n = label or f"point_{m}", 1
        while new in seen or (new != label and new in taken):
            n += 1
            new = f"{label or f'point_{m}'}_{n}"
        changed += new != label
        seen.add(new)
        found.append(new)
    note = f"{changed} of {len(found)} points had no name or that of another, and got a number"
    return tuple(found), (note,) if changed else ()


def checked_places(places: Array) -> Array:
    """The same places. Raises ValueError for infinite numbers, and such as no recording has."""
    with np.errstate(invalid="ignore"):
        wrong = np.abs(places) > LARGEST
    if wrong.any():
        t, m, _ = (int(i) for i in np.argwhere(wrong)[0])
        raise ValueError(f"frame {t} has point {m} at {places[t, m]}, which is no place")
    return places
