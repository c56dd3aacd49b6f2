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

from dataclasses import dataclass
from functools import cache

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.errors import BadArgument
from workbench.registration.scan_term import ScanTerm
from workbench.residuals import Residual
from workbench.residuals.contacts import MovingContacts
from workbench.residuals.kernels import Kernel

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


def pulled(
    scan: Residual, term: ScanTerm, values: Values, vertices: Array, coupling: float
) -> Pulled:
    """What the residual of a scan says of vertices (N, 3) m, coupled by a sigma in m.

    Raises BadArgument for a residual that chooses no contacts, or has more than one row for each.
    """
    source = scan.points[0].source if scan.points else None
    if not isinstance(source, MovingContacts) or scan.rows_per_point != 1:
        raise BadArgument(f"residual {scan.name!r} has no contacts with one distance for each")
    found = source.contacts(values)
    touched = np.flatnonzero(found.found)
    r = found.numbers.ravel()[touched]
    at = (found.slopes.data.reshape(-1, 3, 3), found.slopes.indices.reshape(-1, 3, 3)[:, :, 0] // 3)
    slopes, corners = at  # (m, corner, coordinate) - b u, and (m, corner)
    outside = np.broadcast_to(np.asarray(scan.weights, dtype=float), len(found.found))[touched]
    w = outside / term.sigma**2 * kernel_weights(scan.kernel, (r / term.sigma) ** 2)
    shares = np.linalg.norm(slopes, axis=2)
    along = slopes / np.maximum(shares, 1e-12)[..., None]
    N = len(vertices)
    L, pull = np.zeros((N, 3, 3)), np.zeros((N, 3))
    outer = np.einsum("m,mc,mca,mcb->mcab", w, shares, along, along)
    np.add.at(L, corners, outer)
    np.add.at(pull, corners, -(w * r)[:, None, None] * slopes)
    e, Q = np.linalg.eigh(L)
    seen = e > UNSEEN / coupling**2
    inverse = np.where(seen, 1 / np.where(seen, e, 1.0), 0.0)
    shrunk = np.where(seen, e / (e + coupling**-2), 0.0)
    moved = np.einsum("nab,nb,ncb,nc->na", Q, inverse, Q, pull)
    return Pulled(vertices + moved, np.einsum("nab,nb,ncb->nac", Q, shrunk, Q))


@cache
def _slope_of(kernel: Kernel) -> cs.Function:
    s = cs.MX.sym("s")
    rho = s * kernel(s) ** 2
    return cs.Function("weights", [s], [cs.jacobian(rho, s)])


def kernel_weights(kernel: Kernel, squares: Array) -> Array:
    """rho'(s) at squares s (M,) of whitened residuals: the weights that a robust kernel leaves."""
    return np.asarray(_slope_of(kernel).map(len(squares))(squares[None])).ravel()
