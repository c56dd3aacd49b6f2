"""Which axis of a scan points up, guessed from a standing person, and said in a sentence."""

import numpy as np

from workbench.arrays import Array
from workbench.errors import UnknownName
from workbench.fitting.scans.surface import TRIM, extents
from workbench.geometry.guesses import UP_TO_Y

STANDING = (1.0, 2.3)  # m, from the floor to the head
LONGER = 1.3  # times as tall as the thinnest side
END = 0.06  # of the height: the feet at one end, the head at the other
FLOOR = 0.1  # of the height, at either end
ABOVE, WIDER = 11.0, 0.5  # what the two signs of a head count
SURE = 0.2  # of their sum
# Of 160 simulated scans of poses from motion capture, by one camera and by four, 2 % would be
# turned over wrongly and 88 % rightly; with a floor, a crate and loose points 1 % and 79 %; and
# nearly all of these wrongly if FLOOR were 0.


def up_axis(cells: Array, given: str | None, declared: str | None = None) -> tuple[str, str]:
    """Which axis of an outline (C, 3) m points up, and a sentence on why; `given` wins.

    `declared` is the axis that the file's format prescribes. The surface of a standing person
    spreads most along the height, with arms stretched to the sides as well. The axis is positive,
    as most are, unless the form clearly says that the head is at its other end. For what is no
    standing person y is taken. Raises UnknownName.
    """
    if given is not None:
        axis = given.removeprefix("+")
        if axis not in UP_TO_Y:
            raise UnknownName("axis", given, UP_TO_Y)
        return axis, f"the axis {axis} was given as up"
    if declared is not None:
        return declared, f"{declared} is up, as the format prescribes"
    sides, height = extents(cells, np.eye(3)), int(np.argmax(cells.std(axis=0)))
    if not (STANDING[0] <= sides[height] <= STANDING[1] and sides[height] > LONGER * sides.min()):
        return "y", (
            "y is taken to be up, for the scan is not of the form of a standing person, which "
            "would tell; give the axis if it is another"
        )
    upright = _upright(cells, height)
    name = f"-{'xyz'[height]}" if upright < -SURE else "xyz"[height]
    tall = f"{sides[height]:.2f} m tall along it"
    why = f"{name} is taken to be up: the scan is {tall}, as a person is"
    return name, why if abs(upright) > SURE else f"{why}, but which end is the head is not clear"


def _upright(cells: Array, axis: int) -> float:
    """How clearly the head is at the end of an axis: above 0 if it is, below if the feet are.

    The mean of a person's surface lies above the middle, and two feet lie farther apart than the
    two sides of a head. A tenth of the height at either end does not count for the mean, so that a
    floor does not: it would make the end with the feet look like that with the head.
    """
    low, high = np.percentile(cells[:, axis], TRIM)
    heights = (cells[:, axis] - low) / (high - low)
    across = np.delete(cells, axis, axis=1)
    feet, head = (
        np.sqrt(across[end].var(axis=0).sum()) if end.sum() > 3 else (high - low) / 50
        for end in (heights < END, heights > 1 - END)
    )
    body = heights[(heights > FLOOR) & (heights < 1 - FLOOR)]
    return float(ABOVE * (body.mean() - 0.5) + WIDER * np.log(feet / head)) if len(body) else 0.0
