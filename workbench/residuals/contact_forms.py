"""What a contact of a point with a surface says: a distance, an offset, or one in a plane.

A point p is in contact with a place s on a surface, and o = p - s is its offset. A form makes d
numbers of an offset, and says how they change with it while the contact is held.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadResidual

TOUCHING = 1e-9  # m: the direction of a shorter offset is one of rounding errors


@dataclass(frozen=True, eq=False)
class Offsets:
    """The offsets of M points from the places on a surface with which they are in contact.

    Attributes:
        vectors: (M, 3) m, o = p - s.
        normals: (M, 3) the unit normals of the surface at these places.
        distances: (M,) m, |o|, below zero behind the surface.
    """

    vectors: Array
    normals: Array
    distances: Array

    @property
    def directions(self) -> Array:
        """(M, 3) the unit vectors u with |o| = +-u . o; the normals where o is only rounding."""
        far = np.abs(self.distances) > TOUCHING
        found = self.normals.copy()
        found[far] = self.vectors[far] / self.distances[far, None]
        return found


@dataclass(frozen=True)
class Form:
    """How d numbers follow from the offset of a point, and how they change with it.

    Attributes:
        name: what a row is called.
        numbers: d, the numbers of each point.
        of: from offsets to the numbers (M, d) in m and their derivatives by the offset, (M, d, 3).
    """

    name: str
    numbers: int
    of: Callable[[Offsets], tuple[Array, Array]]


def _distance(o: Offsets) -> tuple[Array, Array]:
    return o.distances[:, None], o.directions[:, None]


def _offset(o: Offsets) -> tuple[Array, Array]:
    return o.vectors, np.broadcast_to(np.eye(3), (len(o.vectors), 3, 3))


def _plane(o: Offsets) -> tuple[Array, Array]:
    return np.einsum("mc,mc->m", o.normals, o.vectors)[:, None], o.normals[:, None]


distance = Form("distance", 1, _distance)
"""u . (p - s), the signed distance of the point from the surface: one number.

The direction u = (p - s) / |p - s| is held with the contact. Where the surface moves by ds, the
distance changes by -u . ds, whether or not s slides along the surface, because u is perpendicular
to it (the envelope theorem). The derivative with the contact held is therefore that of the distance
itself.
"""

offset = Form("offset", 3, _offset)
"""p - s, the vector from the surface to the point: three numbers.

Its length is the distance and its cost the same, but with the contact held a point is also kept
from sliding along the surface. Gauss-Newton takes shorter steps, and more of them.
"""

plane = Form("plane", 1, _plane)
"""n . (p - s), the distance from the tangent plane (Chen and Medioni, Object modelling by
registration of multiple range images, 1992): one number.

Inside a face it is the distance. On edges and at corners the plane is that of the pseudo-normal.
"""


def loose(share: float) -> Form:
    """The distance, of which only a share counts in front of the surface: one number.

    Points in front of the surface may lie on clothes, points behind it may not: a body is never
    outside of what it wears. Raises BadResidual for a share that is not from 0 to 1.
    """
    if not isinstance(share, (int, float)) or not 0 <= share <= 1:
        raise BadResidual(f"the share of a loose distance is a number from 0 to 1, not {share!r}")

    def of(o: Offsets) -> tuple[Array, Array]:
        counted = np.where(o.distances > 0, share, 1.0)[:, None]
        return counted * o.distances[:, None], counted[..., None] * o.directions[:, None]

    return Form("loose distance", 1, of)
