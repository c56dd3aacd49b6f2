"""Scans of a surface by depth cameras, simulated, with everything known that a scan does not say.

Each scanner sees what the rays of its pixels hit first, so that parts of the body that touch or
hide each other are scanned as they would be: only the outermost surface gives points.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index, Mask
from workbench.blocks.checks import above_zero, from_zero, numbers, reals, several
from workbench.fitting.scans.scan import BadScan, Scan
from workbench.fitting.scans.surface import units
from workbench.geometry.meshes import Mesh
from workbench.geometry.solids import face_vectors, vertex_normals
from workbench.synthetic.scan_effects import (
    Clutter,
    ClutterPoints,
    HalfSpace,
    Holes,
    Noise,
    scatter_clutter,
)
from workbench.synthetic.scanners import DepthImage, Scanner, depth_image, visible

LARGEST_JUMP = 5.0  # steps from pixel to pixel: depths that differ by more are of two surfaces
LINE_VARIANCE = 1e-6  # of the largest variance: neighbours whose second is less lie on a line
LEAST_COSINE = 0.1736  # of 80 degrees: beyond, the area behind a pixel is not known
HOLES, CLUTTER, NOISE = range(1, 4)  # each effect has a stream of random numbers of its own


@dataclass(frozen=True)
class Joining:
    """How neighbouring pixels are joined to triangles.

    Attributes:
        jump: by how many steps from pixel to pixel, z / focal m each, the depths of the corners of
            a triangle may differ. With fewer, the scan falls into more pieces.
    """

    jump: float = LARGEST_JUMP

    def triangles(self, pixel: Index, depth: Array, scanner: Scanner) -> Index:
        """Triangles (T, 3) of indices from 0 to M - 1 of measured pixels (M,) at depths (M,) m.

        Every square of four pixels is cut into two triangles, counterclockwise as the scanner sees
        them. A triangle is kept if its three corners were measured, with no jump between them.
        """
        width, height = scanner.size
        number = np.full(scanner.n_pixels, -1)
        number[pixel] = np.arange(len(pixel))
        grid = number.reshape(height, width)
        a, b, c, d = (
            part.ravel() for part in (grid[:-1, :-1], grid[1:, :-1], grid[:-1, 1:], grid[1:, 1:])
        )
        corners = np.concatenate([np.stack([a, b, c], axis=1), np.stack([c, b, d], axis=1)])
        corners = corners[(corners >= 0).all(axis=1)]
        z = depth[corners]
        low, high = z.min(axis=1), z.max(axis=1)
        return np.asarray(corners[high - low <= self.jump * low / scanner.focal])


def estimated_normals(pixel: Index, depth: Array, scanner: Scanner) -> Array:
    """Unit normals (M, 3) in the world of measured pixels (M,), turned towards the scanner.

    Planes are fitted to each measured pixel and the eight around it, without those beyond a jump of
    the depth. A pixel without such neighbours, or with neighbours on one line, has a normal that
    points to the scanner.
    """
    width, height = scanner.size
    rays = scanner.directions()[pixel]
    points = depth[:, None] * rays  # relative to the scanner
    number = np.full((height + 2, width + 2), -1)
    row, column = np.divmod(pixel, width)
    number[row + 1, column + 1] = np.arange(len(pixel))
    count, first = np.zeros(len(pixel)), np.zeros((len(pixel), 3))
    second = np.zeros((len(pixel), 3, 3))
    for down, right in product(range(3), repeat=2):
        other = number[row + down, column + right]
        near = np.abs(depth[other] - depth) <= LARGEST_JUMP * depth / scanner.focal
        weight = ((other >= 0) & near).astype(float)
        away = (points[other] - points) * weight[:, None]
        count, first = count + weight, first + away
        second += away[:, :, None] * away[:, None, :]
    mean = first / count[:, None]
    covariance = second / count[:, None, None] - mean[:, :, None] * mean[:, None, :]
    variances, axes = np.linalg.eigh(covariance)
    plane = (count >= 3) & (variances[:, 1] > LINE_VARIANCE * variances[:, 2])
    back = -rays / np.linalg.norm(rays, axis=1, keepdims=True)
    normals = np.where(plane[:, None], axes[:, :, 0], back)
    return np.where(np.einsum("mi,mi->m", normals, back)[:, None] < 0, -normals, normals)


def areas(depth: Array, normals: Array, directions: Array, focal: float) -> Array:
    """The surface (M,) m^2 behind each pixel: z^2 / focal^2 / |n.d|, for a ray d whose depth is 1.

    As normals (M, 3) are uncertain at grazing angles, no angle counts as more than 80 degrees.
    """
    cosine = np.abs(np.einsum("mi,mi->m", normals, directions))
    least = LEAST_COSINE * np.linalg.norm(directions, axis=1)
    return np.asarray((depth / focal) ** 2 / np.maximum(cosine, least))


@dataclass(frozen=True, eq=False)
class MeasuredView:
    """The H points that one scanner measured of N vertices, with the truth; see `SimulatedScan`.

    `triangles` (T, 3) are of the numbers of points, and `image` is that of the whole surface.
    """

    points: Array
    normals: Array
    weights: Array
    triangles: Index
    face: Index
    shares: Array
    seen: Mask
    image: DepthImage


def measured_view(
    surface: Array,
    faces: Index,
    scanner: Scanner,
    is_measured: Callable[[Array, Array, Scanner], Mask],
    noise: Noise | None,
    errors: Array,
    joining: Joining | None,
) -> MeasuredView:
    """What a scanner measures of a surface (N, 3) m, (F, 3).

    `is_measured` says which points (M, 3) m with unit normals (M, 3) are, although nothing is
    before them; `errors` holds a number from a standard normal distribution for every pixel.
    """
    image = depth_image(surface, faces, scanner)
    normals = units(face_vectors(surface, faces[image.face]))
    hit = np.einsum("hk,hki->hi", image.shares, surface[faces[image.face]])
    left = is_measured(hit, normals, scanner)
    pixel, depth = image.pixel[left], image.depth[left]
    depth = noisy(depth, angles(hit, normals, scanner)[left], noise, errors[pixel])
    rays = scanner.directions()[pixel]
    estimated = estimated_normals(pixel, depth, scanner)
    none = np.zeros((0, 3), dtype=np.int64)
    around = vertex_normals(surface, faces)
    return MeasuredView(
        points=scanner.place + depth[:, None] * rays,
        normals=estimated,
        weights=areas(depth, estimated, rays, scanner.focal),
        triangles=none if joining is None else joining.triangles(pixel, depth, scanner),
        face=image.face[left],
        shares=image.shares[left],
        seen=visible(surface, faces, scanner) & is_measured(surface, around, scanner),
        image=image,
    )


def noisy(depth: Array, angle: Array, noise: Noise | None, errors: Array) -> Array:
    """Depths (M,) m with the errors (M,), which are in standard deviations of the noise."""
    return depth if noise is None else depth + noise.sigma(depth, angle) * errors


def angles(points: Array, normals: Array, scanner: Scanner) -> Array:
    """The angles (M,) rad, of at most a right angle, between rays and normals, (M, 3) m each."""
    rays = units(points - scanner.place)
    return np.asarray(np.arccos(np.abs(np.einsum("mi,mi->m", rays, normals)).clip(0, 1)))


@dataclass(frozen=True, eq=False)
class SimulatedScan:
    """A scan of M points, and the truth about each of them and about the N vertices.

    Attributes:
        scan: what the scanners give. The weights are the areas behind the pixels of each view, so
            that what two scanners see counts twice.
        view: (M,) the number of the scanner that each point comes from.
        clutter: (M,) which points do not belong to the body.
        face: (M,) the face on which the ray of each point hit the surface; -1 for clutter.
        shares: (M, 3) the barycentric coordinates of that place; 0 for clutter.
        surface: (N, 3) m, what was scanned.
        faces: (F, 3) those of the surface.
        seen: (N,) which vertices some scanner saw, at whatever resolution: in its image, with
            nothing before them, not in a hole, not too steep, and not cut off.
        scanners: the scanners, in the order of their numbers.
    """

    scan: Scan
    view: Index
    clutter: Mask
    face: Index
    shares: Array
    surface: Array
    faces: Index
    seen: Mask
    scanners: tuple[Scanner, ...]

    @property
    def true_points(self) -> Array:
        """Where the rays hit the surface, (M, 3) m; NaN for clutter."""
        points = np.einsum("mk,mki->mi", self.shares, self.surface[self.faces[self.face]])
        points[self.clutter] = np.nan
        return np.asarray(points)

    def some(self, chosen: Mask) -> "SimulatedScan":
        """The points that a mask (M,) chooses, with their truth; `seen` stays as it is.

        Raises BadScan if no point is left, or for a mask of another shape.
        """
        return replace(
            self,
            scan=self.scan.some(chosen),
            view=self.view[chosen],
            clutter=self.clutter[chosen],
            face=self.face[chosen],
            shares=self.shares[chosen],
        )


def scan(
    vertices: ArrayLike,
    faces: ArrayLike,
    scanners: Sequence[Scanner],
    *,
    seed: int,
    noise: Noise | None = None,
    holes: Holes | None = None,
    steepest: float = np.pi / 2,
    clutter: Clutter | None = None,
    region: HalfSpace | None = None,
    joining: Joining | None = None,
) -> SimulatedScan:
    """A scan of a surface with vertices (N, 3) m and faces (F, 3), counterclockwise from outside.

    Without effects, every point lies exactly on the surface. Each effect can be left out without a
    change of the random numbers of the others: `noise` of the depth, `holes`, the angle in rad
    between ray and normal beyond which a pixel is lost (`steepest`), `clutter`, the `region` to
    which a partial scan is cut, and the `joining` of pixels to triangles, without which the scan
    has no faces. The resolution is that of the scanners. The same `seed` gives the same scan.

    Raises BadMesh for a surface that does not fit together, BadArgument for a negative seed and if
    there are no scanners, and BadScan if nothing of the surface is left.
    """
    mesh = Mesh(reals("vertices", vertices), numbers("faces", faces).astype(np.int64, copy=False))
    views_from = several("scanners", scanners, Scanner)
    above_zero("a simulated scan", scanners=len(views_from))
    from_zero("a simulated scan", seed=seed)
    surface = mesh.vertices
    discs = (holes or Holes(0)).discs(surface, mesh.faces, np.random.default_rng((seed, HOLES)))

    def is_measured(points: Array, normals: Array, scanner: Scanner) -> Mask:
        left = (angles(points, normals, scanner) <= steepest) & ~discs.hold(points, normals)
        return left if region is None else left & region.holds(points)

    views = []
    for number, scanner in enumerate(views_from):
        errors = np.random.default_rng((seed, NOISE, number)).standard_normal(scanner.n_pixels)
        views.append(
            measured_view(surface, mesh.faces, scanner, is_measured, noise, errors, joining)
        )
    n_body = [len(view.points) for view in views]
    clutter_points = scatter_clutter(
        clutter or Clutter(0),
        (clutter or Clutter(0)).count(sum(n_body)),
        surface,
        views_from,
        [view.image for view in views],
        region,
        np.random.default_rng((seed, CLUTTER)),
    )
    C = len(clutter_points.points)
    if not sum(n_body):
        raise BadScan(
            "the scanners measure nothing of the surface: it is outside of their images, or what "
            "they see of it is cut off or lost; `scanners(n, target=...)` looks at a place"
        )
    points, normals, weights = _seen_clutter(clutter_points, views_from, noise)
    begin = np.cumsum([0, *n_body])
    triangles = [view.triangles + offset for view, offset in zip(views, begin[:-1], strict=True)]
    return SimulatedScan(
        scan=Scan(
            np.concatenate([*(view.points for view in views), points]),
            np.concatenate([*(view.normals for view in views), normals]),
            None if joining is None else np.concatenate(triangles),
            np.concatenate([*(view.weights for view in views), weights]),
        ),
        view=np.concatenate([np.repeat(np.arange(len(views_from)), n_body), clutter_points.view]),
        clutter=np.arange(begin[-1] + C) >= begin[-1],
        face=np.concatenate([*(view.face for view in views), np.full(C, -1)]),
        shares=np.concatenate([*(view.shares for view in views), np.zeros((C, 3))]),
        surface=surface,
        faces=mesh.faces,
        seen=np.any([view.seen for view in views], axis=0),
        scanners=views_from,
    )


def _seen_clutter(
    other: ClutterPoints, scanners: Sequence[Scanner], noise: Noise | None
) -> tuple[Array, Array, Array]:
    """Points (C, 3) m of clutter with noise, their normals (C, 3), and their weights (C,) m^2."""
    points, weights = other.points.copy(), np.zeros(len(other.points))
    for number, scanner in enumerate(scanners):
        own = other.view == number
        points_exact, normals = points[own], other.normals[own]
        exact = scanner.seen(points_exact)[:, 2]
        rays = (points_exact - scanner.place) / exact[:, None]
        depth = noisy(exact, angles(points_exact, normals, scanner), noise, other.error[own])
        points[own] = scanner.place + depth[:, None] * rays
        weights[own] = areas(depth, normals, rays, scanner.focal)
    return points, other.normals, weights
