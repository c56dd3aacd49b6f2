"""The terms by which SCAPE and BlendSCAPE are learned, as residuals of a problem.

    data    posed meshes, each placed freely, against the stitched triangles B_f D_f Q_f e_f
    E_Q     posedirs against zero, by a ridge
    E_D     a subject's D_f against those of the faces next to it, by a smoothness

(Hirshberg et al., Coregistration, 2012.) All blocks may be free at once.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.blocks.functions import sparse_constant
from workbench.bodies.triangles import TriangleBody
from workbench.problem import Problem
from workbench.residuals import Residual, gaussian, vertices
from workbench.training.triangles import PosedMeshes, neighbour_differences


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
            replace(learning, shapedirs=(one - np.eye(3))[..., None]).freed(
                "shapedirs", prefix=f"subject {s}/"
            )
            for s, one in enumerate(D)
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
