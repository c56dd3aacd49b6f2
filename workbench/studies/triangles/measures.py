"""What a body is measured by: distances to meshes, additivity, jumps at seams, and time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from timeit import repeat

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.geometry.triangles import gradients
from workbench.problem import Problem
from workbench.residuals import vertices as on_vertices
from workbench.training.evaluation import VertexErrors
from workbench.training.poses import Fits
from workbench.training.triangles.fitting import AnyBody, fit_held_out
from workbench.training.triangles.stitched_fit import neighbour_differences

REPEATS = 7  # of what is timed; the least time counts


@dataclass(frozen=True, eq=False)
class HeldOutFits:
    """A body fitted to meshes of held-out people, its pose and shape unknown.

    Attributes:
        fits: the poses, betas and surfaces that were found.
        errors: of the surfaces' vertices, in metres.
    """

    fits: Fits
    errors: VertexErrors

    @classmethod
    def of(cls, body: AnyBody, first: SkinnedBody, meshes: Array) -> HeldOutFits:
        """Fit a body to meshes (M, N, 3) m, beginning with the segments of the body `first`."""
        fits = fit_held_out(body, first, meshes)
        return cls(fits, VertexErrors(np.linalg.norm(fits.surfaces - meshes, axis=-1)))

    def only(self, some: list[int]) -> HeldOutFits:
        """The chosen meshes alone."""
        f = self.fits
        return HeldOutFits(
            Fits(f.poses[some], f.betas[some], f.surfaces[some]),
            VertexErrors(self.errors.distances[some]),
        )


def additivity_gap(body: SkinnedBody | TriangleBody, pose: Array, betas: Array) -> Array:
    """What shape and pose do together minus what each does alone, (N, 3) m on the unposed surface.

    T(pose, betas) - T(pose, 0) - T(0, betas) + T(0, 0), T being the surface before the joints
    turn it. It is zero for SMPL, whose blend shapes are added, and (D - I)(Q - I) stitched for
    SCAPE, whose deformations are multiplied.
    """
    still, mean = np.zeros_like(pose), np.zeros_like(betas)
    both, bent, shaped, neither = (
        unposed(body, *at) for at in ((pose, betas), (pose, mean), (still, betas), (still, mean))
    )
    return both - bent - shaped + neither


def unposed(body: SkinnedBody | TriangleBody, pose: Array, betas: Array) -> Array:
    """The surface (N, 3) m deformed by pose and shape, before any joint turns it."""
    if isinstance(body, TriangleBody):
        at = body.arithmetic.evaluate(pose, betas)
        return np.asarray(at.of.placed(body.stitching.edge_sums(at.shaped)) + at.of.root)
    bent = body.posedirs @ body.kinematics.motion(pose, betas).features
    return np.asarray(body.template + body.shapedirs @ betas + bent)


def n_parameters(body: SkinnedBody | TriangleBody) -> int:
    """How many numbers training decides; posedirs that are zero are not counted."""
    shared = body.template.size + body.shapedirs.size + body.J_regressor.nnz
    weights = csr_array(body.weights).nnz
    return int(shared + weights + np.count_nonzero(body.posedirs))


def seam_jump(template: Array, faces: Index, part: Index, surfaces: Array) -> float:
    """How much the deformation X jumps at seams, where one part of the body meets another.

    The rms of |X_f - X_g| over neighbouring faces f and g of different parts. Takes the part of
    each face (F,) and surfaces (M, N, 3) m.
    """
    tied = neighbour_differences(faces)
    seams = tied[np.flatnonzero(tied @ part)]
    X = np.moveaxis(gradients(template, surfaces, faces), 0, -1).reshape(len(faces), -1)
    jumps = (seams @ X).reshape(seams.shape[0], 9, -1)
    return float(np.sqrt((jumps**2).sum(axis=1).mean()))


def n_seams(faces: Index, part: Index) -> int:
    """How many pairs of neighbouring faces are of different parts (F,)."""
    return int(np.count_nonzero(neighbour_differences(faces) @ part))


@dataclass(frozen=True)
class Timing:
    """The times of one body on one core, without work that is done only once.

    Attributes:
        mesh: the name of the mesh.
        model: the name of the model.
        n_vertices: of the mesh.
        n_faces: of the mesh.
        vertices_ms: the time of the surface at one pose and shape, the least of several.
        jacobian_ms: the time of the residual and its Jacobian by pose, betas and trans.
        density: the share of this Jacobian's entries that are not zero.
    """

    mesh: str
    model: str
    n_vertices: int
    n_faces: int
    vertices_ms: float
    jacobian_ms: float
    density: float


def timing(mesh: str, model: str, body: AnyBody, repeats: int = REPEATS) -> Timing:
    """Measured here and now, in a pose where every joint is bent."""
    rng = np.random.default_rng(0)
    at = {
        "pose": rng.normal(scale=0.3, size=(body.n_joints, 3)),
        "betas": rng.normal(size=body.n_betas),
        "trans": rng.normal(size=3),
    }
    points = body.points(*(block.symbol for block in body.blocks()))
    residual = on_vertices(points, np.zeros((body.n_vertices, 3)), sigma=1.0)
    problem = Problem([residual], tuple(at))
    J = problem.linearize(at).dense

    def least(run: Callable[[], object]) -> float:
        run()  # what is made once is made here
        return 1e3 * min(repeat(run, number=1, repeat=repeats))

    return Timing(
        mesh,
        model,
        body.n_vertices,
        len(body.faces),
        least(lambda: body.vertices(*at.values())),
        least(lambda: problem.linearize(at)),
        float(np.count_nonzero(J) / J.size),
    )
