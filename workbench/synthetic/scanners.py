"""Scanners: where they stand, which way they look, and how many rays they send."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.errors import BadArgument
from workbench.fitting.observations import pinhole

FOCAL, SIZE = 164.0, (150, 200)  # px: the field of view of a Kinect that stands on its side
STEEPEST_VIEW = 0.99  # the sine of the angle from the horizontal at which a scanner still has an up


@dataclass(frozen=True, eq=False)
class Scanner:
    """A pinhole that measures depth: one ray goes through the middle of every pixel.

    The middle of the pixel in column i and row j is at (i + 1/2, j + 1/2) px, and the optical axis
    goes through the middle of the image. Raises BadArgument for an image without pixels, a focal
    length that is not above zero, or a window below 1 px.

    Attributes:
        R: (3, 3) the rotation from the world to the scanner (x right, y down, z forward).
        t: (3,) m, the translation from the world to the scanner.
        focal: the focal length in px.
        size: width and height of the depth image in px.
        window: how many pixels to each side take part in the estimate of a normal.

    >>> front, *_ = scanners(4, distance=2.0)
    >>> front.place.round(6).tolist(), front.directions().shape
    ([0.0, 0.0, 2.0], (30000, 3))
    """

    R: Array
    t: Array
    focal: float = FOCAL
    size: tuple[int, int] = SIZE
    window: int = 1

    def __post_init__(self) -> None:
        if not (self.focal > 0 and min(self.size) >= 1 and self.window >= 1):
            raise BadArgument(
                "a scanner has a focal length above 0 px, an image of at least one pixel and a "
                f"window of at least 1 px, not {self.focal:g}, {self.size} and {self.window}"
            )

    @property
    def K(self) -> Array:
        """The matrix (3, 3) px of the pinhole."""
        return pinhole(self.focal, *self.size)

    @property
    def place(self) -> Array:
        """Where it stands, (3,) m in the world."""
        return np.asarray(-self.R.T @ self.t)

    @property
    def n_pixels(self) -> int:
        """The number of pixels, which is the number of rays."""
        return self.size[0] * self.size[1]

    def seen(self, points: Array) -> Array:
        """World points (..., 3) m in the scanner's frame, whose z is the depth."""
        return np.asarray(points @ self.R.T + self.t)

    def rays(self) -> Array:
        """The rays (pixels, 3) of all pixels, row after row, in the scanner's frame, with z = 1."""
        (width, height), K = self.size, self.K
        u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        x, y = (u.ravel() - K[0, 2]) / self.focal, (v.ravel() - K[1, 2]) / self.focal
        return np.stack([x, y, np.ones_like(x)], axis=1)

    def directions(self) -> Array:
        """The rays (pixels, 3) in the world; a point of depth z is at `place` + z `directions`."""
        return np.asarray(self.rays() @ self.R)


def scanners(
    n: int,
    *,
    distance: float = 2.0,
    height: float = 0.0,
    target: ArrayLike = (0.0, 0.0, 0.0),
    turn: float = 0.0,
    focal: float = FOCAL,
    size: tuple[int, int] = SIZE,
    window: int = 1,
) -> tuple[Scanner, ...]:
    """`n` scanners evenly around a `target` (3,) m, all looking at it, upright.

    They stand at a horizontal `distance` and `height` above it, both in m. The first is in front of
    a body that faces +z, turned about it by `turn` rad; the others follow in the direction from +z
    to +x, so that the second of four sees the body's left side. Raises BadArgument for less than
    one scanner, or if they would look straight down or up.
    """
    middle = np.asarray(target, dtype=float)
    if n < 1 or middle.shape != (3,):
        raise BadArgument(
            f"one scanner or more look at a target (3,) m; {n} and {middle.shape} were given"
        )
    if not distance > 0 or abs(height) > STEEPEST_VIEW * np.hypot(distance, height):
        raise BadArgument(
            f"scanners at a distance of {distance:g} m and a height of {height:g} m would look "
            "straight down or up, and have no upright image; move them away"
        )
    found = []
    for angle in turn + 2 * np.pi * np.arange(n) / n:
        away = np.array([distance * np.sin(angle), height, distance * np.cos(angle)])
        forward = -away / np.linalg.norm(away)
        right = np.cross(forward, [0.0, 1.0, 0.0])
        right /= np.linalg.norm(right)
        R = np.stack([right, np.cross(forward, right), forward])
        found.append(Scanner(R, -R @ (middle + away), focal, size, window))
    return tuple(found)
