"""What makes scans difficult, one dataclass each: noise, holes, clothing, cuts, joined triangles.

Every effect has random numbers of its own, so that it can be switched off without changing another.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr

from workbench.arrays import Array, Index, Mask
from workbench.errors import BadArgument
from workbench.geometry.solids import face_vectors

STEEPEST_MEASURED = np.radians(80)  # where the measurements of noise by angle end
WAVES = 300  # that make up a smooth random field


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

    >>> Noise().sigma(np.array([1.0, 2.0]), np.zeros(2)).round(5).tolist()
    [0.00142, 0.0057]
    """

    growth: float = 1.425e-3
    floor: float = 0.0
    grazing: float = 1e-4

    def __post_init__(self) -> None:
        _check_positive("noise", growth=self.growth, floor=self.floor, grazing=self.grazing)

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

    >>> from workbench.synthetic import scan, scanners
    >>> wall, faces = np.array([[-9.0, -9, 0], [9, -9, 0], [0, 9, 0]]), np.array([[0, 1, 2]])
    >>> whole = scan(wall, faces, scanners(1), seed=0).scan.n_points
    >>> scan(wall, faces, scanners(1), seed=0, holes=Holes(200, 0.3)).scan.n_points < whole
    True
    """

    count: int = 6
    radius: float = 0.05

    def __post_init__(self) -> None:
        _check_positive("holes", count=self.count, radius=self.radius)

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


@dataclass(frozen=True, eq=False)
class Clothing:
    """A smooth offset of the surface outwards, between 0 and `thickest` m.

    Raises BadArgument for negative numbers, or a spread of zero.

    Attributes:
        thickest: in m, the offset that the field comes near to where it is largest.
        spread: in m, over about which distance it varies.
        where: (N,) from 0 to 1, by which the offset of each vertex is multiplied; None for 1.
            `clothed` gives the torso, the upper arms and the legs of a body.

    >>> places = np.random.default_rng(0).uniform(-1, 1, (1000, 3))
    >>> offsets = Clothing(0.02).offsets(places, np.random.default_rng(1))
    >>> bool(offsets.min() >= 0), bool(0.015 < offsets.max() <= 0.02)
    (True, True)
    """

    thickest: float = 0.02
    spread: float = 0.1
    where: Array | None = None

    def __post_init__(self) -> None:
        _check_positive("clothing", thickest=self.thickest, spread=self.spread)
        if not self.spread:
            raise BadArgument("the offset of clothing varies over a spread above 0 m")

    def offsets(self, vertices: Array, rng: np.random.Generator) -> Array:
        """The offset of every vertex, (N,) m, none of them negative.

        A smooth random field, from which the normal distribution function makes numbers that are
        spread evenly between 0 and 1. Raises BadArgument if `where` has another shape or other
        numbers.
        """
        N = len(vertices)
        where = np.ones(N) if self.where is None else self.where
        if where.shape != (N,) or not ((where >= 0) & (where <= 1)).all():
            raise BadArgument(
                f"where clothing is worn is given by numbers from 0 to 1, one for each of the {N} "
                f"vertices, not by an array {where.shape}"
            )
        field = smooth_field(vertices, self.spread, 1, rng)[:, 0]
        return np.asarray(self.thickest * ndtr(field) * where)


class Region(Protocol):
    """A part of space, which a partial scan is cut to."""

    def holds(self, points: Array) -> Mask:
        """Which of the points (..., 3) m lie in it."""


@dataclass(frozen=True)
class HalfSpace:
    """What lies from a `point` (3,) m on in a `direction` (3,).

    >>> HalfSpace((0, 0.2, 0), (0, 1, 0)).holds(np.array([[5, 0.3, 5], [0, 0.1, 0]])).tolist()
    [True, False]
    """

    point: tuple[float, float, float]
    direction: tuple[float, float, float]

    def holds(self, points: Array) -> Mask:
        """Which of the points (..., 3) m lie in it."""
        return np.asarray((points - np.array(self.point)) @ np.array(self.direction) >= 0)


@dataclass(frozen=True)
class Box:
    """What lies between two corners, `lower` and `upper`, (3,) m each.

    >>> Box((-1, -1, -1), (0, 1, 1)).holds(np.array([[-0.5, 0, 0], [0.5, 0, 0]])).tolist()
    [True, False]
    """

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]

    def holds(self, points: Array) -> Mask:
        """Which of the points (..., 3) m lie in it."""
        inside = (points >= np.array(self.lower)) & (points <= np.array(self.upper))
        return np.asarray(inside.all(axis=-1))


def smooth_field(points: Array, spread: float, D: int, rng: np.random.Generator) -> Array:
    """D random functions of place at points (N, 3) m, (N, D), which vary over about `spread` m.

    Nearly a Gaussian process with the covariance exp(-|x - y|^2 / (2 spread^2)), as a sum of waves
    (Rahimi and Recht, NIPS 2007). It does not depend on the mesh.
    """
    waves = rng.standard_normal((WAVES, 3)) / spread
    phases = rng.uniform(0, 2 * np.pi, WAVES)
    heights = rng.standard_normal((WAVES, D)) * np.sqrt(2 / WAVES)
    return np.asarray(np.cos(points @ waves.T + phases) @ heights)


def unit_vectors(vectors: ArrayLike) -> Array:
    """Vectors (..., 3) divided by their lengths."""
    found = np.asarray(vectors, dtype=float)
    return np.asarray(found / np.linalg.norm(found, axis=-1, keepdims=True))


def _check_positive(what: str, **numbers: float) -> None:
    for name, number in numbers.items():
        if not 0 <= number < np.inf:
            raise BadArgument(f"the {name} of {what} must be a number from 0 on, not {number:g}")
