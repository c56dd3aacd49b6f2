"""Differences between the edges of a mesh and edges of single triangles, as SCAPE has them."""

import casadi as cs
from numpy.typing import ArrayLike

from workbench.arrays import Index
from workbench.blocks import Points
from workbench.blocks.functions import sparse_constant
from workbench.errors import BadResidual
from workbench.geometry.triangles import edge_matrix
from workbench.residuals.arguments import expressed, given, named_after, numbered
from workbench.residuals.kernels import Kernel, quadratic
from workbench.residuals.residual import Residual


def stitching(
    vertices: Points | cs.MX,
    edges: cs.MX | ArrayLike,
    faces: Index,
    *,
    sigma: float,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Residual:
    """(A V)_fi - X_f e_fi in metres: two edges of every face against deformed ones (SCAPE eq. 1).

    `edges` is the symbol of a block (2 F, 3), or an array: T_2 - T_0 and T_1 - T_0 of each face
    in turn. A common translation of vertices that are connected by faces changes nothing.
    `kernel=of_norms(...)` takes the length of an edge's difference instead of each coordinate.
    Raises BadResidual for edges that are not two per face.
    """
    placed, reads = expressed(vertices)
    name = name or named_after("stitching", edges, vertices)
    faces = numbered(name, "faces (F", faces, 3, placed.shape[1])
    target = given(name, "the edges", edges, (2 * len(faces), 3))
    if target.shape != (3, 2 * len(faces)):
        raise BadResidual(
            f"residual {name!r} needs two edges for each of {len(faces)} faces, a block of shape "
            f"({2 * len(faces)}, 3), not {target.shape[::-1]}"
        )
    A = cs.MX(sparse_constant(edge_matrix(faces, placed.shape[1]).T))
    labels = tuple(
        f"face {f}, {e}, {a}"
        for f in range(len(faces))
        for e in ("T2 - T0", "T1 - T0")
        for a in "xyz"
    )
    off = cs.vec(placed @ A - target)
    return Residual(name, off, sigma, "m", kernel, reads, labels, rows_per_point=3)
