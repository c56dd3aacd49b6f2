"""What SCAPE and BlendSCAPE learn: principal components of gradients, and every term in symbols.

    data    posed meshes, each placed freely, against the stitched triangles B_f D_f Q_f e_f
    E_Q     posedirs against zero, by a ridge
    E_D     a subject's D_f against those of the faces next to it, by a smoothness
    S       a person's D_f at rest against the mean and the shape directions times betas

(Anguelov et al., SCAPE, 2005; Hirshberg et al., Coregistration, 2012.) While D (shape) and Q (pose)
are learned, triangles need not fit together.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import casadi as cs
import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.blocks import Block, Values
from workbench.blocks.functions import sparse_constant
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadArgument
from workbench.geometry.triangles import gradient_derivatives
from workbench.problem import Problem
from workbench.residuals import Residual, gaussian, vertices


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


@dataclass(frozen=True, eq=False)
class TriangleShapes:
    """D_f = I + shapedirs[f] betas about the mean of some people; betas in standard deviations.

    Attributes:
        template: (N, 3) in metres, the mean.
        shapedirs: (F, 3, 3, B) per unit of betas.
        betas: (P, B) those of the people that it was learned from.
        explained: (B,) the share of the gradients' variance.
    """

    template: Array
    shapedirs: Array
    betas: Array
    explained: Array


def learn_gradient_shapes(people: ArrayLike, faces: Index, n_betas: int) -> TriangleShapes:
    """Principal components of the gradients X_f of people (P, N, 3) at rest, about their mean.

    The third axis of X_f is taken to first order, so that X_f is linear in the vertices: people
    who span k dimensions then have k components and no more. Raises BadArgument for more than
    P - 1 betas.
    """
    v = np.asarray(people, dtype=float)
    P = len(v)
    if not 0 <= n_betas < P:
        raise BadArgument(f"{P} people tell up to {P - 1} shape directions apart, not {n_betas}")
    template = v.mean(axis=0)
    away = np.moveaxis(v - template, 0, 2)
    gradients = gradient_derivatives(template, away, faces)  # (F, 3, 3, P)
    flat = gradients.reshape(-1, P)
    variances, coordinates = scipy.linalg.eigh(flat.T @ flat)
    order = np.argsort(-variances)[:n_betas]
    betas = coordinates[:, order] * np.sqrt(P - 1)
    directions = flat @ coordinates[:, order] / np.sqrt(P - 1)
    return TriangleShapes(
        template,
        directions.reshape(*gradients.shape[:3], n_betas),
        betas,
        variances[order] / max(variances.sum(), np.finfo(float).tiny),
    )


@dataclass(frozen=True, eq=False)
class SymbolicTriangles:
    """Posed meshes of S subjects; each subject has its own D, and all share Q.

    Attributes:
        body: the body, whose `posedirs` are unknowns.
        subjects: for each subject the body whose only shape direction, `subject s/shapedirs`
            (F, 3, 3, 1), is D_s - I, for betas of 1.
        posed: the meshes, and the pose of each to begin with.
    """

    body: TriangleBody
    subjects: tuple[TriangleBody, ...]
    posed: PosedMeshes

    @staticmethod
    def of(body: TriangleBody, D: Array, posed: PosedMeshes) -> "SymbolicTriangles":
        """The terms of meshes whose subjects have deformations D (S, F, 3, 3) to begin with."""
        learning = body.freed("posedirs")
        subjects = (
            replace(learning, shapedirs=(deformations - np.eye(3))[..., None]).freed(
                "shapedirs", prefix=f"subject {s}/"
            )
            for s, deformations in enumerate(D)
        )
        return SymbolicTriangles(learning, tuple(subjects), posed)

    def data(self) -> list[Residual]:
        """The meshes against the stitched surfaces, in metres; each mesh has its own `trans`."""
        residuals = []
        for j, (mesh, s) in enumerate(zip(self.posed.vertices, self.posed.person, strict=True)):
            symbols = (block.symbol for block in self.subjects[s].blocks(f"mesh {j}/"))
            points = self.subjects[s].points(*symbols)
            residuals.append(vertices(points, mesh, sigma=1.0, name=f"mesh {j}"))
        return residuals

    def small_posedirs(self, ridge: float) -> list[Residual]:
        """E_Q: `ridge` (m^2) times the sum of squares of posedirs per rad, as a residual."""
        block = self.body.free["posedirs"]
        column = cs.vec(block.symbol)
        return [gaussian(column, covariance=1 / ridge, unit=block.unit, name="E_Q")]

    def smooth_subjects(self, smoothness: float) -> list[Residual]:
        """E_D: `smoothness` (m^2) times the sum of |D_f - D_g|^2 over neighbours, as residuals."""
        tied = cs.MX(sparse_constant(neighbour_differences(self.body.faces)))
        residuals = []
        for s, subject in enumerate(self.subjects):
            block = subject.free["shapedirs"]
            D = cs.reshape(block.symbol, 9, self.body.n_faces).T  # less I, which cancels
            sigma = float(1 / np.sqrt(smoothness))
            residuals.append(Residual(f"E_D {s}", cs.vec(tied @ D), sigma, blocks=(block,)))
        return residuals

    def problem(self, residuals: Iterable[Residual], free: Sequence[str] = ()) -> Problem:
        """A problem of some terms; without names, all blocks that they read but betas are free."""
        terms = list(residuals)
        read = dict.fromkeys(name for residual in terms for name in residual.reads)
        every = [name for name in read if not name.endswith("/betas")]
        blocks = [b for body in (self.body, *self.subjects) for b in body.free.values()]
        return Problem(terms, free or every, blocks=blocks)

    def values(self) -> Values:
        """The first values: the given poses and D, and the best translation of each mesh."""
        values = {"posedirs": self.body.posedirs}
        for s, subject in enumerate(self.subjects):
            values[f"subject {s}/shapedirs"] = subject.shapedirs
        for j, (mesh, s) in enumerate(zip(self.posed.vertices, self.posed.person, strict=True)):
            pose, betas, trans = self.subjects[s].blocks(f"mesh {j}/")
            posed = self.subjects[s].vertices(self.posed.poses[j], np.ones(1))
            values[pose.name], values[betas.name] = self.posed.poses[j], np.ones(1)
            values[trans.name] = (mesh - posed).mean(axis=0)
        return values


def shape_term(D: Array, n_betas: int) -> tuple[Residual, tuple[Block, ...]]:
    """S: D_pf (P, F, 3, 3) of people at rest against mean_f + sum over b of S_fb beta_pb.

    The unknowns are the blocks `mean` (F, 9), `directions` (n_betas, 9 F) and `betas`
    (P, n_betas), which are returned beside the residual. Its minimum is principal component
    analysis (Eckart and Young 1936); directions and betas are found up to an invertible matrix.
    """
    P, F = D.shape[:2]
    blocks = (
        Block("mean", (F, 9)),
        Block("directions", (n_betas, 9 * F)),
        Block("betas", (P, n_betas)),
    )
    mean, directions, betas = (block.symbol for block in blocks)
    model = cs.repmat(cs.vec(mean), 1, P) + directions @ betas  # (9 F, P)
    observed = cs.MX(cs.DM(D.reshape(P, 9 * F).T))
    return Residual("S", cs.vec(model - observed), 1.0, blocks=blocks), blocks
