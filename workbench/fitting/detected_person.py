"""The keypoints of one person, as a file of a detector holds them."""

from dataclasses import dataclass
from pathlib import Path

from workbench.arrays import Array
from workbench.errors import UnknownName


@dataclass(frozen=True, eq=False)
class DetectedPerson:
    """The keypoints of one person in a file.

    Attributes:
        names: the keypoints' names.
        points: (M, 3) u, v in px, and a confidence.
        size: width and height of the image in px, if the file says so.
        body: the names of the keypoints without hands and face.
        notes: sentences on what else the file holds.
    """

    names: tuple[str, ...]
    points: Array
    size: tuple[int, int] | None
    body: tuple[str, ...]
    notes: tuple[str, ...]


def no_such_person(path: str | Path, person: int, count: int) -> UnknownName:
    """The error for a person who is not among the `count` people of a file."""
    known = [str(number) for number in range(count)] if count <= 5 else []
    hint = "" if known else f"0 to {count - 1}"
    people = f"{count:,} {'person' if count == 1 else 'people'}"
    more = f"{path} holds {people}, counted from 0"
    return UnknownName("person", str(person), known, hint=hint, more=more)
