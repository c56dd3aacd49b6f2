"""Per-triangle matrices by ridge least squares on the stitched mesh.

Fitting X_f to each triangle of a mesh alone would be wrong: the triangles that a model predicts
do not fit together exactly, and a mesh shows them only after stitching. The unknown C_f (3, q) of

    minimise  sum over meshes |S(L_f C_f h_fi) - S(r_fi)|^2
              + smoothness sum over neighbours |C_f - C_g|^2 + ridge sum |C_f|^2

are therefore found for all triangles at once, because stitching couples each with every other. LSQR
(Paige and Saunders 1982) never forms a matrix, and can be used for whole people. S is linear:
either the edges of the stitched mesh (ClosedEdges, SCAPE's own measure, which hardly notices a limb
that drifts) or its vertices about their mean (CentredVertices).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, lsqr

from workbench.arrays import Array, Index
from workbench.errors import WorkbenchError
from workbench.geometry.triangles import Stitching


class NotConverged(WorkbenchError):
    """The least squares were stopped before they reached their tolerance."""


class LeastSquares(Protocol):
    """A way to minimise |A x - b|^2; where that leaves x open, the shortest."""

    def solve(self, A: LinearOperator, b: Array) -> Array:
        """The x (n,) that minimises |A x - b|^2, for A (m, n) and b (m,)."""


@dataclass(frozen=True)
class Lsqr:
    """By LSQR, which asks for products only. Raises NotConverged after `most` iterations."""

    tolerance: float = 1e-10  # on what is left of b, or its part that could be explained, per |b|
    most: int = 4000

    def solve(self, A: LinearOperator, b: Array) -> Array:
        """The x (n,) that minimises |A x - b|^2, for A (m, n) and b (m,), up to the tolerance."""
        x, stopped, count = lsqr(
            A, b, atol=self.tolerance, btol=self.tolerance, conlim=0, iter_lim=self.most
        )[:3]
        if stopped == 7:
            raise NotConverged(
                f"least squares in {A.shape[1]} unknowns were stopped after {count} iterations; "
                "allow more of them, or raise the ridge or the tolerance"
            )
        return np.asarray(x)


LSQR = Lsqr()


class Measure(Protocol):
    """What is compared of a stitched mesh, as a linear function of the given edges (2 F, k)."""

    def observed(self, edges: Array) -> Array:
        """The quantities that are compared, (rows, k) m."""

    def adjoint(self, pull: Array) -> Array:
        """The gradient (2 F, k) of sum(pull * observed(edges)) by the edges."""


@dataclass(frozen=True, eq=False)
class ClosedEdges:
    """The edges of the stitched mesh: Pi = A (A'A)^-1 A', an orthogonal projection."""

    stitching: Stitching

    def observed(self, edges: Array) -> Array:
        """The edges of the stitched mesh, (2 F, k) m."""
        return np.asarray(self.stitching.A @ self.stitching.solve(self.stitching.A.T @ edges))

    def adjoint(self, pull: Array) -> Array:
        """The adjoint of Pi, which is Pi itself."""
        return self.observed(pull)


@dataclass(frozen=True, eq=False)
class CentredVertices:
    """The vertices of the stitched mesh about their mean."""

    stitching: Stitching

    def observed(self, edges: Array) -> Array:
        """The centred vertices, (N, k) m."""
        V = self.stitching.solve(self.stitching.A.T @ edges)
        return np.asarray(V - V.mean(axis=0))

    def adjoint(self, pull: Array) -> Array:
        """The gradient (2 F, k) by the edges, see `Measure`."""
        return np.asarray(self.stitching.A @ self.stitching.solve(pull - pull.mean(axis=0)))


@dataclass(frozen=True, eq=False)
class StitchedFit:
    """The least-squares problem of M meshes, whose C_f are unknown.

    Attributes:
        stitching: how triangles make a mesh.
        left: (F, M, 3, 3) L.
        features: (F, 2, M, q) h.
        wanted: (F, 2, M, 3) r in metres, the edges of the meshes minus the known part.
        measure: what of the stitched mesh is compared.
    """

    stitching: Stitching
    left: Array
    features: Array
    wanted: Array
    measure: Callable[[Stitching], Measure] = ClosedEdges

    def solve(self, ridge: float = 0.0, smoothness: float = 0.0, by: LeastSquares = LSQR) -> Array:
        """C (F, 3, q); `ridge` and `smoothness` are in m^2 per squared unit of C."""
        F, _, M, q = self.features.shape
        h = self.features.reshape(F, 2 * M, q)
        # unknowns whose units are what they do to the edges of their own face
        gram = h.transpose(0, 2, 1) @ h + ridge * np.eye(q)
        size = np.trace(gram, axis1=1, axis2=2)[:, None, None] / max(q, 1)
        tiny = np.finfo(float).eps * np.eye(q)
        U = np.linalg.inv(np.linalg.cholesky(gram + tiny * np.where(size > 0, size, 1.0)))
        white = h @ U.transpose(0, 2, 1)
        tied = neighbour_differences(self.stitching.faces)[: None if smoothness else 0]
        measure = self.measure(self.stitching)
        target = measure.observed(self.wanted.reshape(2 * F, 3 * M))
        compared, held = target.size, 3 * q * F if ridge else 0
        rows = compared + held + 3 * q * tied.shape[0]

        def forth(x: Array) -> Array:
            X = x.reshape(F, 3, q)
            C = (X @ U).reshape(F, 3 * q)
            parts = [
                measure.observed(self._edges(X, white)),
                np.sqrt(ridge) * C[: F if ridge else 0],
                np.sqrt(smoothness) * (tied @ C),
            ]
            return np.concatenate([part.ravel() for part in parts])

        def back(pull: Array) -> Array:
            on_edges, on_C, on_tied = np.split(pull.ravel(), [compared, compared + held])
            by_C = np.sqrt(smoothness) * (tied.T @ on_tied.reshape(-1, 3 * q))
            if ridge:
                by_C += np.sqrt(ridge) * on_C.reshape(F, 3 * q)
            by_C = by_C.reshape(F, 3, q) @ U.transpose(0, 2, 1)
            on_edges = measure.adjoint(on_edges.reshape(target.shape))
            return np.asarray(self._back(on_edges, white) + by_C).ravel()

        operator = LinearOperator((rows, 3 * q * F), matvec=forth, rmatvec=back, dtype=np.float64)
        right = np.concatenate([target.ravel(), np.zeros(rows - compared)])
        return by.solve(operator, right).reshape(F, 3, q) @ U

    def _edges(self, X: Array, white: Array) -> Array:
        moved = (white @ X.transpose(0, 2, 1)).reshape(self.wanted.shape)
        asked: Array = np.einsum("fmac,fimc->fima", self.left, moved)
        return asked.reshape(2 * len(asked), -1)

    def _back(self, on_edges: Array, white: Array) -> Array:
        pull = on_edges.reshape(self.wanted.shape)
        on_moved = np.einsum("fmac,fima->fimc", self.left, pull)
        F, _, M, _ = on_moved.shape
        return np.asarray(on_moved.reshape(F, 2 * M, 3).transpose(0, 2, 1) @ white)


def neighbour_differences(faces: Index) -> csr_array:
    """(E, F): one face less the other, for every edge that two faces share."""
    sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    owner = np.tile(np.arange(len(faces)), 3)
    order = np.lexsort(sides.T)
    same = (np.diff(sides[order], axis=0) == 0).all(axis=1)
    first, second = owner[order[:-1][same]], owner[order[1:][same]]
    E = len(first)
    return csr_array(
        (
            np.tile([1.0, -1.0], E),
            (np.repeat(np.arange(E), 2), np.stack([first, second], 1).ravel()),
        ),
        shape=(E, len(faces)),
    )
