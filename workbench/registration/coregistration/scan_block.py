"""The registrations of a round: each scan acts on free vertices, its person's model holds them.

    E_j(V, pose, trans) = E_S(scan_j to V) + |V - M_s(pose) - trans|^2 / (2 sigma_C^2) + E_pose

with the person's template, joints, weights and pose blend shapes held. All scans are independent,
so that an executor may take them in any number of processes.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Protocol

import casadi as cs
import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.blocks import Block, Values
from workbench.errors import BadArgument
from workbench.fitting.body_priors import pose_prior
from workbench.fitting.scans.scan import Scan
from workbench.problem import Problem
from workbench.problem.storage import unblocked
from workbench.registration.free_vertices import (
    CLOSE_TERM,
    JOINT_SOLVER,
    SETTLED_SHARE,
    VERTICES,
    ScanTerm,
    Settled,
)
from workbench.residuals import Residual, quadratic, vertices
from workbench.residuals.kernels import Kernel, OfNorms
from workbench.training.estimate import Estimate
from workbench.training.poses import body_of_subjects

NO_DIRECTION = 1e-12  # a derivative's length, below which it has no direction
LEAST_SEEN = 1e-3  # of 1 / sigma_C^2: a scan does not see a direction of less precision


def scan_evidence(residual: Residual, vertices: Array, coupling: float) -> tuple[Array, Array]:
    """What a residual of the block `vertices` (N, 3) m alone says of each of its rows.

    First the targets (N, 3) m, where the scan would put each vertex; the vertex itself where it
    says nothing. Then the confidence (N, 3, 3), symmetric: how surely, against the coupling of
    sigma `coupling` in m, with eigenvalues from 0 to 1.

    A row of the Jacobian couples the vertices that it reads. Its square is replaced by an upper
    bound that does not, so that each vertex has a Hessian (3, 3) of its own: with the derivatives
    d_i of the row by vertex i,

        (sum_i d_i . v_i)^2  <=  sum_k |d_k|  sum_i (d_i . v_i)^2 / |d_i|.

    Raises BadArgument for a kernel of norms.
    """
    if isinstance(residual.kernel, OfNorms):
        raise BadArgument(
            f"the kernel of residual {residual.name!r} is one of norms, and scans are bounded "
            "row by row; give a kernel of single numbers"
        )
    N = len(vertices)
    plain = Problem((replace(residual, kernel=quadratic),), (VERTICES,))
    linear = plain.linearize({VERTICES: vertices})
    J, r = csr_array(unblocked(linear.jacobian)), linear.residual
    outside = 1.0 if residual.weights is None else np.asarray(residual.weights, dtype=float)
    counts = np.broadcast_to(outside, len(r) // residual.rows_per_point)
    counts = np.repeat(counts, residual.rows_per_point)
    w = kernel_weights(residual.kernel, np.divide(r**2, counts, where=counts > 0, out=0 * r))
    rows, corners, derivatives = _by_vertex(J)
    lengths = np.linalg.norm(derivatives, axis=1)
    total = np.bincount(rows, lengths, len(r))
    along = derivatives / np.maximum(lengths, NO_DIRECTION)[:, None]
    scale = (w * total)[rows] * lengths
    hessian, gradient = np.zeros((N, 3, 3)), np.zeros((N, 3))
    np.add.at(hessian, corners, scale[:, None, None] * along[:, :, None] * along[:, None, :])
    np.add.at(gradient, corners, (w * r)[rows, None] * derivatives)
    eigenvalues, Q = np.linalg.eigh(hessian)
    seen = eigenvalues > LEAST_SEEN / coupling**2
    inverse = np.where(seen, 1 / np.where(seen, eigenvalues, 1.0), 0.0)
    shrunk = np.where(seen, eigenvalues / (eigenvalues + coupling**-2), 0.0)
    moved = np.einsum("nab,nb,ncb,nc->na", Q, inverse, Q, -gradient)
    return vertices + moved, np.einsum("nab,nb,ncb->nac", Q, shrunk, Q)


def _by_vertex(J: csr_array) -> tuple[Index, Index, Array]:
    """The rows, vertices and derivatives (n, 3) of all pairs of a row and a vertex in J."""
    entries = J.tocoo()
    pairs, where = np.unique(
        entries.row.astype(np.int64) * (J.shape[1] // 3) + entries.col // 3, return_inverse=True
    )
    derivatives = np.zeros((len(pairs), 3))
    np.add.at(derivatives, (where, entries.col % 3), entries.data)
    return pairs // (J.shape[1] // 3), pairs % (J.shape[1] // 3), derivatives


@cache
def _derivative_of(kernel: Kernel) -> cs.Function:
    s = cs.MX.sym("s")
    return cs.Function("weights", [s], [cs.jacobian(s * kernel(s) ** 2, s)])


def kernel_weights(kernel: Kernel, squares: Array) -> Array:
    """rho'(s) at squares s (M,) of whitened residuals: the weights that a robust kernel leaves."""
    return np.asarray(_derivative_of(kernel).map(len(squares))(squares[None])).ravel()


