"""Which axis of a scan points up, guessed from a standing person, and said in a sentence."""

import numpy as np

from workbench.arrays import Array
from workbench.errors import UnknownName
from workbench.fitting.scan_outline import TRIM, extents

TURNS: dict[str, Array] = {  # rotations that take the axis to y; what faces -y when z is up faces z
    "y": np.eye(3),
    "z": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "x": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "-y": np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]),
    "-z": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "-x": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
}
STANDING = (1.0, 2.3)  # m, from the floor to the head
LONGER = 1.3  # times as tall as the thinnest side
MIDDLE = 0.5  # the height of the mean of a person's surface, as a share: 0.48 to 0.57 of 9 in 10
UPRIGHT, UPSIDE_DOWN = 0.01, -0.03  # how far above the middle the mean is if one is sure of it


def up_axis(cells: Array, given: str | None, declared: str | None = None) -> tuple[str, str]:
    """Which axis of an outline (C, 3) m points up, and a sentence on why; `given` wins.

    `declared` is the axis that the file's format prescribes. The surface of a standing person
    spreads most along the height, with arms stretched to the sides as well, and its mean lies above
    the middle; if it does not clearly lie below it, the axis is taken to be positive, as most are.
    For what is no standing person y is taken. Raises UnknownName.
    """
    if given is not None:
        axis = given.removeprefix("+")
        if axis not in TURNS:
            raise UnknownName("axis", given, TURNS)
        return axis, f"the axis {axis} was given as up"
    if declared is not None:
        return declared, f"{declared} is up, as the format prescribes"
    sides, height = extents(cells, np.eye(3)), int(np.argmax(cells.std(axis=0)))
    if not (STANDING[0] <= sides[height] <= STANDING[1] and sides[height] > LONGER * sides.min()):
        return "y", (
            "y is taken to be up, for the scan is not of the form of a standing person, which "
            "would tell; give the axis if it is another"
        )
    low, high = np.percentile(cells[:, height], TRIM)
    above = (cells[:, height].mean() - low) / (high - low) - MIDDLE
    name = f"-{'xyz'[height]}" if above < UPSIDE_DOWN else "xyz"[height]
    why = (
        f"{name} is taken to be up: the scan is {sides[height]:.2f} m tall along it, as a person is"
    )
    if UPSIDE_DOWN <= above < UPRIGHT:
        why += ", but which end is the head is not clear"
    return name, why
