"""The keypoints of one person, as a file of a detector holds them."""

from dataclasses import dataclass

from workbench.arrays import Array


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
