"""Distances between a scan and a model, whose contacts are chosen anew at every linearization."""

from dataclasses import dataclass, field

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from workbench.arrays import Array, Index
from workbench.blocks import Block, Points, PointSource
from workbench.blocks.checks import reals
from workbench.blocks.points import ExpressedPoints
from workbench.errors import BadResidual
from workbench.geometry.surface_tree import SurfaceTree
from workbench.residuals.contacts import (
    ContactNumbers,
    Form,
    MovingContacts,
    Offsets,
    Search,
    distance,
)
from workbench.residuals.kernels import Kernel, quadratic
from workbench.residuals.residual import Residual, expressed, named_after, numbered

FACING = 0.5  # cosine of the largest angle between normals in contact: 60 degrees


def scan_to_model(
    points: Points | cs.MX,
    faces: ArrayLike,
    scan: ArrayLike,
    *,
    sigma: float | Array,
    kernel: Kernel = quadratic,
    weights: ArrayLike | None = None,
    normals: ArrayLike | None = None,
    within: float = np.inf,
    facing: float = FACING,
    form: Form = distance,
    name: str | None = None,
) -> Residual:
    """min over s on the surface of |p_i - s| in metres, for every point p_i of a scan: E_S.

    `points` are the vertices (N, 3) of the surface: points of a body, or the symbol of a block
    whose rows may all be free; `faces` (F, 3) are its triangles, and `scan` (M, 3) m is fixed.

    At every linearization each point is compared with the place on the surface that is closest
    then. With u the direction from that place to the point, r = u . (p - s) is the signed distance,
    and its derivative with u and the contact held is the derivative of the distance to the moving
    surface (see `contacts.distance`). This is thus Gauss-Newton on the true cost, unlike the
    iterated closest points of Besl and McKay (1992), where the cost that is minimized changes
    between steps. `Problem.frozen(values)` holds the contacts and has a graph.

    Sigma is the noise of the scan in metres. Where outliers begin is the kernel's business:
    `scaled(geman_mcclure, 10)` has a scale of ten sigmas. The weight of a point (M,), such as the
    area that it stands for or its confidence, is outside of the kernel. A point farther than
    `within` metres from the surface has no contact; its distance is `within`, and constant. With
    oriented unit `normals` (M, 3) of the scan, only triangles whose normals have a cosine of at
    least `facing` with the point's are candidates; `within` must then be finite. `form` says which
    numbers a contact has: `distance`, `offset` (three rows) or `loose`.

    Raises BadResidual for arguments that do not fit, and NotNumbers.
    """
    name, source = _surface("scan_to_model", points, name)
    triangles = numbered(name, "faces (F", faces, 3, source.count)
    seen = vectors(name, "the scan", scan)
    oriented = None if normals is None else vectors(name, "the scan's normals", normals)
    if oriented is not None:
        lengths = np.linalg.norm(oriented, axis=1)
        if len(oriented) != len(seen) or not (lengths > 0).all():
            raise BadResidual(
                f"residual {name!r} needs a normal for each of {len(seen)} points, none of length "
                f"zero, not {len(oriented)}; leave out points that have none"
            )
        oriented = oriented / lengths[:, None]
    if not isinstance(within, (int, float, np.number)) or not within > 0:
        raise BadResidual(f"residual {name!r} needs a gate `within` above zero m, not {within!r}")
    if oriented is not None and not np.isfinite(within):
        raise BadResidual(
            f"residual {name!r} uses normals, so that a point may have no contact; say by "
            "`within`, in metres, what its distance is then, for example within=0.2"
        )
    if not isinstance(facing, (int, float, np.number)) or not -1 <= facing <= 1:
        raise BadResidual(f"residual {name!r} needs a cosine `facing` from -1 to 1, not {facing!r}")
    search = _OnModel(triangles, seen, oriented, within, facing, form)
    return _residual(name, source, search, len(seen), form.numbers, sigma, kernel, weights)


