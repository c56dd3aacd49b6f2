"""A cloud of points as the target of a registration."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree

from workbench.arrays import Array
from workbench.errors import BadArgument
from workbench.geometry.surface_tree import Closest

MOST_TRIED = 16  # nearest points of a cloud among which one that faces the right way is looked for


class Target(Protocol):
    """What points are registered to: a `SurfaceTree` or a `PointCloud`."""

    def closest(
        self,
        points: Array,
        within: float = np.inf,
        normals: Array | None = None,
        facing: float = 0.5,
    ) -> Closest:
        """The closest place within a distance whose normal agrees with that of the point."""


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points (N, 3) m, with unit normals (N, 3) or without, as a target.

    Attributes:
        points: (N, 3) m.
        normals: (N, 3); without them, distances have no direction to compare with.

    Raises BadArgument for arrays of other shapes, or with numbers that are not finite.

    >>> cloud = PointCloud([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    >>> found = cloud.closest(np.array([[0.9, 0.2, 0.0]]))
    >>> found.faces, found.distances.round(3)
    (array([1]), array([0.224]))
    """

    points: Array
    normals: Array | None = None

    def __post_init__(self) -> None:
        for name in ("points", "normals"):
            given = getattr(self, name)
            if given is None:
                continue
            numbers = np.asarray(given, dtype=float)
            wrong = numbers.ndim != 2 or numbers.shape[1:] != (3,) or not len(numbers)
            if wrong or not np.isfinite(numbers).all():
                raise BadArgument(
                    f"the {name} of a cloud must be finite and of shape (N, 3) with N at least 1, "
                    f"not of shape {numbers.shape}; leave out points that were not measured"
                )
            object.__setattr__(self, name, numbers)
        if self.normals is not None and self.normals.shape != self.points.shape:
            raise BadArgument(
                f"a cloud of {len(self.points)} points was given {len(self.normals)} normals; "
                "give one for each point, or none"
            )

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.points)

    def closest(
        self,
        points: Array,
        within: float = np.inf,
        normals: Array | None = None,
        facing: float = 0.5,
    ) -> Closest:
        """The nearest point of the cloud to each of M points (M, 3) m.

        It is within `within` m, and if both sides have normals, theirs have a cosine of at least
        `facing`; of the nearest 16 points the first such one is taken. `faces` holds the numbers
        of the points, -1 where there is none. Distances are not negative, as a cloud has no inside.
        """
        compared = normals is not None and self.normals is not None
        count = min(MOST_TRIED, len(self.points)) if compared else 1
        asked = self._tree.query(points, k=[*range(1, count + 1)], distance_upper_bound=within)
        distances, numbers = np.asarray(asked[0]), np.asarray(asked[1])  # (M, count) both
        near = np.isfinite(distances)
        numbers = np.where(near, numbers, 0)
        if normals is not None and self.normals is not None:
            near &= np.einsum("mi,mki->mk", normals, self.normals[numbers]) >= facing
        rows, first = np.arange(len(points)), near.argmax(axis=1)
        found, chosen = near[rows, first], numbers[rows, first]
        own = np.zeros_like(self.points) if self.normals is None else self.normals
        there = found[:, None]
        return Closest(
            faces=np.where(found, chosen, -1),
            shares=there * np.array([1.0, 0.0, 0.0]),
            points=np.where(there, self.points[chosen], points),
            distances=np.where(found, distances[rows, first], within),
            normals=np.where(there, own[chosen], 0.0),
        )
