"""Exercises of lecture 15, registering scans.

Write each answer in place of the line that raises `Unsolved`, and keep the names, arguments and shapes.
Lengths are in metres. This command grades the file:

    workbench lecture check 15 lec15_registration.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def closest_on_triangle(p: Array, a: Array, b: Array, c: Array) -> Array:
    """The place on the triangle with the corners a, b and c that is closest to p.

    It may be inside, on an edge or at a corner. The triangle has an area.

    p, a, b, c (3,) m -> (3,) m
    """
    raise Unsolved("closest_on_triangle")


def icp_step(points: Array, cloud: Array) -> Array:
    """The points after one step of iterated closest points onto a cloud, point to point.

    The contact of a point is the point of the cloud that is closest to it. The motion is rigid: a
    rotation, never a mirror, and a translation. You may use `workbench.geometry.rigid.procrustes`.

    points (M, 3) m; cloud (N, 3) m -> (M, 3) m
    """
    raise Unsolved("icp_step")


def distance_gradient(p: Array, corners: Array, shares: Array) -> Array:
    """The derivatives of the distance of p from a triangle by the coordinates of its corners.

    The closest place is the sum of shares[k] times corners[k]. The point p is not on the triangle, and
    the distance is positive on both sides.

    p (3,) m; corners (3, 3) m, a row for each corner; shares (3,) -> (3, 3), a row for each corner
    """
    raise Unsolved("distance_gradient")


def robust_weight(d: Array, sigma: float, scale: float) -> Array:
    """The weights w of iteratively reweighted least squares, for Geman and McClure's loss.

    A distance d costs half of rho = (d / sigma)^2 / (1 + (d / scale)^2). Its weight is such that half of
    w d^2, with w held, has the same derivative at d.

    d (n,) m, none of them negative; sigma, scale m -> (n,) 1/m^2
    """
    raise Unsolved("robust_weight")


def coupling_residual(V: Array, M: Array, edges: Array, sigma: float) -> Array:
    """The residual that couples free vertices V to those of a model M by edges, in units of sigma.

    For each edge it is the difference along the edge (second end minus first) of V, minus that of M: x, y
    and z of the first edge, then those of the second, and so on.

    V, M (N, 3) m; edges (E, 2), the numbers of both ends; sigma m -> (3 E,)
    """
    raise Unsolved("coupling_residual")


def align(points: Array, vertices: Array, faces: Array) -> tuple[Array, Array]:
    """The motion x -> R x + t that takes the points of a scan onto the mesh of a standing person.

    Nobody knows how the scan was turned about the vertical, y; it may also be tilted by up to 0.1 rad, and
    it stands anywhere. A fifth of the points are clutter within a metre of the person, and the others have
    noise. On average, the others should end within 5 mm of where the true motion takes them. You may use
    all of `workbench`.

    points (M, 3) m; vertices (N, 3) m; faces (F, 3) -> R (3, 3), t (3,) m
    """
    raise Unsolved("align")