@dataclass(frozen=True, eq=False)
class _OnModel:
    """Contacts of a scan's points with the model's surface; see `Search`."""

    faces: Index
    scan: Array
    normals: Array | None
    within: float
    facing: float
    form: Form
    _trees: list[SurfaceTree] = field(default_factory=list)  # what is known of the faces alone

    def __call__(self, vertices: Array) -> ContactNumbers:
        """The contacts with vertices (N, 3) m at these places."""
        if not self._trees:
            self._trees.append(SurfaceTree(vertices, self.faces))
        tree = self._trees[0].moved(vertices)
        closest = tree.closest(self.scan, self.within, self.normals, self.facing)
        offsets = Offsets(self.scan - closest.points, closest.normals, closest.distances)
        numbers, directions = self.form.of(offsets)
        touched, d = np.flatnonzero(closest.faces >= 0), self.form.numbers
        missed = closest.faces < 0
        if missed.any():
            numbers = numbers.copy()
            numbers[missed] = 0.0
            numbers[missed, 0] = self.within

        def jacobian() -> csr_array:
            corners, shares = self.faces[closest.faces[touched]], closest.shares[touched]
            entries = -directions[touched, :, None, :] * shares[:, None, :, None]  # (m, d, 3, 3)
            columns = np.broadcast_to(3 * corners[:, None, :, None] + np.arange(3), entries.shape)
            entries_per_row = np.zeros((len(self.scan), d), dtype=np.int64)
            entries_per_row[touched] = 9  # three coordinates of three corners
            starts = np.concatenate([[0], np.cumsum(entries_per_row.ravel())])
            shape = len(self.scan) * d, vertices.size
            W = csr_array((entries.ravel(), columns.flatten(), starts), shape=shape)
            W.sort_indices()
            return W

        return ContactNumbers(numbers, ~missed, jacobian)


def _surface(function: str, points: Points | cs.MX, name: str | None) -> tuple[str, PointSource]:
    """The name that the residual of a function is to have, and the source of a surface's vertices.

    Raises BadResidual for points with neither arithmetic nor an expression.
    """
    name = name or named_after(function, points, points)
    if not isinstance(points, Points):
        expression, _ = expressed(points)
        blocks = tuple(Block.of(symbol) for symbol in cs.symvar(expression))
        return name, ExpressedPoints(expression, blocks)
    if points.source.numeric is None and points.source.expression is None:
        raise BadResidual(
            f"residual {name!r} needs points of a body, or an expression of blocks; these points "
            "have neither arithmetic nor an expression"
        )
    return name, points.source


def _residual(
    name: str,
    source: PointSource,
    search: Search,
    count: int,
    numbers: int,
    sigma: float | Array,
    kernel: Kernel,
    weights: ArrayLike | None,
) -> Residual:
    """The residual of `numbers` numbers of each of `count` points that a search compares."""
    arithmetic = source.numeric or ExpressedPoints(source.expression, source.blocks)
    placed = Points.of(MovingContacts(source, arithmetic, count, search), name, numbers)
    column = cs.vec(placed.symbol)
    return Residual(
        name, column, sigma, "m", kernel, (placed,), weights=weights, rows_per_point=numbers
    )


def vectors(name: str, what: str, value: ArrayLike) -> Array:
    """The finite numbers (M, 3) of an argument. Raises BadResidual for others."""
    array = np.ascontiguousarray(reals(f"residual {name!r}: {what}", value))
    if array.ndim != 2 or array.shape[1] != 3 or not len(array) or not np.isfinite(array).all():
        raise BadResidual(
            f"residual {name!r} needs {what} as finite numbers (M, 3), not an array of shape "
            f"{array.shape}" + (" with NaN or infinity" if not np.isfinite(array).all() else "")
        )
    return array


BESIDE = 0.03  # m, from the ray of a point of the scan: as near as this, space may not be empty
IN_FRONT = 0.03  # m, the same along the ray, in front of the point: noise and clothes
BUNDLE_WIDTH = 0.4  # of `beside`: the width of the bundles into which rays are put together
SPACINGS = 2.0  # times the spacing of the rays: the least `beside`
SPACING_NEIGHBOUR = 4  # the neighbour of a ray whose distance, in the median, is the spacing
SPACING_SAMPLE = 1_000  # rays over which the median is taken
BUNDLES_COMPARED = 8  # those nearest to a vertex, of which the least distance is taken


def free_space(
    points: Points | cs.MX,
    scan: ArrayLike,
    camera: ArrayLike,
    *,
    sigma: float | Array,
    kernel: Kernel = quadratic,
    beside: float = BESIDE,
    within: float = np.inf,
    name: str | None = None,
) -> Residual:
    """How far, in metres, each of N points of a model stands in space that was seen to be empty.

    `points` are vertices (N, 3) of a surface, `scan` (M, 3) m is all that was seen from the place
    `camera` (3,) m. A camera at c that measures a point p has looked through everything between c
    and p, and where it measured nothing it has looked past whatever there is. What is left is the
    shadow of the scan: the rays on from each p, into which a model belongs.

    With v = point - c, u the unit vector along a ray of the scan and d the distance at which its
    shadow begins, the residual is

        min over rays of sqrt(max(|v - (u . v) u| - beside, 0)^2 + max(d - 0.03 - |v|, 0)^2).

    `beside` (m) bridges the gaps between rays, and holes of the scan as wide as twice that; of a
    thin scan it is at least twice the spacing of the rays at the scan's median distance.
    Noise and clothes may stand 3 cm in front. A point that is farther than `within` (m) from all
    rays is out of view, and its residual 0: say so for a scan that was cut off, by the edge of an
    image or by hand, for what is beyond the cut is not empty.

    The derivative with the ray held is that of the distance. Rays are put together in bundles of
    0.4 `beside`; a bundle's shadow begins at the nearest of its points, and the eight bundles
    nearest to a point are compared (after Ganapathi, Plagemann, Koller and Thrun, Real-time human
    pose tracking from range data, ECCV 2012). Raises BadResidual or NotNumbers.
    """
    name, source = _surface("free_space", points, name)
    seen = vectors(name, "the scan", scan)
    place = vectors(name, "the camera's place", np.reshape(camera, (1, -1)))[0]
    if not min(beside, within) > 0:
        raise BadResidual(
            f"residual {name!r} needs margins above 0 m, not {beside:g} m beside the rays and "
            f"{within:g} m of view"
        )
    if not (np.linalg.norm(seen - place, axis=1) > 0).all():
        raise BadResidual(f"residual {name!r} has a point of the scan at the camera; leave it out")
    search = Shadow.of(seen, place, beside, within).distances
    return _residual(name, source, search, source.count, 1, sigma, kernel, None)


