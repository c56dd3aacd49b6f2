"""Space that a camera looked through: it saw something farther away, or nothing at all."""

from dataclasses import dataclass

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from workbench.arrays import Array
from workbench.blocks import Points
from workbench.errors import BadResidual
from workbench.residuals.contacts import ContactNumbers
from workbench.residuals.kernels import Kernel, quadratic
from workbench.residuals.residual import Residual
from workbench.residuals.scans import Surface, vectors

BESIDE = 0.03  # m, from the ray of a point of the scan: as near as this, space may not be empty
BEFORE = 0.03  # m, the same along the ray, before the point
CELL = 0.4  # of `beside`: the width of the bundles into which rays are put together
GAPS = 2.0  # times the spacing of the rays: the least `beside`
NEIGHBOUR, SOME = 4, 1_000  # the neighbour of a ray, in the median over some, that is its spacing
CANDIDATES = 8  # bundles near a vertex, of which the least distance is taken


def free_space(
    points: Points | cs.MX,
    scan: ArrayLike,
    camera: ArrayLike,
    *,
    sigma: float | Array,
    kernel: Kernel = quadratic,
    beside: float = BESIDE,
    before: float = BEFORE,
    within: float = np.inf,
    name: str | None = None,
) -> Residual:
    """How far, in metres, each of N points of a model stands in space that was seen to be empty.

    `points` are vertices (N, 3) of a surface, `scan` (M, 3) m is all that was seen from the place
    `camera` (3,) m. A camera at c that measures a point p has looked through everything between c
    and p, and where it measured nothing it has looked past whatever there is. What is left is the
    shadow of the scan: the rays on from each p. A model belongs into it, its front and all that is
    hidden behind. Distances from the scan to the model say nothing of that, for they ask only for
    what was seen.

    With v = point - c, u the unit vector along a ray of the scan and d the distance at which its
    shadow begins, the residual is

        min over rays of sqrt(max(|v - (u . v) u| - beside, 0)^2 + max(d - before - |v|, 0)^2).

    `beside` (m) bridges the gaps between rays, and holes of the scan as wide as twice that; of a
    thin scan it is at least twice the spacing of the rays at the scan's median distance.
    `before` (m) is what noise and clothes may stand in front. A point that is farther than `within`
    (m) from all rays is out of view, and its residual 0: say so for a scan that was cut off, by the
    edge of an image or by hand, for what is beyond the cut is not empty.

    The derivative with the ray held is that of the distance, as in `scan_to_model`. Rays are put
    together in bundles of 0.4 `beside`; a bundle's shadow begins at the nearest of its points, and
    the eight bundles nearest to a point are compared. Free space is used like this to track people
    by Ganapathi, Plagemann, Koller and Thrun (Real-time human pose tracking from range data, ECCV
    2012).

    Raises BadResidual for arguments that do not fit, and NotNumbers.
    """
    surface = Surface.of("free_space", points, name)
    name = surface.name
    seen = vectors(name, "the scan", scan)
    place = vectors(name, "the camera's place", np.reshape(camera, (1, -1)))[0]
    if not min(beside, before, within) > 0:
        raise BadResidual(
            f"residual {name!r} needs margins above 0 m, not {beside:g} m beside the rays, "
            f"{before:g} m before the points and {within:g} m of view"
        )
    if not (np.linalg.norm(seen - place, axis=1) > 0).all():
        raise BadResidual(f"residual {name!r} has a point of the scan at the camera; leave it out")
    search = Shadow.of(seen, place, beside, before, within).distances
    return surface.residual(search, surface.source.count, 1, sigma, kernel, None)


@dataclass(frozen=True, eq=False)
class Shadow:
    """What a camera at `camera` (3,) m could not see for the points of a scan; see `free_space`.

    Attributes:
        camera: (3,) m.
        directions: (R, 3) unit vectors along bundles of rays.
        begins: (R,) m from the camera, where the shadow of each bundle begins.
        beside, before: in m, the margins.
        within: in m from the rays, what was in view.
        tree: finds directions.
    """

    camera: Array
    directions: Array
    begins: Array
    beside: float
    before: float
    within: float
    tree: cKDTree

    @staticmethod
    def of(
        scan: Array,
        camera: Array,
        beside: float = BESIDE,
        before: float = BEFORE,
        within: float = np.inf,
    ) -> "Shadow":
        """The shadow of points (M, 3) m, none of them at the camera."""
        rays = scan - camera
        depth = np.linalg.norm(rays, axis=1)
        unit = rays / depth[:, None]
        beside = max(beside, GAPS * _spacing(unit) * float(np.median(depth)))
        width = CELL * beside / float(np.median(depth))
        cells, bundle = np.unique(np.floor(unit / width), axis=0, return_inverse=True)
        sums, begins = np.zeros((len(cells), 3)), np.full(len(cells), np.inf)
        np.add.at(sums, bundle.ravel(), unit)
        np.minimum.at(begins, bundle.ravel(), depth)
        directions = sums / np.linalg.norm(sums, axis=1)[:, None]
        return Shadow(camera, directions, begins, beside, before, within, cKDTree(directions))

    def distances(self, vertices: Array) -> ContactNumbers:
        """How far vertices (N, 3) m are from the shadow, and its derivative; a `Search`."""
        v = vertices - self.camera
        far = np.maximum(np.linalg.norm(v, axis=1), np.finfo(float).tiny)
        k = range(1, min(CANDIDATES, len(self.begins)) + 1)
        at = np.asarray(self.tree.query(v / far[:, None], k=k)[1])
        along = np.einsum("nki,ni->nk", self.directions[at], v)
        off = np.sqrt(np.maximum(far[:, None] ** 2 - along**2, 0))
        ahead = np.maximum(self.begins[at] - self.before - far[:, None], 0)
        best = np.arange(len(v)), np.argmin(np.hypot(np.maximum(off - self.beside, 0), ahead), 1)
        across = v - along[best][:, None] * self.directions[at[best]]  # of the best ray alone
        away = np.linalg.norm(across, axis=1)
        aside, before = np.maximum(away - self.beside, 0), ahead[best]
        distance = np.where(off[:, 0] <= self.within, np.hypot(aside, before), 0.0)

        def slopes() -> csr_array:
            there = np.flatnonzero(distance > 0)
            slope = (aside / np.maximum(away, self.beside))[there, None] * across[there]
            slope -= (before / far)[there, None] * v[there]
            slope /= distance[there, None]
            starts = np.zeros(len(v) + 1, dtype=np.int64)
            np.cumsum(3 * (distance > 0), out=starts[1:])
            columns = (3 * there[:, None] + np.arange(3)).ravel()
            return csr_array((slope.ravel(), columns, starts), shape=(len(v), vertices.size))

        return ContactNumbers(distance[:, None], distance > 0, slopes)


def _spacing(unit: Array) -> float:
    """How far rays are apart, in rad, by unit vectors (M, 3); 0 for less than five."""
    if len(unit) <= NEIGHBOUR:
        return 0.0
    some = unit[:: -(-len(unit) // SOME)]
    return float(np.median(cKDTree(unit).query(some, k=[NEIGHBOUR + 1])[0]))
