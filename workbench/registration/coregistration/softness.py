"""How surely a scan knows each vertex, in each direction: registrations as soft observations.

A registration that was found under the coupling to a model is no observation of a person: where
nothing was scanned it repeats the model, and along a surface it does so too. A model that is
fitted to it as if it were one hardly moves. What the scan itself says of vertex i is

    (V_i - target_i)' L_i (V_i - target_i) / 2,   L_i = sum over contacts m of w_m b_mi u_m u_m',

with the share b_mi of the vertex in the contact, its direction u_m and its weight w_m. This bounds
the scan's cost from above in V, with contacts and the weights of the kernel held: the square of a
mean is at most the mean of squares (Jensen's inequality), and Geman-McClure's cost is at most its
tangent in the square. If V_i is eliminated under the coupling |V_i - M_i|^2 / (2 sigma^2), what is
left is the cost of the model's vertex M_i alone,

    (M_i - target_i)' C_i (M_i - target_i) / (2 sigma^2),   C_i = L_i (L_i + 1 / sigma^2)^-1,

so that C_i, whose eigenvalues are between 0 and 1, is the confidence of training: 0 where nothing
was seen and along the surface, and near 1 across it. The vertex of the registration that belongs
to a model's is then C_i target_i + (1 - C_i) M_i.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import casadi as cs
import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.errors import BadArgument
from workbench.problem import Problem
from workbench.problem.banded import BlockMatrix
from workbench.registration.free_vertices import VERTICES
from workbench.residuals import Residual, quadratic
from workbench.residuals.kernels import Kernel, OfNorms

TINY = 1e-12  # a derivative's length, below which it has no direction
UNSEEN = 1e-3  # of 1 / sigma_C^2: what is known less of, a scan does not see


@dataclass(frozen=True, eq=False)
class Pulled:
    """What a scan says of N vertices.

    Attributes:
        targets: (N, 3) m, where the scan would put each; the vertex itself where it says nothing.
        confidence: (N, 3, 3) symmetric, how surely, against the coupling; eigenvalues from 0 to 1.
    """

    targets: Array
    confidence: Array


def pulled(pulls: Sequence[Residual], vertices: Array, coupling: float) -> Pulled:
    """What residuals of the block `vertices` (N, 3) m alone say of each of its rows.

    `coupling` is sigma in m. A row that reads several vertices, or several coordinates, is bounded
    as above, with the lengths of its derivatives as shares. Raises BadArgument for a kernel of
    norms.
    """
    N = len(vertices)
    L, pull = np.zeros((N, 3, 3)), np.zeros((N, 3))
    for residual in pulls:
        if isinstance(residual.kernel, OfNorms):
            raise BadArgument(
                f"the kernel of residual {residual.name!r} is one of norms, and scans are bounded "
                "row by row; give a kernel of single numbers"
            )
        plain = Problem((replace(residual, kernel=quadratic),), (VERTICES,))
        here = plain.linearize({VERTICES: vertices})
        whole = here.jacobian
        J = csr_array(whole.sparse if isinstance(whole, BlockMatrix) else whole)
        r = here.residual
        outside = 1.0 if residual.weights is None else np.asarray(residual.weights, dtype=float)
        counts = np.broadcast_to(outside, len(r) // residual.rows_per_point)
        counts = np.repeat(counts, residual.rows_per_point)
        w = kernel_weights(residual.kernel, np.divide(r**2, counts, where=counts > 0, out=0 * r))
        rows, corners, slopes = _by_vertex(J)
        lengths = np.linalg.norm(slopes, axis=1)
        total = np.bincount(rows, lengths, len(r))
        along = slopes / np.maximum(lengths, TINY)[:, None]
        scale = (w * total)[rows] * lengths
        np.add.at(L, corners, scale[:, None, None] * along[:, :, None] * along[:, None, :])
        np.add.at(pull, corners, -(w * r)[rows, None] * slopes)
    e, Q = np.linalg.eigh(L)
    seen = e > UNSEEN / coupling**2
    inverse = np.where(seen, 1 / np.where(seen, e, 1.0), 0.0)
    shrunk = np.where(seen, e / (e + coupling**-2), 0.0)
    moved = np.einsum("nab,nb,ncb,nc->na", Q, inverse, Q, pull)
    return Pulled(vertices + moved, np.einsum("nab,nb,ncb->nac", Q, shrunk, Q))


def _by_vertex(J: csr_array) -> tuple[Index, Index, Array]:
    """The rows, vertices and derivatives (n, 3) of all pairs of a row and a vertex in J."""
    entries = J.tocoo()
    pairs, where = np.unique(
        entries.row.astype(np.int64) * (J.shape[1] // 3) + entries.col // 3, return_inverse=True
    )
    slopes = np.zeros((len(pairs), 3))
    np.add.at(slopes, (where, entries.col % 3), entries.data)
    return pairs // (J.shape[1] // 3), pairs % (J.shape[1] // 3), slopes


@cache
def _slope_of(kernel: Kernel) -> cs.Function:
    s = cs.MX.sym("s")
    rho = s * kernel(s) ** 2
    return cs.Function("weights", [s], [cs.jacobian(rho, s)])


def kernel_weights(kernel: Kernel, squares: Array) -> Array:
    """rho'(s) at squares s (M,) of whitened residuals: the weights that a robust kernel leaves."""
    return np.asarray(_slope_of(kernel).map(len(squares))(squares[None])).ravel()