@dataclass(frozen=True, eq=False)
class Shadow:
    """What a camera could not see for the points of a scan; see `free_space`."""

    camera: Array  # (3,) m
    directions: Array  # (R, 3) unit vectors along bundles of rays
    begins: Array  # (R,) m from the camera, where the shadow of each bundle begins
    beside: float  # m, the margin beside the rays
    within: float  # m from the rays, what was in view
    tree: cKDTree  # finds directions

    @staticmethod
    def of(scan: Array, camera: Array, beside: float = BESIDE, within: float = np.inf) -> "Shadow":
        """The shadow of points (M, 3) m, none of them at the camera."""
        rays = scan - camera
        depth = np.linalg.norm(rays, axis=1)
        unit = rays / depth[:, None]
        beside = max(beside, SPACINGS * _spacing(unit) * float(np.median(depth)))
        width = BUNDLE_WIDTH * beside / float(np.median(depth))
        cells, bundle = np.unique(np.floor(unit / width), axis=0, return_inverse=True)
        sums, begins = np.zeros((len(cells), 3)), np.full(len(cells), np.inf)
        np.add.at(sums, bundle.ravel(), unit)
        np.minimum.at(begins, bundle.ravel(), depth)
        directions = sums / np.linalg.norm(sums, axis=1)[:, None]
        return Shadow(camera, directions, begins, beside, within, cKDTree(directions))

    def distances(self, vertices: Array) -> ContactNumbers:
        """How far vertices (N, 3) m are from the shadow, and its derivative; a `Search`."""
        v = vertices - self.camera
        lengths = np.maximum(np.linalg.norm(v, axis=1), np.finfo(float).tiny)
        k = range(1, min(BUNDLES_COMPARED, len(self.begins)) + 1)
        bundles = np.asarray(self.tree.query(v / lengths[:, None], k=k)[1])
        along = np.einsum("nki,ni->nk", self.directions[bundles], v)
        offsets = np.sqrt(np.maximum(lengths[:, None] ** 2 - along**2, 0))
        ahead = np.maximum(self.begins[bundles] - IN_FRONT - lengths[:, None], 0)
        best = (
            np.arange(len(v)),
            np.argmin(np.hypot(np.maximum(offsets - self.beside, 0), ahead), 1),
        )
        across = v - along[best][:, None] * self.directions[bundles[best]]  # of the best ray alone
        away = np.linalg.norm(across, axis=1)
        beyond, in_front = np.maximum(away - self.beside, 0), ahead[best]
        distance = np.where(offsets[:, 0] <= self.within, np.hypot(beyond, in_front), 0.0)

        def jacobian() -> csr_array:
            outside = np.flatnonzero(distance > 0)
            gradient = (beyond / np.maximum(away, self.beside))[outside, None] * across[outside]
            gradient -= (in_front / lengths)[outside, None] * v[outside]
            gradient /= distance[outside, None]
            starts = np.zeros(len(v) + 1, dtype=np.int64)
            np.cumsum(3 * (distance > 0), out=starts[1:])
            columns = (3 * outside[:, None] + np.arange(3)).ravel()
            return csr_array((gradient.ravel(), columns, starts), shape=(len(v), vertices.size))

        return ContactNumbers(distance[:, None], distance > 0, jacobian)


def _spacing(unit: Array) -> float:
    """How far rays are apart, in rad, by unit vectors (M, 3); 0 for less than five."""
    if len(unit) <= SPACING_NEIGHBOUR:
        return 0.0
    sample = unit[:: -(-len(unit) // SPACING_SAMPLE)]
    return float(np.median(cKDTree(unit).query(sample, k=[SPACING_NEIGHBOUR + 1])[0]))
