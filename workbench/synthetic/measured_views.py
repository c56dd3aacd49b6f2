"""What one scanner measures of a surface: which pixels are left, their depths and their normals."""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.geometry.solids import face_vectors, vertex_normals
from workbench.synthetic.depth_images import DepthImage, depth_image, visible
from workbench.synthetic.scan_effects import Discs, Noise, Region, unit_vectors
from workbench.synthetic.scan_grids import Joining, areas, estimated_normals
from workbench.synthetic.scanners import Scanner


@dataclass(frozen=True, eq=False)
class Losses:
    """Which places of a surface are not measured although nothing is before them.

    Attributes:
        discs: holes.
        steepest: in rad, the largest angle between the ray and the normal.
        region: what a partial scan is cut to, if there is one.
    """

    discs: Discs
    steepest: float
    region: Region | None

    def spare(self, points: Array, normals: Array, scanner: Scanner) -> Mask:
        """Which points (M, 3) m with unit normals (M, 3) are measured all the same."""
        left = (angles(points, normals, scanner) <= self.steepest) & ~self.discs.hold(
            points, normals
        )
        return left if self.region is None else left & self.region.holds(points)


@dataclass(frozen=True, eq=False)
class MeasuredView:
    """The H points that one scanner measured on a surface of N vertices, with the truth.

    Attributes:
        points: (H, 3) m.
        normals: (H, 3) unit vectors, as estimated from the measured depths.
        weights: (H,) m^2, the area behind each pixel.
        triangles: (T, 3) of the numbers of points.
        face: (H,) the face that was hit.
        shares: (H, 3) the barycentric coordinates of the place that was hit.
        seen: (N,) the vertices that the scanner sees.
        image: the whole surface, with what is not measured.
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
    losses: Losses,
    noise: Noise | None,
    errors: Array,
    joining: Joining | None,
) -> MeasuredView:
    """What a scanner measures of a surface (N, 3) m, (F, 3).

    `errors` holds a number from a standard normal distribution for every pixel of the scanner.
    """
    image = depth_image(surface, faces, scanner)
    normals, hit = face_normals(surface, faces, image.face), true_points(surface, faces, image)
    left = losses.spare(hit, normals, scanner)
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
        seen=visible(surface, faces, scanner) & losses.spare(surface, around, scanner),
        image=image,
    )


def noisy(depth: Array, angle: Array, noise: Noise | None, errors: Array) -> Array:
    """Depths (M,) m with the errors (M,), which are in standard deviations of the noise."""
    return depth if noise is None else depth + noise.sigma(depth, angle) * errors


def angles(points: Array, normals: Array, scanner: Scanner) -> Array:
    """The angles (M,) rad, of at most a right angle, between rays and normals, (M, 3) m each."""
    rays = unit_vectors(points - scanner.place)
    return np.asarray(np.arccos(np.abs(np.einsum("mi,mi->m", rays, normals)).clip(0, 1)))


def face_normals(surface: Array, faces: Index, chosen: Index) -> Array:
    """The unit normals (H, 3) of some faces (H,), which are no lines."""
    return unit_vectors(face_vectors(surface, faces[chosen]))


def true_points(surface: Array, faces: Index, image: DepthImage) -> Array:
    """Where rays hit the surface, (H, 3) m."""
    return np.asarray(np.einsum("hk,hki->hi", image.shares, surface[faces[image.face]]))
