"""The pose of each registration, by Levenberg-Marquardt on a `Problem` of its subject.

The free names are `pose` and `trans`; templates, blend shapes, joints and weights are fixed at
those of the estimate.
"""

from dataclasses import dataclass, replace
from functools import cached_property, partial

import casadi as cs
import numpy as np
from scipy.sparse import csr_array, eye_array, hstack

from workbench.arrays import Array, Index
from workbench.blocks import Block, Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.forward.posing import local_rotations
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import vector_from_matrix
from workbench.geometry.solids import mesh_edges
from workbench.problem import Problem
from workbench.residuals import Residual, edges, gaussian
from workbench.solvers import LevenbergMarquardt
from workbench.training.estimate import Estimate
from workbench.training.execution import SERIAL, Execution
from workbench.training.registrations import Batch, Registrations, rows_of_jobs

JOB_SIZE = 64  # registrations whose poses one job finds
TOLERANCE = 1e-10  # of the solver: poses of noiseless meshes are exact
FIRST_DAMPING = 1e-7  # of the stiffest turn, the root's: a wrist moves a thousandth as much


def body_of_subjects(estimate: Estimate, faces: Index) -> SkinnedBody:
    """All subjects of an estimate as one body: for subject s, beta s is one and the others zero.

    The joints are additional vertices after the N of the surface, and the regressor reads them
    off, so that they are where the estimate has them.
    """
    N, K = estimate.weights.shape
    P = estimate.posedirs
    everybody = np.concatenate([estimate.templates, estimate.joints], axis=1)
    return SkinnedBody(
        template=np.zeros((N + K, 3)),
        shapedirs=np.ascontiguousarray(np.moveaxis(everybody, 0, 2)),
        posedirs=np.concatenate([P, np.zeros((K, *P.shape[1:]))]),
        J_regressor=csr_array(hstack([csr_array((K, N)), eye_array(K)])),
        weights=np.concatenate([estimate.weights, np.eye(K)]),
        parents=estimate.parents,
        faces=faces,
        joint_names=tuple(f"joint {k}" for k in range(K)),
        name="subjects",
    )


@dataclass(frozen=True, eq=False)
class FittedMeshes:
    """A body fitted to M meshes.

    Attributes:
        poses: (M, K, 3) in radians.
        betas: (M, B) in standard deviations.
        surfaces: (M, N, 3) in metres, all vertices of the body.
    """

    poses: Array
    betas: Array
    surfaces: Array

    def rms(self, meshes: Array) -> float:
        """The root mean square distance of the vertices from meshes (M, N, 3), in their unit."""
        return float(np.sqrt(np.mean(np.sum((self.surfaces - meshes) ** 2, axis=-1))))


