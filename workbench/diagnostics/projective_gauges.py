"""Gauges of homogeneous coordinates: factors of matrices, and moves of the plane at infinity.

A camera as a matrix P (3, 4), or a homography H (3, 3), says the same times any factor. Where
cameras are matrices, points in homogeneous coordinates X' = T X cancel against P' = P T^-1 with any
invertible T (Hartley and Zisserman, Multiple View Geometry in Computer Vision, 2004, section 10.2).
Besides the affine maps these are maps that move the plane at infinity (in the plane: the line),
X -> X / (1 - v'X); to first order every point moves along itself by X (v'X).
"""

from collections.abc import Iterator

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Layout
from workbench.diagnostics.gauge_names import named_gauge
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.diagnostics.undoing import Unseen, only, places_of, undone

MATRICES = ((3, 3), (3, 4), (4, 4))  # that act on homogeneous coordinates


def homogeneous_factors(free: Layout, unseen: Unseen) -> Iterator[tuple[str, NamedSubspace]]:
    """The names of matrices whose factor no residual sees, each with this motion."""
    for block in free.blocks:
        if block.shape in MATRICES and block.unit == "1" and block.whole is None:
            field = only(places_of(free, block), free.size, lambda x: x[:, None])
            for v, _ in undone(field, np.zeros(0, dtype=np.int64), unseen):
                said = "a common factor"
                yield block.name, named_gauge("scale", said, v, free, [block], least=unseen.same)


def moves_of_infinity(X: Array) -> Iterator[tuple[str, Array]]:
    """How points (N, d) move with the plane or line at infinity, in words and (N d,)."""
    d = X.shape[1]
    what = "line" if d == 2 else "plane"
    for k in range(d):
        said = f"a move of the {what} at infinity along {'xyz'[k]}, a projective map"
        yield said, (X * X[:, k : k + 1]).ravel()
