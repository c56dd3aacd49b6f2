"""How much of a closed surface lies between an eye and points: rays against all triangles."""

import numpy as np

from workbench.arrays import Array, Index

AT_ONCE = 64  # rays: so many times the number of triangles are looked at together


def passages(eye: Array, points: Array, vertices: Array, faces: Index) -> tuple[Array, Array]:
    """How often the ways from an eye (3,) to points (M, 3) leave a closed surface, and how thick.

    The first (M,) counts the triangles that a way crosses from inside to outside; the second (M,)
    is the length of the way inside of the surface, in the unit of the points. Normals point
    outwards. Crossings are found by the algorithm of Moeller and Trumbore (Fast, Minimum Storage
    Ray/Triangle Intersection, 1997); a way exactly through an edge may count twice or not at all.
    """
    exits, inside = np.zeros(len(points)), np.zeros(len(points))
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    one, two, from_a = b - a, c - a, eye - a
    normal, q = np.cross(one, two), np.cross(from_a, one)
    for start in range(0, len(points), AT_ONCE):
        some = slice(start, start + AT_ONCE)
        way = points[some] - eye  # parameter 1 at the point
        slope = -(way @ normal.T)  # the determinant; above 0 where the way enters
        with np.errstate(divide="ignore", invalid="ignore"):
            u = way @ np.cross(two, from_a).T / slope
            v = way @ q.T / slope
            t = np.einsum("fi,fi->f", two, q) / slope
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 1)
        leaves, enters = hit & (slope < 0), hit & (slope > 0)
        exits[some] = leaves.sum(axis=1)
        open_ = enters.sum(axis=1) - leaves.sum(axis=1)  # ends inside: the rest of the way counts
        share = np.where(leaves, t, 0.0).sum(axis=1) - np.where(enters, t, 0.0).sum(axis=1) + open_
        inside[some] = share * np.linalg.norm(way, axis=1)
    return exits, inside
