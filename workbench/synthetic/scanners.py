"""Scanners: where they stand, which way they look, and how many rays they send."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index, Mask
from workbench.blocks.checks import above_zero
from workbench.errors import BadArgument
from workbench.fitting.observations import pinhole

FOCAL, SIZE = 164.0, (150, 200)  # px: the field of view of a Kinect that stands on its side
STEEPEST_VIEW = 0.99  # the sine of the angle from the horizontal at which a scanner still has an up
NEAREST_SEEN = 0.05  # m: a scanner does not see what is nearer
PAIRS_AT_ONCE = 1_000_000  # pairs of triangle and ray that are computed together
PIXEL_MARGIN = 1e-6  # px, around the image of a triangle, for rounding
SAME_DEPTH = 1e-9  # m: a surface that is nearer by less does not hide a vertex


@dataclass(frozen=True, eq=False)
class Scanner:
    """A pinhole that measures depth: one ray goes through the middle of every pixel.

    The middle of the pixel in column i and row j is at (i + 1/2, j + 1/2) px, and the optical axis
    goes through the middle of the image. R (3, 3) and t (3,) m take the world to the scanner, whose
    x points right, y down and z forward; `focal` and `size` (width and height) are in px. Raises
    BadArgument for lengths that are not above zero.
    """

    R: Array
    t: Array
    focal: float = FOCAL
    size: tuple[int, int] = SIZE

    def __post_init__(self) -> None:
        above_zero("a scanner", focal=self.focal, width=self.size[0], height=self.size[1])

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
) -> tuple[Scanner, ...]:
    """`n` scanners evenly around a `target` (3,) m, all looking at it, upright.

    They stand at a horizontal `distance` and `height` above it, both in m. The first is in front of
    a body that faces +z, turned about it by `turn` rad; the others follow in the direction from +z
    to +x, so that the second of four sees the body's left side. Raises BadArgument for less than
    one scanner, or if they would look straight down or up.
    """
    middle = np.asarray(target, dtype=float)
    above_zero("scanners", n=n)
    if not distance > 0 or abs(height) > STEEPEST_VIEW * np.hypot(distance, height):
        raise BadArgument(
            f"scanners at a distance of {distance:g} m and a height of {height:g} m would look "
            "straight down or up, and have no upright image; move them away"
        )
    ring = []
    for angle in turn + 2 * np.pi * np.arange(n) / n:
        away = np.array([distance * np.sin(angle), height, distance * np.cos(angle)])
        forward = -away / np.linalg.norm(away)
        right = np.cross(forward, [0.0, 1.0, 0.0])
        right /= np.linalg.norm(right)
        R = np.stack([right, np.cross(forward, right), forward])
        ring.append(Scanner(R, -R @ (middle + away), focal, size))
    return tuple(ring)


@dataclass(frozen=True, eq=False)
class DepthImage:
    """The numbers (H,) of the pixels whose rays hit the surface, row after row; the depths (H,) m
    along the optical axis; the triangles (H,) that are hit first, and the barycentric shares (H, 3)
    of the points in them.
    """

    pixel: Index
    depth: Array
    face: Index
    shares: Array


def depth_image(vertices: Array, faces: Index, scanner: Scanner) -> DepthImage:
    """What a scanner sees of a surface (N, 3) m, (F, 3), without noise; both sides are seen."""
    corners, rays = scanner.seen(vertices)[faces], scanner.rays()
    first = np.arange(scanner.n_pixels + 1)  # every pixel holds one ray, its own
    hits = [
        _hits(corners, rays, face, ray)
        for face, ray in _pairs(_boxes(corners, scanner), first, scanner.size[0])
    ]
    ray, depth, face, shares = (np.concatenate(part) for part in zip(*hits, strict=True))
    order = np.lexsort((face, depth, ray))
    nearest = order[np.unique(ray[order], return_index=True)[1]]
    return DepthImage(ray[nearest], depth[nearest], face[nearest], shares[nearest])


def visible(vertices: Array, faces: Index, scanner: Scanner) -> Mask:
    """Which vertices (N,) are in a scanner's image with nothing of the surface before them.

    Exact for every vertex, at whatever resolution: the ray goes to the vertex itself.
    """
    width, height = scanner.size
    seen = scanner.seen(vertices)
    is_visible = np.asarray(seen[:, 2] > NEAREST_SEEN)
    rays = seen / np.where(is_visible, seen[:, 2], 1.0)[:, None]
    column, row = np.floor(_image(seen, is_visible, scanner)).astype(np.int64).T
    is_visible &= (column >= 0) & (column < width) & (row >= 0) & (row < height)
    order = np.flatnonzero(is_visible)
    cell = row[order] * width + column[order]
    order = order[np.argsort(cell, kind="stable")]
    first = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=scanner.n_pixels))])
    for face, rays_met in _pairs(_boxes(seen[faces], scanner), first, width):
        vertex, depth, faces_met, _ = _hits(seen[faces], rays, face, order[rays_met])
        other = (faces[faces_met] != vertex[:, None]).all(axis=1)
        is_visible[vertex[other & (depth < seen[vertex, 2] - SAME_DEPTH)]] = False
    return is_visible


def _image(seen: Array, before: Mask, scanner: Scanner) -> Array:
    """Points (..., 3) m of the scanner's frame in the image, (..., 2) px; where not there, -1."""
    z = np.where(before, seen[..., 2], 1.0)[..., None]
    pixels = scanner.focal * seen[..., :2] / z + np.array(scanner.size) / 2
    return np.where(before[..., None], pixels, -1.0)


