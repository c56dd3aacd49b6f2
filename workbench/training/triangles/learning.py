"""Learning the three factors of X_f = B_f D_f Q_f from meshes in known poses."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadArgument
from workbench.geometry.triangles import Stitching, edges
from workbench.training.triangles.stitched_fit import (
    LSQR,
    ClosedEdges,
    LeastSquares,
    Measure,
    StitchedFit,
)


@dataclass(frozen=True, eq=False)
class PosedMeshes:
    """M meshes of one topology in known poses. Raises BadArgument if they do not fit together.

    Attributes:
        vertices: (M, N, 3) in metres.
        poses: (M, K, 3) in radians.
        person: (M,) the number of each mesh's person, from 0.
    """

    vertices: Array
    poses: Array
    person: Index

    def __post_init__(self) -> None:
        M = len(self.vertices)
        if self.poses.shape[:1] != (M,) or self.person.shape != (M,) or not M:
            raise BadArgument(
                f"meshes {self.vertices.shape}, poses {self.poses.shape} and persons "
                f"{self.person.shape} must be as many, and at least one"
            )


def learn_bends(
    body: TriangleBody,
    posed: PosedMeshes,
    betas: Array,
    *,
    ridge: float,
    by: LeastSquares = LSQR,
    measure: Callable[[Stitching], Measure] = ClosedEdges,
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
    fit = StitchedFit(body.stitching, left, features, _missing(body, posed, known), measure)
    C = fit.solve(ridge, by=by).reshape(F, 3, 2, T)
    return replace(body, posedirs=np.einsum("faut,fcu->fact", C, in_plane))


def learn_person(
    body: TriangleBody,
    posed: PosedMeshes,
    *,
    smoothness: float,
    ridge: float = 0.0,
    by: LeastSquares = LSQR,
    measure: Callable[[Stitching], Measure] = ClosedEdges,
) -> Array:
    """D_f (F, 3, 3) of one person from posed meshes alone, with the Q of the body.

    What the meshes do not determine is determined by E_D, which is `smoothness` (m^2) times the sum
    of |D_f - D_g|^2 over neighbours (Hirshberg et al., Coregistration, 2012).
    """
    here = [body.arithmetic.evaluate(pose, np.zeros(body.n_betas)) for pose in posed.poses]
    left = np.stack([at.B for at in here], axis=1)
    bent = np.stack([at.bent for at in here], axis=2)  # (F, 2, M, 3)
    known = np.einsum("fmac,fimc->fima", left, bent)
    fit = StitchedFit(body.stitching, left, bent, _missing(body, posed, known), measure)
    return np.eye(3) + fit.solve(ridge, smoothness, by)


def _missing(body: TriangleBody, posed: PosedMeshes, known: Array) -> Array:
    """The edges of the meshes minus the known part of the model, (F, 2, M, 3) m."""
    return np.asarray(edges(posed.vertices, body.faces).transpose(1, 2, 0, 3) - known)


def _plane(e: Array) -> tuple[Array, Array]:
    """An orthonormal basis (F, 3, 2) of each face's plane, and its edges (F, 2, 2) there."""
    basis, _ = np.linalg.qr(e.transpose(0, 2, 1))
    return basis, np.asarray(e @ basis)