JOB_SIZE = 4  # scans that one job registers, with one symbolic body


class Scans(Protocol):
    """Where scans are read from, one at a time; it is sent to other processes as it is."""

    @property
    def subject(self) -> Index:
        """The number of each scan's subject, (J,), counted from 0."""

    def read(self, row: int) -> Scan:
        """The scan of a row."""


@dataclass(frozen=True, eq=False)
class ScansInMemory:
    """J scans in memory, and the number (J,) of each scan's subject, counted from 0."""

    scans: tuple[Scan, ...]
    subject: Index

    def read(self, row: int) -> Scan:
        """The scan of a row."""
        return self.scans[row]


@dataclass(frozen=True, eq=False)
class ScanCoupling:
    """How scans act on the vertices, and how strongly the model holds them.

    `area` (m^2) is that of the starting body's surface, which points without areas share evenly;
    `coupling` is sigma_C in m, of each coordinate of a vertex from the model's; `term` is E_S.
    """

    faces: Index
    area: float
    coupling: float
    term: ScanTerm = CLOSE_TERM


@dataclass(frozen=True, eq=False)
class OnScan:
    """What `State` holds of one scan."""

    vertices: Array
    pose: Array
    trans: Array
    scan_costs: float
    targets: Array
    confidence: Array


@dataclass(frozen=True, eq=False)
class ScanBatch:
    """Some scans, `rows` (c,), of some subjects (c,), whose arrays alone are in the estimate, and
    the vertices (c, N, 3) m and translations (c, 3) m where they begin.
    """

    estimate: Estimate
    rows: tuple[int, ...]
    subject: Index
    vertices: Array
    trans: Array


def jobs(estimate: Estimate, subject: Index, vertices: Array, trans: Array) -> Iterator[ScanBatch]:
    """All scans in jobs of a few."""
    for first in range(0, len(subject), JOB_SIZE):
        rows = np.arange(first, min(first + JOB_SIZE, len(subject)))
        theirs, numbered = estimate.of_rows(rows, subject[rows])
        yield ScanBatch(theirs, tuple(rows.tolist()), numbered, vertices[rows], trans[rows])


def on_scans(coupled: ScanCoupling, scans: Scans, solve: bool, job: ScanBatch) -> list[OnScan]:
    """Every scan of a job where its vertices, pose and translation are, or where they end.

    With `solve` they are found, and no cost is higher afterwards.
    """
    estimate, results = job.estimate, []
    body = body_of_subjects(estimate, coupled.faces)
    N = estimate.templates.shape[1]
    pose, betas, trans = (block.symbol for block in body.blocks())
    points = body.points(pose, betas, trans, vertices=range(N))
    block = Block(VERTICES, (N, 3), "m")
    coupling = vertices(points, block.symbol, sigma=coupled.coupling, name="coupling")
    prior = pose_prior(body)
    for i, row in enumerate(job.rows):
        scan = scans.read(row)
        data = coupled.term.residual(block.symbol, coupled.faces, scan, coupled.area)
        values = {
            "pose": estimate.poses[i],
            "betas": np.eye(len(estimate.templates))[job.subject[i]],
            "trans": job.trans[i],
            VERTICES: job.vertices[i],
        }
        if solve:
            free = ("pose", "trans", VERTICES)
            problem = Problem((data, coupling, prior), free, blocks=(block,))
            values |= JOINT_SOLVER.solve(problem, values, callback=Settled(SETTLED_SHARE)).values
        results.append(
            OnScan(
                values[VERTICES],
                values["pose"],
                values["trans"],
                cost_of_scan(data, values),
                *scan_evidence(data, values[VERTICES], coupled.coupling),
            )
        )
    return results


def cost_of_scan(residual: Residual, values: Values) -> float:
    """The cost of a residual of vertices alone."""
    return Problem((residual,), (VERTICES,)).linearize({VERTICES: values[VERTICES]}).cost
