"""Generalized winding numbers: how often a surface goes around a point."""

import numpy as np

from workbench.arrays import Array, Index

TOGETHER = 1_000_000  # pairs of a point and a triangle at once


def winding_numbers(points: Array, vertices: Array, faces: Index) -> Array:
    """How often a surface of triangles (F, 3) goes around each of points (M, 3), (M,).

        w(p) = 1 / (4 pi) sum over triangles of their solid angle at p

    Inside of a closed surface that faces outwards it is 1, and outside 0; it is 2 where two of its
    parts overlap. If the surface has holes, w is a smooth function between, and 1/2 is taken as the
    border of its inside (Jacobson, Kavan and Sorkine-Hornung, Robust Inside-Outside Segmentation
    using Generalized Winding Numbers, 2013). The solid angle is that of van Oosterom and Strackee
    (The Solid Angle of a Plane Triangle, 1983); a point in the plane of a triangle sees none of it.
    """
    found = np.empty(len(points))
    step = max(1, TOGETHER // max(len(faces), 1))
    for start in range(0, len(points), step):
        some = slice(start, start + step)
        a, b, c = (vertices[faces[:, i]] - points[some, None] for i in range(3))  # (m, F, 3)
        A, B, C = (np.sqrt(np.einsum("mfi,mfi->mf", x, x)) for x in (a, b, c))
        volume = np.einsum("mfi,mfi->mf", a, np.cross(b, c))
        ab, bc, ca = (np.einsum("mfi,mfi->mf", x, y) for x, y in ((a, b), (b, c), (c, a)))
        angles = 2 * np.arctan2(volume, A * B * C + ab * C + bc * A + ca * B)
        found[some] = angles.sum(axis=1) / (4 * np.pi)
    return found