@dataclass(frozen=True, eq=False)
class PoseFit:
    """Finds the poses of one body in meshes of its first N vertices, and betas given a prior.

    Attributes:
        body: the body, whose arrays are held.
        n_vertices: N.
        sigma: the standard deviation of what is compared, in metres.
        steps: the largest number of Levenberg-Marquardt steps for a mesh.
        faces: (F, 3) triangles whose edge vectors are compared, which ignore the translation and
            depend little on shape; None compares vertices, and finds `trans` too.
        shape_sigma: of the prior on betas, in standard deviations of the population; None holds
            them at given values.
    """

    body: Body
    n_vertices: int
    sigma: float
    steps: int
    faces: Index | None = None
    shape_sigma: float | None = None

    @cached_property
    def _ends(self) -> Index | None:
        """The ends of each edge, (E, 2)."""
        return None if self.faces is None else mesh_edges(self.faces)

    def _compared(self, confidence: Array) -> Array:
        """The confidence of what is compared: of an edge the smaller one of its ends."""
        return confidence if self._ends is None else confidence[self._ends].min(axis=1)

    @cached_property
    def problem(self) -> Problem:
        """The problem of any mesh: the observation is a fixed block."""
        N, sigma, free = self.n_vertices, self.sigma, ["pose"]
        compared, observed = self._compared(np.ones(N)), Block("observed", (N, 3), "m")
        trusted = Block("confidence", (len(compared),))
        symbols = [block.symbol for block in self.body.blocks()]
        points, target = self.body.points(*symbols, vertices=range(N)), observed.symbol
        if self._ends is None:
            offsets = cs.vec(points.symbol - target)
            weights = cs.vec(cs.repmat(trusted.symbol.T, 3, 1))
            data = Residual("vertices", offsets, sigma, "m", points=(points,), weights=weights)
            free += ["trans"]
        else:
            data = edges(
                points, target, self._ends, sigma=sigma, confidence=trusted.symbol, name="edges"
            )
        residuals = [data]
        if self.shape_sigma is not None and self.body.n_betas:
            residuals.append(gaussian(symbols[1], covariance=self.shape_sigma**2))
            free += ["betas"]
        return Problem(residuals, free, blocks=(observed, trusted))

    def values(
        self, start: Array, vertices: Array, confidence: Array, betas: Array | None = None
    ) -> Values:
        """The pose (K, 3) rad, betas and trans of one mesh; never worse than the start.

        `start` is a first guess of the pose. Betas begin at the given ones, or at zero, and stay
        there if they are fixed.
        """
        values: Values = self.body.start() | {"pose": start, "observed": vertices}
        if betas is not None:
            values["betas"] = betas
        values["confidence"] = self._compared(confidence)
        values["trans"] = self._trans(values, vertices, confidence)
        solver = LevenbergMarquardt(
            max_iterations=self.steps,
            gradient_tolerance=TOLERANCE,
            first_damping=FIRST_DAMPING,
        )
        solution = solver.solve(self.problem, values)
        fitted = {name: values[name] for name in ("pose", "betas", "trans")} | solution.values
        return fitted | {"trans": self._trans(fitted, vertices, confidence)}

    def fits(self, starts: Array, meshes: Array, betas: Array | None = None) -> FittedMeshes:
        """The body fitted to each mesh (M, N, 3) m, from poses (M, K, 3) rad and betas (M, B)."""
        confidence = np.ones(self.n_vertices)
        shapes = np.zeros((len(meshes), self.body.n_betas)) if betas is None else betas
        each = zip(starts, meshes, shapes, strict=True)
        fitted = [self.values(start, mesh, confidence, shape) for start, mesh, shape in each]
        poses, fitted_betas = (np.stack([v[name] for v in fitted]) for name in ("pose", "betas"))
        surfaces = [self.body.vertices(v["pose"], v["betas"], v["trans"]) for v in fitted]
        return FittedMeshes(poses, fitted_betas, np.stack(surfaces))

    def _trans(self, values: Values, vertices: Array, confidence: Array) -> Array:
        """The best translation (3,) m of a given pose and shape."""
        posed = self.body.vertices(values["pose"], values["betas"])[: self.n_vertices]
        return np.average(vertices - posed, axis=0, weights=confidence)


def poses_of(
    faces: Index, by_edges: bool, sigma: float, steps: int, job: tuple[Estimate, Batch]
) -> Array:
    """The poses (c, K, 3) rad of the registrations of one job, from those of its estimate.

    Where the confidence depends on the direction, its mean counts.
    """
    estimate, batch = job
    body = body_of_subjects(estimate, faces)
    fit = PoseFit(body, batch.vertices.shape[1], sigma, steps, faces if by_edges else None)
    betas = np.eye(len(estimate.templates))[batch.subject]
    each = zip(estimate.poses, batch.vertices, batch.trust, betas, strict=True)
    return np.stack([fit.values(*arguments)["pose"] for arguments in each])


def fitted_poses(
    estimate: Estimate,
    registrations: Registrations,
    faces: Index,
    sigma: float,
    steps: int,
    *,
    by_edges: bool = False,
    execution: Execution = SERIAL,
) -> Estimate:
    """The estimate with every pose fitted again, to vertices or edges, in at most `steps` each."""

    def job(rows: slice) -> tuple[Estimate, Batch]:
        batch = registrations.read(rows)
        theirs, numbered = estimate.of_rows(rows, batch.subject)
        return theirs, replace(batch, subject=numbered)

    poses = estimate.poses.copy()
    jobs = rows_of_jobs(len(poses), JOB_SIZE)
    work = partial(poses_of, faces, by_edges, sigma, steps)
    for rows, fitted in zip(jobs, execution.executor(work, map(job, jobs)), strict=True):
        poses[rows] = fitted
        execution.finished(rows.stop, len(poses))
    return replace(estimate, poses=poses)


def poses_of_segments(
    template: Array,
    weights: Array,
    parents: tuple[int, ...],
    vertices: Array,
    confidence: Array,
) -> Array:
    """A first guess (K, 3) rad: each segment of the template turned onto its own vertices."""
    trusted = weights.T * confidence + 1e-9 * confidence
    world = np.stack([procrustes(template, vertices, each).R for each in trusted])
    return vector_from_matrix(local_rotations(world, parents))
