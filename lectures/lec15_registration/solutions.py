"""Solutions of lecture 15."""

import numpy as np
from scipy.spatial import cKDTree

from workbench.geometry.rigid import Similarity, procrustes
from workbench.geometry.rotation import matrix_from_vector
from workbench.geometry.surface_tree import SurfaceTree
from workbench.registration import GemanMcClure, Icp

Array = np.ndarray


def closest_on_triangle(p: Array, a: Array, b: Array, c: Array) -> Array:
    E = np.column_stack([b - a, c - a])
    y, z = np.linalg.lstsq(E, p - a, rcond=None)[0]  # the shares of b and c of the foot
    if min(1 - y - z, y, z) >= 0:
        return a + E @ [y, z]
    ends = []
    for start, end in ((a, b), (b, c), (c, a)):
        along = end - start
        ends.append(start + np.clip((p - start) @ along / (along @ along), 0, 1) * along)
    return min(ends, key=lambda s: np.linalg.norm(p - s))


def icp_step(points: Array, cloud: Array) -> Array:
    contacts = cloud[cKDTree(cloud).query(points)[1]]
    return procrustes(points, contacts)(points)


def distance_gradient(p: Array, corners: Array, shares: Array) -> Array:
    off = p - shares @ corners
    return -np.outer(shares, off / np.linalg.norm(off))


def robust_weight(d: Array, sigma: float, scale: float) -> Array:
    return 1 / sigma**2 / (1 + (d / scale) ** 2) ** 2


def coupling_residual(V: Array, M: Array, edges: Array, sigma: float) -> Array:
    first, second = edges.T
    moved = V - M
    return (moved[second] - moved[first]).ravel() / sigma


def align(points: Array, vertices: Array, faces: Array) -> tuple[Array, Array]:
    return best_of(points, vertices, faces, range(8), GemanMcClure(0.1), GemanMcClure(0.02))


def best_of(points, vertices, faces, eighths, wide, narrow) -> tuple[Array, Array]:
    """The end of the lowest cost from starts that are turned by some eighths of a full turn."""
    tree, middle = SurfaceTree(vertices, faces), np.median(points, axis=0)
    ends = []
    for k in eighths:
        R = matrix_from_vector([0.0, 2 * np.pi * k / 8, 0.0])
        start = Similarity(R, np.median(vertices, axis=0) - R @ middle)
        coarse = Icp(loss=wide, tolerance=1e-3).align(points, tree, start)
        ends.append(Icp(loss=narrow, tolerance=1e-4).align(points, tree, coarse.motion))
    best = min(ends, key=lambda end: end.cost)
    return best.R, best.t
