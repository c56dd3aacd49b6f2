"""The pose of each registration, by Levenberg and Marquardt on a `Problem` of its subject.

What is free here are the names `pose` and `trans`; templates, blend shapes, joints and weights
are fixed at the estimate's.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as cs
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array, hstack

from workbench.blocks import Block, Points, Values
from workbench.bodies import SkinnedBody
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import vector_from_matrix
from workbench.problem import Problem
from workbench.residuals import Residual, edges, gaussian
from workbench.solvers import LevenbergMarquardt, Solver
from workbench.training.estimate import Estimate
from workbench.training.mesh_graph import edges_of
from workbench.training.registrations import Registrations, batches

Array = NDArray[np.float64]
Index = NDArray[np.int64]
TOLERANCE = 1e-10  # of the solver: poses of noiseless meshes are exact


@dataclass(frozen=True, eq=False)
class OnVertices:
    """The vertices' distances: what E_D is made of. Where the body stands is sought as well."""

    free: tuple[str, ...] = ("pose", "trans")

    def residual(self, points: Points, observed: Block, trust: Block, sigma: float) -> Residual:
        """trust (v - v^), in m."""
        away = (points.symbol - observed.symbol) * cs.repmat(trust.symbol.T, 3, 1)
        return Residual("vertices", cs.vec(away), sigma, "m", points=(points,))

    def trust(self, seen: Array) -> Array:
        """Of each vertex, its root: variances are divided."""
        return np.sqrt(seen)


@dataclass(frozen=True, eq=False)
class OnEdges:
    """The edges' differences: where the body stands does not matter, and hardly its shape."""

    faces: Index
    free: tuple[str, ...] = ("pose",)

    @cached_property
    def pairs(self) -> Index:
        """The ends of each edge, (E, 2)."""
        return edges_of(self.faces)

    def residual(self, points: Points, observed: Block, trust: Block, sigma: float) -> Residual:
        """See residuals.edges."""
        return edges(
            points, observed.symbol, self.pairs, sigma=sigma, confidence=trust.symbol, name="edges"
        )

    def trust(self, seen: Array) -> Array:
        """Of each edge: the less of its ends."""
        return np.asarray(np.sqrt(seen[self.pairs].min(axis=1)))


Compared = OnVertices | OnEdges
Say = Callable[[int, int], None]  # how many are done, of how many


def untold(done: int, of: int) -> None:
    """Nobody is told."""


def subject_body(estimate: Estimate, subject: int, faces: Index) -> SkinnedBody:
    """One subject as a body whose joints are where the estimate has them.

    They are vertices of their own, after the N of the surface, and the regressor reads them off.
    """
    N, K = estimate.weights.shape
    joints = estimate.joints[subject]
    return SkinnedBody(
        template=np.concatenate([estimate.templates[subject], joints]),
        shapedirs=np.zeros((N + K, 3, 1)),
        posedirs=np.concatenate([estimate.posedirs, np.zeros((K, *estimate.posedirs.shape[1:]))]),
        J_regressor=csr_array(hstack([csr_array((K, N)), eye_array(K)])),
        weights=np.concatenate([estimate.weights, np.eye(K)]),
        parents=estimate.parents,
        faces=faces,
        joint_names=tuple(f"joint {k}" for k in range(K)),
        name=f"subject {subject}",
    )


@dataclass(frozen=True)
class ShapePrior:
    """Betas are free as well, ordinary at so many standard deviations."""

    sigma: float = 1.0


@dataclass(frozen=True, eq=False)
class PoseFit:
    """Poses of one body from meshes of its first N vertices; its shape too, given a prior."""

    body: SkinnedBody
    n_vertices: int
    compared: Compared
    sigma: float  # m
    solver: Solver
    shapes: ShapePrior | None = None

    @cached_property
    def _blocks(self) -> tuple[Block, Block]:
        N = self.n_vertices
        n = len(self.compared.trust(np.ones(N)))
        return Block("observed", (N, 3), "m"), Block("trust", (n,))

    @cached_property
    def problem(self) -> Problem:
        """The same for every mesh: what was observed is a fixed block."""
        observed, trust = self._blocks
        symbols = [block.symbol for block in self.body.blocks()]
        points = self.body.points(*symbols, vertices=range(self.n_vertices))
        residuals = [self.compared.residual(points, observed, trust, self.sigma)]
        free = self.compared.free
        if self.shapes is not None:
            residuals.append(gaussian(symbols[1], covariance=self.shapes.sigma**2))
            free = (*free, "betas")
        return Problem(residuals, free, blocks=self._blocks)

    def values(self, start: Array, vertices: Array, seen: Array) -> Values:
        """Pose (K, 3) rad, betas and trans from a first guess of the pose; not worse than it."""
        values: Values = self.body.start() | {"pose": start, "observed": vertices}
        values["trust"] = self.compared.trust(seen)
        values["trans"] = self._trans(values, vertices, seen)
        solution = self.solver.solve(self.problem, values)
        found = {name: values[name] for name in ("pose", "betas", "trans")} | solution.values
        return found | {"trans": self._trans(found, vertices, seen)}

    def _trans(self, values: Values, vertices: Array, seen: Array) -> Array:
        """Where the body stands, given how."""
        posed = self.body.vertices(values["pose"], values["betas"])[: self.n_vertices]
        return np.average(vertices - posed, axis=0, weights=seen)


def fitted_poses(
    estimate: Estimate,
    registrations: Registrations,
    faces: Index,
    compared: Compared,
    sigma: float,
    steps: int,
    say: Say = untold,
) -> Estimate:
    """Every registration's pose fitted anew, the estimate's as the start; `steps` at most each."""
    solver = LevenbergMarquardt(max_iterations=steps, gradient_tolerance=TOLERANCE)
    fits: dict[int, PoseFit] = {}
    poses = estimate.poses.copy()
    for batch in batches(registrations):
        for at, s in enumerate(batch.subject.tolist()):
            if s not in fits:
                body = subject_body(estimate, s, faces)
                fits[s] = PoseFit(body, registrations.n_vertices, compared, sigma, solver)
            j = batch.some.start + at
            poses[j] = fits[s].values(poses[j], batch.vertices[at], batch.seen[at])["pose"]
            say(j + 1, len(poses))
    return replace(estimate, poses=poses)


def segments_turned(
    template: Array, weights: Array, parents: tuple[int, ...], vertices: Array, seen: Array
) -> Array:
    """A first guess (K, 3) rad: each segment of the template turned onto its own vertices."""
    world = np.stack([procrustes(template, vertices, w * seen + 1e-9 * seen).R for w in weights.T])
    local = world.copy()
    for k, parent in enumerate(parents[1:], start=1):
        local[k] = world[parent].T @ world[k]
    return vector_from_matrix(local)