def _boxes(corners: Array, scanner: Scanner) -> Index:
    """The pixels that the image of each triangle may touch: (F, 2, 2), first and last of u and v.

    Triangles that reach behind the scanner get the whole image, and those behind it nothing.
    """
    before = corners[..., 2] > NEAREST_SEEN
    pixels = _image(corners, before, scanner)
    last = np.array(scanner.size) - 1
    whole = np.asarray(before.any(axis=1) & ~before.all(axis=1))[:, None]
    low = np.where(whole, 0, np.floor(pixels.min(axis=1) - PIXEL_MARGIN)).clip(0)
    high = np.where(whole, last, np.floor(pixels.max(axis=1) + PIXEL_MARGIN)).clip(-1, last)
    high[~before.any(axis=1)] = -1
    return np.stack([low, high], axis=1).astype(np.int64)


def _pairs(boxes: Index, first: Index, width: int) -> Iterator[tuple[Index, Index]]:
    """Every triangle with every ray in the pixels of its box, as numbers (P,), some at a time.

    The rays of pixel k are those from `first[k]` to before `first[k + 1]`.
    """
    across, down = (boxes[:, 1] - boxes[:, 0] + 1).clip(0).T
    strips = np.repeat(np.arange(len(boxes)), np.where(across > 0, down, 0))
    row = boxes[strips, 0, 1] + _counted(np.where(across > 0, down, 0))
    first_ray = first[row * width + boxes[strips, 0, 0]]  # the rays of a strip follow each other
    count = first[row * width + boxes[strips, 1, 0] + 1] - first_ray
    part = np.cumsum(count) // PAIRS_AT_ONCE
    for i in range(int(part.max(initial=0)) + 1):
        some = slice(*np.searchsorted(part, [i, i + 1]))
        yield (
            np.repeat(strips[some], count[some]),
            np.repeat(first_ray[some], count[some]) + _counted(count[some]),
        )


def _counted(lengths: Index) -> Index:
    """0, 1, ..., n - 1 for each length n, one after the other."""
    return np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)


def _hits(
    corners: Array, rays: Array, face: Index, ray: Index
) -> tuple[Index, Array, Index, Array]:
    """The pairs that hit: the ray, the depth in m, the face, and the barycentric shares."""
    a, b, c = corners.transpose(1, 0, 2)
    volumes = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)  # (F, 3, 3) m^2
    d = rays[ray]
    sides = np.stack([np.einsum("pi,pi->p", volumes[face, k], d) for k in range(3)], axis=1)
    hit = (sides >= 0).all(axis=1) | (sides <= 0).all(axis=1)
    face, ray, d = face[hit], ray[hit], d[hit]
    n = np.cross(b - a, c - a)[face]  # m^2
    facing = np.einsum("pi,pi->p", n, d)
    with np.errstate(divide="ignore", invalid="ignore"):  # triangles that are seen as lines
        depth = np.einsum("pi,pi->p", n, a[face]) / facing
    in_front = (facing != 0) & (depth > NEAREST_SEEN)
    face, ray, depth, n = face[in_front], ray[in_front], depth[in_front], n[in_front]
    points, triangle = depth[:, None] * d[in_front], (a[face], b[face], c[face])
    areas = [
        np.einsum("pi,pi->p", np.cross(triangle[j] - triangle[i], points - triangle[i]), n)
        for i, j in ((1, 2), (2, 0), (0, 1))
    ]
    shares = np.stack(areas, axis=1).clip(0)
    return ray, depth, face, shares / shares.sum(axis=1, keepdims=True)
