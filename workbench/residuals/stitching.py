"""The edges of a mesh against edges that belong to no mesh."""

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.blocks import Points
from workbench.blocks.reals import numbers
from workbench.errors import BadResidual
from workbench.geometry.triangles import edge_matrix
from workbench.residuals.kernels import Kernel, quadratic
from workbench.residuals.residual import Residual, expressed, given, named_after


def stitching(
    vertices: Points | cs.MX,
    edges: cs.MX | ArrayLike,
    faces: NDArray[np.int64],
    *,
    sigma: float,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Residual:
    """(A V)_fi - X_f e_fi in metres: two edges of every face against deformed ones (SCAPE eq. 1).

    `edges` is the symbol of a block (2 F, 3), or an array: T_2 - T_0 and T_1 - T_0 of each face
    in turn. Where vertices hang together by faces, a common translation of them changes nothing.
    `kernel=of_norms(...)` looks at the length of an edge's difference, not at each coordinate.
    Raises BadResidual for edges that are not two per face.
    """
    placed, reads = expressed(vertices)
    name = name or named_after("stitching", edges, vertices)
    found = numbers(f"residual {name!r}: faces", faces)
    if found.ndim != 2 or found.shape[1] != 3 or found.dtype.kind not in "iu":
        raise BadResidual(f"residual {name!r} needs faces (F, 3) of whole numbers")
    if found.size and not 0 <= found.min() <= found.max() < placed.shape[1]:
        raise BadResidual(
            f"residual {name!r} needs vertices from 0 to {placed.shape[1] - 1} in its faces"
        )
    target = given(name, "the edges", edges, (2 * len(faces), 3))
    if target.shape != (3, 2 * len(faces)):
        raise BadResidual(
            f"residual {name!r} needs two edges for each of {len(faces)} faces, a block of shape "
            f"({2 * len(faces)}, 3), not {target.shape[::-1]}"
        )
    A = cs.MX(cs.DM(edge_matrix(faces, placed.shape[1]).T.tocsc()))
    labels = tuple(f"face {f}, {e}, {a}" for f in range(len(faces)) for e in ("T2 - T0", "T1 - T0")
                   for a in "xyz")  # fmt: skip
    off = cs.vec(placed @ A - target)
    return Residual(name, off, sigma, "m", kernel, reads, labels, rows_per_point=3)
