"""Exercises of lecture 14, triangles.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
A triangle is a (3, 3) array, a corner T_0, T_1, T_2 in each row. Lengths are in metres. Then

    workbench lecture check 14 lec14_triangles.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def frame(T: Array) -> Array:
    """The two edges e_0 = T_2 - T_0 and e_1 = T_1 - T_0, and the third axis, as columns.

    The third axis is n / sqrt(|n|) with n = e_1 x e_0.

    T (3, 3), a corner in each row -> (3, 3), m
    """
    raise Unsolved("frame")


def deformation(T: Array, V: Array) -> Array:
    """The matrix X that takes triangle T to triangle V: edges to edges, third axis to third axis.

    T, V (3, 3), a corner in each row -> (3, 3)
    """
    raise Unsolved("deformation")


def edge_matrix(faces: Array, N: int) -> Array:
    """The matrix A that takes vertices (N, 3) to edges: row 2 f is e_0 of face f, row 2 f + 1 its e_1.

    faces (F, 3) whole numbers, the three corners of each face -> (2 F, N)
    """
    raise Unsolved("edge_matrix")


def stitch(A: Array, e: Array) -> Array:
    """The vertices whose edges A V are nearest to e, and whose mean is at the origin.

    The mesh is in one piece.

    A (2 F, N) as above, e (2 F, 3) m -> (N, 3) m
    """
    raise Unsolved("stitch")


def blend_volume(w: float, alpha: float) -> float:
    """The determinant of a blend of two rotations about one axis, alpha apart: w and 1 - w of them.

    w a share from 0 to 1, alpha rad -> a number
    """
    raise Unsolved("blend_volume")


def explained(people: Array, k: int) -> float:
    """The largest share of the variance of these vectors that k directions can explain.

    Variance is measured from the mean of the vectors, and the directions begin there.

    people (P, n), a person in each row -> a share, from 0 to 1
    """
    raise Unsolved("explained")
