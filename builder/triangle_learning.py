"""Learning the three factors of X_f = B_f D_f Q_f from meshes in known poses.

Fitting X_f to each triangle of a mesh alone would be wrong: the triangles that a model predicts
do not fit together exactly, and a mesh shows them only after stitching. The unknown C_f (3, q) of

    minimise  sum over meshes |S(L_f C_f h_fi) - S(r_fi)|^2
              + smoothness sum over neighbours |C_f - C_g|^2 + ridge sum |C_f|^2

are therefore found for all triangles at once, because stitching couples each with every other. LSQR
(Paige and Saunders 1982) never forms a matrix, and can be used for whole people. S is linear: the
vertices of the stitched mesh about their mean.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse.linalg import LinearOperator, lsqr

from workbench.arrays import Array
from workbench.bodies.triangles import TriangleBody
from workbench.errors import WorkbenchError
from workbench.geometry.triangles import Stitching, edges
from workbench.training.triangles import PosedMeshes, neighbour_differences


class LsqrNotConverged(WorkbenchError):
    """The least squares were stopped before they reached their tolerance."""


@dataclass(frozen=True)
class Lsqr:
    """By LSQR, which asks for products only. Raises LsqrNotConverged after `most` iterations."""

    tolerance: float = 1e-10  # on what is left of b, or its part that could be explained, per |b|
    most: int = 4000

    def solve(self, A: LinearOperator, b: Array) -> Array:
        """The x (n,) that minimises |A x - b|^2, for A (m, n) and b (m,), up to the tolerance."""
        x, stopped, count = lsqr(
            A, b, atol=self.tolerance, btol=self.tolerance, conlim=0, iter_lim=self.most
        )[:3]
        if stopped == 7:
            raise LsqrNotConverged(
                f"least squares in {A.shape[1]} unknowns were stopped after {count} iterations; "
                "allow more of them, or raise the ridge or the tolerance"
            )
        return np.asarray(x)


LSQR = Lsqr()


@dataclass(frozen=True, eq=False)
class StitchedFit:
    """The least-squares problem of M meshes, whose C_f are unknown.

    Attributes:
        stitching: how triangles make a mesh.
        left: (F, M, 3, 3) L.
        features: (F, 2, M, q) h.
        wanted: (F, 2, M, 3) r in metres, the edges of the meshes minus the known part.
    """

    stitching: Stitching
    left: Array
    features: Array
    wanted: Array

    def solve(self, ridge: float = 0.0, smoothness: float = 0.0, by: Lsqr = LSQR) -> Array:
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
        target = self.stitched(self.wanted.reshape(2 * F, 3 * M))
        compared, held = target.size, 3 * q * F if ridge else 0
        rows = compared + held + 3 * q * tied.shape[0]

        def forth(x: Array) -> Array:
            X = x.reshape(F, 3, q)
            C = (X @ U).reshape(F, 3 * q)
            parts = [
                self.stitched(self._edges(X, white)),
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
            on_edges = self.stitched_adjoint(on_edges.reshape(target.shape))
            return np.asarray(self._back(on_edges, white) + by_C).ravel()

        operator = LinearOperator((rows, 3 * q * F), matvec=forth, rmatvec=back, dtype=np.float64)
        right = np.concatenate([target.ravel(), np.zeros(rows - compared)])
        return by.solve(operator, right).reshape(F, 3, q) @ U

    def stitched(self, edges: Array) -> Array:
        """The vertices (N, k) m about their mean that given edges (2 F, k) m are stitched to."""
        V = self.stitching.solve(self.stitching.A.T @ edges)
        return np.asarray(V - V.mean(axis=0))

    def stitched_adjoint(self, cotangent: Array) -> Array:
        """The gradient (2 F, k) of sum(cotangent * stitched(edges)) by the edges."""
        centred = cotangent - cotangent.mean(axis=0)
        return np.asarray(self.stitching.A @ self.stitching.solve(centred))

    def _edges(self, X: Array, white: Array) -> Array:
        moved = (white @ X.transpose(0, 2, 1)).reshape(self.wanted.shape)
        asked: Array = np.einsum("fmac,fimc->fima", self.left, moved)
        return asked.reshape(2 * len(asked), -1)

    def _back(self, on_edges: Array, white: Array) -> Array:
        pull = on_edges.reshape(self.wanted.shape)
        on_moved = np.einsum("fmac,fima->fimc", self.left, pull)
        F, _, M, _ = on_moved.shape
        return np.asarray(on_moved.reshape(F, 2 * M, 3).transpose(0, 2, 1) @ white)


def learn_pose_deformations(
    body: TriangleBody,
    posed: PosedMeshes,
    betas: Array,
    *,
    ridge: float,
    by: Lsqr = LSQR,
) -> TriangleBody:
    """The body with the posedirs that fit the meshes best; everything else is held.

    `betas` (P, B) of each person. E_Q, how far Q_f is from the identity, is `ridge` (m^2) times
    the sum of squares of posedirs per rad.
    """
    here = [
        body.arithmetic.evaluate(p, betas[i])
        for p, i in zip(posed.poses, posed.person, strict=True)
    ]
    left = np.stack([at.B @ at.D for at in here], axis=1)
    in_plane, flat = _plane(
        body.arithmetic.packed.edges
    )  # (F, 3, 2), (F, 2, 2): edges in the plane
    twists = np.stack([at.twists for at in here], axis=1)  # (F, M, 3 J)
    F, M, T = twists.shape
    features = np.einsum("fiu,fmt->fimut", flat, twists).reshape(F, 2, M, 2 * T)
    known = np.einsum("fmac,fic->fima", left, body.arithmetic.packed.edges)
    fit = StitchedFit(body.stitching, left, features, _missing(body, posed, known))
    C = fit.solve(ridge, by=by).reshape(F, 3, 2, T)
    return replace(body, posedirs=np.einsum("faut,fcu->fact", C, in_plane))


def learn_subject(
    body: TriangleBody,
    posed: PosedMeshes,
    *,
    smoothness: float,
    ridge: float = 0.0,
    by: Lsqr = LSQR,
) -> Array:
    """D_f (F, 3, 3) of one person from posed meshes alone, with the Q of the body.

    What the meshes do not determine is determined by E_D, which is `smoothness` (m^2) times the sum
    of |D_f - D_g|^2 over neighbours (Hirshberg et al., Coregistration, 2012).
    """
    here = [body.arithmetic.evaluate(pose, np.zeros(body.n_betas)) for pose in posed.poses]
    left = np.stack([at.B for at in here], axis=1)
    bent = np.stack([at.bent for at in here], axis=2)  # (F, 2, M, 3)
    known = np.einsum("fmac,fimc->fima", left, bent)
    fit = StitchedFit(body.stitching, left, bent, _missing(body, posed, known))
    return np.eye(3) + fit.solve(ridge, smoothness, by)


def _missing(body: TriangleBody, posed: PosedMeshes, known: Array) -> Array:
    """The edges of the meshes minus the known part of the model, (F, 2, M, 3) m."""
    return np.asarray(edges(posed.vertices, body.faces).transpose(1, 2, 0, 3) - known)


def _plane(e: Array) -> tuple[Array, Array]:
    """An orthonormal basis (F, 3, 2) of each face's plane, and its edges (F, 2, 2) there."""
    basis, _ = np.linalg.qr(e.transpose(0, 2, 1))
    return basis, np.asarray(e @ basis)
