"""Keypoints of a person as any detector writes them, as numbers: lists, columns or names."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadFile, UnknownName, shown
from workbench.fitting.files.layouts import keypoint_name
from workbench.fitting.observations import FEWEST_PLACING

CONFIDENCE_KEYS = ("score", "confidence", "conf", "visible", "visibility", "v")  # of one keypoint
FARTHEST_PX = 1e7  # px: no detector reports a keypoint farther out
CLEAR_CONFIDENCE = 0.2  # confidence of a keypoint that tells how large a person is
FRACTION_RANGE = -0.5, 2.0  # between which all keypoints lie if they are fractions of an image

Named = tuple[tuple[str, ...], Array]  # names, empty if the file has none, and (M, 3)


@dataclass(frozen=True, eq=False)
class DetectedPerson:
    """The named keypoints (M, 3) of one person in a file, as u, v in px and a confidence from 0 to
    1, which is 0 for what was not seen; the size of the image in px, if the file says so; the names
    without hands and face, empty where each point has a name; and notes on what else it holds.
    """

    names: tuple[str, ...]
    points: Array
    size: tuple[int, int] | None
    body: tuple[str, ...]
    notes: tuple[str, ...]


def numbers_in(path: str | Path, what: str, entry: Any) -> Array:
    """A list of numbers as an array; `what` names it in the error. Raises BadFile."""
    try:
        numbers = np.asarray(entry, dtype=float)
    except (ValueError, TypeError, OverflowError):
        numbers = None
    if numbers is None or not isinstance(entry, (list, tuple)):
        raise BadFile(f"{path}: {what} must be numbers, not {shown(entry)}")
    return numbers


def is_point(entry: Any) -> bool:
    """Whether it is one keypoint: two to four numbers, or an object with x and y."""
    if isinstance(entry, dict):
        return {"x", "y"} <= entry.keys() or "position" in entry
    several = isinstance(entry, list) and 2 <= len(entry) <= 4
    return several and all(isinstance(number, int | float | None) for number in entry)


def points_in(path: str | Path, where: str, entry: Any, scores: Any = None) -> Named:
    """Keypoints (M, 3) as u, v, confidence, and their names if each has one.

    They may be a list of u, v and confidence, flat or with two to four numbers for each (u, v; u,
    v, confidence; u, v, depth, confidence) and `scores` (M,) beside it, a list of objects with x
    and y, an object of lists under x and y, or an object by name. Raises BadFile.
    """
    names: tuple[str, ...] = ()
    what = f"{where}: keypoints".removeprefix(": ")
    if isinstance(entry, dict) and isinstance(entry.get("x"), list):
        columns = [entry["x"], entry.get("y")]
        columns += [entry[key] for key in CONFIDENCE_KEYS if isinstance(entry.get(key), list)][:1]
        if len({len(item) if isinstance(item, list) else -1 for item in columns}) > 1:
            raise BadFile(f"{path}: {what} must have as many y as x, not {shown(entry.get('y'))}")
        entry = [list(row) for row in zip(*columns, strict=True)]
    elif isinstance(entry, dict):
        names, entry = tuple(map(keypoint_name, entry)), [*map(_point_row, entry.values())]
    elif isinstance(entry, list) and entry and all(isinstance(item, dict) for item in entry):
        called = [
            next((item[k] for k in ("name", "part", "class") if k in item), None) for item in entry
        ]
        if all(isinstance(name, str) for name in called):
            names = tuple(map(keypoint_name, called))
        entry = [*map(_point_row, entry)]
    elif isinstance(entry, list):
        wide = next((len(item) for item in entry if isinstance(item, list) and item), 0)
        entry = [[None] * wide if wide and not item else item for item in entry]  # null: not seen
    numbers = numbers_in(path, what, entry)
    sure = None if not isinstance(scores, list) else numbers_in(path, what, scores).ravel()
    if numbers.ndim == 3 and len(numbers) == 1:  # of one person
        numbers = numbers[0]
    if numbers.ndim == 1:
        wide = 2 if sure is not None and numbers.size == 2 * sure.size else 3
        if numbers.size % wide:
            raise BadFile(
                f"{path}: {what} must be three numbers each, u, v and confidence, but "
                f"{numbers.size} numbers are not a multiple of three"
            )
        numbers = numbers.reshape(-1, wide)
    if numbers.ndim != 2 or not (2 <= numbers.shape[1] <= 4 or not numbers.size):
        raise BadFile(f"{path}: {what} must be u, v and a confidence each, not {shown(entry)}")
    if sure is None and numbers.shape[1] == 3:
        return names, numbers
    if sure is None:
        sure = numbers[:, 3] if numbers.shape[1] > 3 else np.ones(len(numbers))
    if len(sure) != len(numbers):
        raise BadFile(f"{path}: {what} are {len(numbers)}, but there are {len(sure)} scores")
    return names, np.column_stack([numbers[:, :2], sure])


def _point_row(entry: Any) -> Any:
    """A keypoint as u, v, confidence; 1 where no confidence is said."""
    if isinstance(entry, dict):
        place = entry["position"] if isinstance(entry.get("position"), dict) else entry
        sure = next((entry[key] for key in CONFIDENCE_KEYS if entry.get(key) is not None), 1.0)
        return [place.get("x"), place.get("y"), sure]
    if isinstance(entry, list) and len(entry) in (2, 4):
        return [*entry[:2], entry[3] if len(entry) == 4 else 1.0]
    return entry or [None] * 3


def trusted(points: Array) -> Array:
    """Keypoints (M, 3) with confidences from 0 to 1, as SPIN's weights c^2 take them.

    COCO's flags 0, 1, 2 and the scores of some detectors are above 1, and count as 1: a score says
    nothing about px, and must not make a sigma smaller. Not seen, with confidence 0, is what is not
    finite, farther than 1e7 px, has a confidence of 0 or below, or lies at 0, 0 or -1, -1.
    """
    seen = (np.abs(points[:, :2]) < FARTHEST_PX).all(axis=1)  # nor NaN
    seen &= (points[:, 2] > 0) & (points[:, 2] < np.inf) & (points[:, :2] > 0).any(axis=1)
    clean = np.where(seen[:, None], points, 0.0)
    clean[:, 2] = np.minimum(clean[:, 2], 1.0)
    return clean


def in_px(
    path: str | Path, points: Array, size: tuple[int, int] | None, *, fractions: bool = False
) -> tuple[Array, list[str]]:
    """Trusted keypoints (M, 3) in px, and a note if they seem to be fractions of the image.

    Raises BadFile if the size of the image is then not known.
    """
    places = points[points[:, 2] > 0, :2]
    guessed = bool(
        len(places) and places.min() > FRACTION_RANGE[0] and places.max() < FRACTION_RANGE[1]
    )
    if not fractions and not guessed:
        return points, []
    if size is None:
        raise BadFile(
            f"{path} holds fractions of an image, not px, and not how large the image is; give "
            "--size WIDTHxHEIGHT in px"
        )
    note = f"{Path(path).name}: keypoints are taken for fractions of the image, not for px"
    return points * [*size, 1.0], [] if fractions else [note]


def no_such_person(path: str | Path, person: int, count: int) -> UnknownName:
    """The error for a person who is not among the `count` people of a file."""
    known = [str(number) for number in range(count)] if count <= 5 else []
    hint = "" if known else f"0 to {count - 1}"
    people = f"{count:,} {'person' if count == 1 else 'people'}"
    more = f"{path} holds {people}, counted from 0"
    return UnknownName("person", str(person), known, hint=hint, more=more)


def how_large(points: Array) -> tuple[float, float]:
    """The diagonal in px of the box around trusted keypoints (M, 3), then how sure they are."""
    clear = points[points[:, 2] > CLEAR_CONFIDENCE, :2]
    size = np.linalg.norm(np.ptp(clear, axis=0)) if len(clear) >= FEWEST_PLACING else 0.0
    return float(size), float(points[:, 2].sum())
