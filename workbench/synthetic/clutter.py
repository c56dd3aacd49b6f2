"""Clutter: points of a scan that do not belong to the person."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.errors import BadArgument
from workbench.synthetic.depth_images import NEAR, DepthImage
from workbench.synthetic.scan_effects import Region, unit_vectors
from workbench.synthetic.scanners import Scanner

DRAWN_AT_ONCE = 2048  # candidates of each thing, of which those that are seen are taken
MOST_ROUNDS = 200


class Thing(Protocol):
    """Something that scanners see beside a person."""

    def draw(self, surface: Array, n: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """`n` points (n, 3) m on it and their unit normals (n, 3), beside a surface (N, 3) m."""


@dataclass(frozen=True)
class Floor:
    """A disc of the floor at the height of the lowest vertex, around the middle of the body.

    `radius` is in m.

    >>> rng = np.random.default_rng(0)
    >>> Floor().draw(np.array([[0.0, -0.9, 0.0]]), 2, rng)[0][:, 1].tolist()
    [-0.9, -0.9]
    """

    radius: float = 0.6

    def draw(self, surface: Array, n: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """`n` points (n, 3) m, evenly distributed, and their normals (n, 3), which point up."""
        r, angle = self.radius * np.sqrt(rng.random(n)), 2 * np.pi * rng.random(n)
        x, _, z = _middle(surface)
        points = [x + r * np.sin(angle), np.full(n, surface[:, 1].min()), z + r * np.cos(angle)]
        return np.stack(points, axis=1), np.tile([0.0, 1.0, 0.0], (n, 1))


@dataclass(frozen=True)
class Crate:
    """A cube on the floor, beside the body.

    Attributes:
        size: in m, the length of its edges.
        away: in m, how far its middle is from that of the body.
        angle: in rad, in which direction, from +z to +x.

    >>> rng = np.random.default_rng(0)
    >>> points, _ = Crate(size=0.4).draw(np.zeros((1, 3)), 10_000, rng)
    >>> np.ptp(points, axis=0).round(3).tolist()
    [0.4, 0.4, 0.4]
    """

    size: float = 0.4
    away: float = 0.6
    angle: float = 0.7

    def draw(self, surface: Array, n: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """`n` points (n, 3) m, evenly distributed, and their normals (n, 3)."""
        side = rng.integers(6, size=n)
        inside = rng.uniform(-1, 1, (n, 3))
        normals = np.zeros((n, 3))
        normals[np.arange(n), side % 3] = np.where(side < 3, 1.0, -1.0)
        on_cube = np.where(normals != 0, normals, inside)
        middle = _middle(surface) + self.away * np.array(
            [np.sin(self.angle), 0, np.cos(self.angle)]
        )
        middle[1] = surface[:, 1].min() + self.size / 2
        return middle + self.size / 2 * on_cube, normals


@dataclass(frozen=True)
class Specks:
    """Loose points around the body: vertices displaced by `reach` m per axis, facing anywhere.

    >>> rng = np.random.default_rng(0)
    >>> points, _ = Specks(0.1).draw(np.zeros((1, 3)), 10_000, rng)
    >>> bool(0.095 < points.std() < 0.105)
    True
    """

    reach: float = 0.1

    def draw(self, surface: Array, n: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """`n` points (n, 3) m and their normals (n, 3)."""
        near = surface[rng.integers(len(surface), size=n)]
        return near + self.reach * rng.standard_normal((n, 3)), unit_vectors(
            rng.standard_normal((n, 3))
        )


@dataclass(frozen=True)
class Clutter:
    """Points of other things, which make up a `share` of all points of the scan.

    Each of the `things` gives about as many as another. They are where a scanner sees them: in its
    image, facing it, and not behind the body. They hide nothing of the body themselves. Raises
    BadArgument for a share below 0 or from 1 on, and if there are no things.

    >>> Clutter(0.2).count(8000)  # of 10,000 points
    2000
    """

    share: float = 0.2
    things: tuple[Thing, ...] = (Floor(), Crate(), Specks())

    def __post_init__(self) -> None:
        if not 0 <= self.share < 1 or not self.things:
            raise BadArgument(
                "clutter is a share from 0 to below 1 of the points, on one thing or more; not "
                f"{self.share:g} on {len(self.things)} things"
            )

    def count(self, n_body: int) -> int:
        """How many points of clutter go with so many points of the body."""
        return round(self.share / (1 - self.share) * n_body)


@dataclass(frozen=True, eq=False)
class Strewn:
    """Points of clutter as scanners see them, without noise.

    Attributes:
        points: (C, 3) m.
        normals: (C, 3) unit vectors, turned towards the scanner.
        view: (C,) the number of the scanner that sees each.
        error: (C,) numbers from a standard normal distribution, for the noise of each.
    """

    points: Array
    normals: Array
    view: Index
    error: Array

    def some(self, chosen: Mask | slice) -> "Strewn":
        """Those that a mask (C,) or a slice chooses."""
        return Strewn(
            self.points[chosen], self.normals[chosen], self.view[chosen], self.error[chosen]
        )


def strewn(
    clutter: Clutter,
    n: int,
    surface: Array,
    scanners: Sequence[Scanner],
    images: Sequence[DepthImage],
    region: Region | None,
    rng: np.random.Generator,
) -> Strewn:
    """`n` points of clutter beside a surface (N, 3) m, of which scanners made depth images.

    Those in the `region`, if there is one. With a larger n, the first points stay the same. Raises
    BadArgument if the scanners hardly see the things.
    """
    found: list[Strewn] = []
    for _ in range(MOST_ROUNDS):
        if sum(len(part.points) for part in found) >= n:
            break
        drawn = [thing.draw(surface, DRAWN_AT_ONCE, rng) for thing in clutter.things]
        points, normals = (np.concatenate(part) for part in zip(*drawn, strict=True))
        mixed = rng.permutation(len(points))
        points, normals = points[mixed], normals[mixed]
        sees = np.stack(
            [_sees(*one, points, normals) for one in zip(scanners, images, strict=True)], axis=1
        )
        view = np.argmax(np.where(sees, rng.random(sees.shape), -1.0), axis=1)
        seen = np.asarray(sees.any(axis=1))
        if region is not None:
            seen &= region.holds(points)
        found.append(Strewn(points, normals, view, rng.standard_normal(len(points))).some(seen))
    else:
        raise BadArgument(
            "the scanners see hardly anything of the clutter; bring its things nearer to the body, "
            f"or turn them to the scanners: {', '.join(map(str, clutter.things))}"
        )
    names = "points", "normals", "view", "error"
    empty = Strewn(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), np.zeros(0))
    parts = [empty, *found]
    together = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
    return Strewn(*together).some(slice(n))


def _sees(scanner: Scanner, image: DepthImage, points: Array, normals: Array) -> Mask:
    """Which points (C, 3) m, facing along normals (C, 3), a scanner sees beside what it images."""
    width, height = scanner.size
    buffer = np.full(scanner.n_pixels, np.inf)
    buffer[image.pixel] = image.depth
    seen = scanner.seen(points)
    x, y, z = seen.T
    before = z > NEAR
    z = np.where(before, z, 1.0)
    u = np.floor(scanner.focal * x / z + width / 2)
    v = np.floor(scanner.focal * y / z + height / 2)
    inside = before & (u >= 0) & (u < width) & (v >= 0) & (v < height)
    pixel = np.where(inside, v * width + u, 0).astype(np.int64)
    facing = np.einsum("mi,mi->m", normals, scanner.place - points) > 0
    return np.asarray(inside & facing & (z < buffer[pixel]))


def _middle(surface: Array) -> Array:
    return np.asarray((surface.min(axis=0) + surface.max(axis=0)) / 2)
