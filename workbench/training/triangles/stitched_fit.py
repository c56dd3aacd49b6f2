"""Per-triangle matrices by ridge least squares, seen through the stitching.

The edges of a stitched mesh are Pi (X e), where Pi = A (A'A)^-1 A' is the orthogonal projection on
edges that close. Fitting X_f to each triangle of a mesh alone would take Pi for the identity, which
it is not: what a model's triangles ask for never quite closes. So the unknown C_f (3, q) of

    minimise  sum over meshes |Pi (L_f C_f h_fi) - r_fi|^2
              + smoothness sum over neighbours |C_f - C_g|^2 + ridge sum |C_f|^2

are found for all triangles at once, by LSQR (Paige and Saunders 1982), which never forms a matrix.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, lsqr

from workbench.errors import WorkbenchError
from workbench.geometry.stitching import Stitching

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class NotConverged(WorkbenchError):
    """The least squares were stopped before they met their tolerance."""


@dataclass(frozen=True, eq=False)
class StitchedFit:
    """M meshes whose edges before stitching are L_f C_f h_fi + what is known."""

    stitching: Stitching
    left: Array  # L (F, M, 3, 3)
    features: Array  # h (F, 2, M, q)
    wanted: Array  # r (F, 2, M, 3) m: edges of the meshes less those of what is known, stitched

    def solve(
        self,
        ridge: float = 0.0,
        smoothness: float = 0.0,
        tolerance: float = 1e-10,
        most: int = 4000,
    ) -> Array:
        """C (F, 3, q); `ridge` and `smoothness` are in m^2 per squared unit of C.

        `tolerance` is on what is left of r, or on its part that could still be explained, relative
        to r. Raises NotConverged after `most` iterations.
        """
        F, _, M, q = self.features.shape
        h = self.features.reshape(F, 2 * M, q)
        # unknowns whose units are what they do to the edges of their own face
        gram = h.transpose(0, 2, 1) @ h + ridge * np.eye(q)
        size = np.trace(gram, axis1=1, axis2=2)[:, None, None] / max(q, 1)
        tiny = np.finfo(float).eps * np.eye(q)
        U = np.linalg.inv(np.linalg.cholesky(gram + tiny * np.where(size > 0, size, 1.0)))
        white = h @ U.transpose(0, 2, 1)
        tied = neighbour_differences(self.stitching.faces)[: None if smoothness else 0]
        seen, held = self.wanted.size, 3 * q * F if ridge else 0
        rows = seen + held + 3 * q * tied.shape[0]

        def forth(x: Array) -> Array:
            X = x.reshape(F, 3, q)
            C = (X @ U).reshape(F, 3 * q)
            parts = [self._edges(X, white), np.sqrt(ridge) * C[: F if ridge else 0],
                     np.sqrt(smoothness) * (tied @ C)]  # fmt: skip
            return np.concatenate([part.ravel() for part in parts])

        def back(pull: Array) -> Array:
            on_edges, on_C, on_tied = np.split(pull.ravel(), [seen, seen + held])
            by_C = np.sqrt(smoothness) * (tied.T @ on_tied.reshape(-1, 3 * q))
            if ridge:
                by_C += np.sqrt(ridge) * on_C.reshape(F, 3 * q)
            by_C = by_C.reshape(F, 3, q) @ U.transpose(0, 2, 1)
            return np.asarray(self._back(on_edges, white) + by_C).ravel()

        operator = LinearOperator((rows, 3 * q * F), matvec=forth, rmatvec=back, dtype=np.float64)
        right = np.concatenate([self.wanted.ravel(), np.zeros(rows - seen)])
        x, stopped, count = lsqr(
            operator, right, atol=tolerance, btol=tolerance, iter_lim=most, conlim=0
        )[:3]
        if stopped == 7:
            raise NotConverged(
                f"least squares over {F} triangles were stopped after {count} iterations; allow "
                "more of them, or raise the ridge or the tolerance"
            )
        return np.asarray(x).reshape(F, 3, q) @ U

    def _edges(self, X: Array, white: Array) -> Array:
        moved = (white @ X.transpose(0, 2, 1)).reshape(self.wanted.shape)
        return closed(self.stitching, np.einsum("fmac,fimc->fima", self.left, moved))

    def _back(self, pull: Array, white: Array) -> Array:
        on_edges = closed(self.stitching, pull.reshape(self.wanted.shape))
        on_moved = np.einsum("fmac,fima->fimc", self.left, on_edges)
        F, _, M, _ = on_moved.shape
        return np.asarray(on_moved.reshape(F, 2 * M, 3).transpose(0, 2, 1) @ white)


def closed(stitching: Stitching, edges: Array) -> Array:
    """Pi e: the edges of the meshes that edges (F, 2, M, 3) are stitched into."""
    flat = edges.reshape(2 * len(edges), -1)
    return np.asarray(stitching.A @ stitching.solve(stitching.A.T @ flat)).reshape(edges.shape)


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
