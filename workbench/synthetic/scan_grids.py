"""What a depth image says about its points as neighbours: normals, areas and triangles."""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array, Index
from workbench.synthetic.scanners import Scanner

JUMP = 5.0  # steps from pixel to pixel: depths that differ by more lie on different surfaces
THIN = 1e-6  # of the largest variance: neighbours whose second variance is less lie on a line
LEAST_COSINE = 0.1736  # of 80 degrees: beyond, the area behind a pixel is not known


@dataclass(frozen=True)
class Joining:
    """How neighbouring pixels are joined to triangles.

    Attributes:
        jump: by how many steps from pixel to pixel, z / focal m each, the depths of the corners of
            a triangle may differ. With fewer, the scan falls into more pieces.

    >>> from workbench.synthetic import scanners
    >>> (four_pixels,) = scanners(1, size=(2, 2))
    >>> Joining().triangles(np.arange(4), np.ones(4), four_pixels).tolist()
    [[0, 2, 1], [1, 2, 3]]
    """

    jump: float = JUMP

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

    Planes are fitted to the measured pixels in a window around each, without those beyond a jump of
    the depth. A pixel without such neighbours, or with neighbours on one line, has a normal that
    points to the scanner.
    """
    width, height = scanner.size
    rays = scanner.directions()[pixel]
    points = depth[:, None] * rays  # relative to the scanner
    number = np.full((height + 2 * scanner.window, width + 2 * scanner.window), -1)
    row, column = np.divmod(pixel, width)
    row, column = row + scanner.window, column + scanner.window
    number[row, column] = np.arange(len(pixel))
    count, first, second = (
        np.zeros(len(pixel)),
        np.zeros((len(pixel), 3)),
        np.zeros((len(pixel), 3, 3)),
    )
    reach = range(-scanner.window, scanner.window + 1)
    for down in reach:
        for right in reach:
            other = number[row + down, column + right]
            steps = max(abs(down), abs(right))
            near = np.abs(depth[other] - depth) <= JUMP * max(steps, 1) * depth / scanner.focal
            weight = ((other >= 0) & near).astype(float)
            away = (points[other] - points) * weight[:, None]
            count, first = count + weight, first + away
            second += away[:, :, None] * away[:, None, :]
    mean = first / count[:, None]
    covariance = second / count[:, None, None] - mean[:, :, None] * mean[:, None, :]
    variances, axes = np.linalg.eigh(covariance)
    plane = (count >= 3) & (variances[:, 1] > THIN * variances[:, 2])
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
