"""What makes scans difficult, one dataclass each: noise, holes, cuts, clutter.

Every effect has random numbers of its own, so that it can be switched off without changing another.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.blocks.checks import from_zero
from workbench.errors import BadArgument
from workbench.fitting.scans.surface import units
from workbench.geometry.solids import face_vectors
from workbench.synthetic.scanners import NEAREST_SEEN, DepthImage, Scanner

STEEPEST_MEASURED = np.radians(80)  # where the measurements of noise by angle end
FIELD_WAVES = 300  # that make up a smooth random field
DRAWN_AT_ONCE = 2048  # candidates of each thing, of which those that are seen are taken
MOST_ROUNDS = 200


@dataclass(frozen=True)
class Noise:
    """Errors of the depth, whose standard deviation grows with the depth z and the angle theta.

    The angle is that between the ray and the normal of the surface:

        sigma = floor + growth z^2 + grazing theta^2 / (pi / 2 - theta)^2 / sqrt(z)

    The second term is that of triangulated depth, with the coefficient of a Kinect (Khoshelham and
    Elberink, Sensors 12(2), 2012: about 4 cm at 5 m). The form of the third, and its coefficient,
    are from Nguyen, Izadi and Lovell (3DIMPVT 2012); beyond 80 degrees, where they did not measure,
    it stays as it is there. Raises BadArgument for a negative coefficient.

    Attributes:
        growth: in 1 / m.
        floor: in m, what remains near the scanner.
        grazing: in m^(3/2).
    """

    growth: float = 1.425e-3
    floor: float = 0.0
    grazing: float = 1e-4

    def __post_init__(self) -> None:
        from_zero("noise", growth=self.growth, floor=self.floor, grazing=self.grazing)

    def sigma(self, depth: Array, angle: Array) -> Array:
        """The standard deviations (...) m at depths (...) m and angles (...) rad."""
        theta = np.minimum(angle, STEEPEST_MEASURED)
        ratio = theta / (np.pi / 2 - theta)
        return np.asarray(
            self.floor + self.growth * depth**2 + self.grazing * ratio**2 / np.sqrt(depth)
        )


@dataclass(frozen=True)
class Holes:
    """Discs of the surface that no scanner sees, such as hair or what shines.

    Each disc is what lies within `radius` m of a random point of the surface and faces the same
    half of space. Raises BadArgument for a negative number.

    Attributes:
        count: the number of discs.
        radius: in m.
    """

    count: int = 6
    radius: float = 0.05

    def __post_init__(self) -> None:
        from_zero("holes", count=self.count, radius=self.radius)

    def discs(self, vertices: Array, faces: Index, rng: np.random.Generator) -> "Discs":
        """The discs on a surface (N, 3) m, (F, 3), drawn by area."""
        normals = face_vectors(vertices, faces)
        areas = np.linalg.norm(normals, axis=1)
        face = np.searchsorted(np.cumsum(areas) / areas.sum(), rng.random(self.count))
        shares = rng.dirichlet((1.0, 1.0, 1.0), self.count)
        return Discs(
            np.einsum("hk,hki->hi", shares, vertices[faces[face]]), normals[face], self.radius
        )


@dataclass(frozen=True, eq=False)
class Discs:
    """Discs around `centres` (H, 3) m that face along `normals` (H, 3), of one radius in m."""

    centres: Array
    normals: Array
    radius: float

    def hold(self, points: Array, normals: Array) -> Mask:
        """Which points (M, 3) m with normals (M, 3) lie in one of the discs."""
        inside = np.zeros(len(points), dtype=bool)
        for centre, normal in zip(self.centres, self.normals, strict=True):
            near = np.linalg.norm(points - centre, axis=1) < self.radius
            inside |= near & (normals @ normal > 0)
        return inside


@dataclass(frozen=True)
class HalfSpace:
    """What a scan is cut to: all from a `point` (3,) m on in a `direction` (3,).

    >>> HalfSpace((0, 0.2, 0), (0, 1, 0)).holds(np.array([[5, 0.3, 5], [0, 0.1, 0]])).tolist()
    [True, False]
    """

    point: tuple[float, float, float]
    direction: tuple[float, float, float]

    def holds(self, points: Array) -> Mask:
        """Which of the points (..., 3) m lie in it."""
        return np.asarray((points - np.array(self.point)) @ np.array(self.direction) >= 0)


def smooth_field(points: Array, spread: float, D: int, rng: np.random.Generator) -> Array:
    """D random functions of place at points (N, 3) m, (N, D), which vary over about `spread` m.

    Nearly a Gaussian process with the covariance exp(-|x - y|^2 / (2 spread^2)), as a sum of waves
    (Rahimi and Recht, NIPS 2007). It does not depend on the mesh.
    """
    waves = rng.standard_normal((FIELD_WAVES, 3)) / spread
    phases = rng.uniform(0, 2 * np.pi, FIELD_WAVES)
    heights = rng.standard_normal((FIELD_WAVES, D)) * np.sqrt(2 / FIELD_WAVES)
    return np.asarray(np.cos(points @ waves.T + phases) @ heights)


class Thing(Protocol):
    """Something that scanners see beside a person."""

    def draw(self, surface: Array, n: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """`n` points (n, 3) m on it and their unit normals (n, 3), beside a surface (N, 3) m."""


@dataclass(frozen=True)
class Floor:
    """A disc of the floor, of `radius` m, below the lowest vertex and the middle of the body."""

    radius: float = 0.6

    def draw(self, surface: Array, n: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """`n` points (n, 3) m, evenly distributed, and their normals (n, 3), which point up."""
        r, angle = self.radius * np.sqrt(rng.random(n)), 2 * np.pi * rng.random(n)
        x, _, z = _middle(surface)
        points = [x + r * np.sin(angle), np.full(n, surface[:, 1].min()), z + r * np.cos(angle)]
        return np.stack(points, axis=1), np.tile([0.0, 1.0, 0.0], (n, 1))


@dataclass(frozen=True)
class Crate:
    """A cube on the floor with edges of `size` m, `away` m from the middle of the body, in a
    direction that is `angle` rad from +z to +x.
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
    """Loose points around the body: vertices displaced by `reach` m per axis, facing anywhere."""

    reach: float = 0.1

    def draw(self, surface: Array, n: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """`n` points (n, 3) m and their normals (n, 3)."""
        near = surface[rng.integers(len(surface), size=n)]
        points = near + self.reach * rng.standard_normal((n, 3))
        return points, units(rng.standard_normal((n, 3)))


@dataclass(frozen=True)
class Clutter:
    """Points of other things, which make up a `share` of all points of the scan.

    Each of the `things` gives about as many as another. They are where a scanner sees them: in its
    image, facing it, and not behind the body. They hide nothing of the body themselves. Raises
    BadArgument for a share below 0 or from 1 on, and if there are no things.
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
class ClutterPoints:
    """C points of clutter as scanners see them: where they are without noise (C, 3) m, unit normals
    (C, 3), the number of the scanner that sees each (C,), and an error (C,) from a standard normal
    distribution, for the noise.
    """

    points: Array
    normals: Array
    view: Index
    error: Array


def scatter_clutter(
    clutter: Clutter,
    n: int,
    surface: Array,
    scanners: Sequence[Scanner],
    images: Sequence[DepthImage],
    region: HalfSpace | None,
    rng: np.random.Generator,
) -> ClutterPoints:
    """`n` points of clutter beside a surface (N, 3) m, of which scanners made depth images.

    Those in the `region`, if there is one. With a larger n, the first points stay the same. Raises
    BadArgument if the scanners hardly see the things.
    """
    nothing = np.zeros((0, 3))
    rounds: list[list[Array]] = [[nothing, nothing, np.zeros(0, dtype=np.int64), np.zeros(0)]]
    for _ in range(MOST_ROUNDS):
        if sum(len(part[0]) for part in rounds) >= n:
            break
        drawn = [thing.draw(surface, DRAWN_AT_ONCE, rng) for thing in clutter.things]
        points, normals = (np.concatenate(part) for part in zip(*drawn, strict=True))
        mixed = rng.permutation(len(points))
        points, normals = points[mixed], normals[mixed]
        sees = np.stack(
            [_sees(*pair, points, normals) for pair in zip(scanners, images, strict=True)], axis=1
        )
        view = np.argmax(np.where(sees, rng.random(sees.shape), -1.0), axis=1)
        seen = np.asarray(sees.any(axis=1))
        if region is not None:
            seen &= region.holds(points)
        error = rng.standard_normal(len(points))
        rounds.append([part[seen] for part in (points, normals, view, error)])
    else:
        raise BadArgument(
            "the scanners see hardly anything of the clutter; bring its things nearer to the body, "
            f"or turn them to the scanners: {', '.join(map(str, clutter.things))}"
        )
    return ClutterPoints(*(np.concatenate(parts)[:n] for parts in zip(*rounds, strict=True)))


def _sees(scanner: Scanner, image: DepthImage, points: Array, normals: Array) -> Mask:
    """Which points (C, 3) m, facing along normals (C, 3), a scanner sees beside what it images."""
    width, height = scanner.size
    buffer = np.full(scanner.n_pixels, np.inf)
    buffer[image.pixel] = image.depth
    seen = scanner.seen(points)
    x, y, z = seen.T
    before = z > NEAREST_SEEN
    z = np.where(before, z, 1.0)
    u = np.floor(scanner.focal * x / z + width / 2)
    v = np.floor(scanner.focal * y / z + height / 2)
    inside = before & (u >= 0) & (u < width) & (v >= 0) & (v < height)
    pixel = np.where(inside, v * width + u, 0).astype(np.int64)
    facing = np.einsum("mi,mi->m", normals, scanner.place - points) > 0
    return np.asarray(inside & facing & (z < buffer[pixel]))


def _middle(surface: Array) -> Array:
    return np.asarray((surface.min(axis=0) + surface.max(axis=0)) / 2)
