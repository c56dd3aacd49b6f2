"""The pose of each registration, by Levenberg and Marquardt on a `Problem` of its subject.

What is free here are the names `pose` and `trans`; templates, blend shapes, joints and weights
are fixed at the estimate's.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as cs
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array, hstack

from workbench.blocks import Block, Points, Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import vector_from_matrix
from workbench.problem import Problem
from workbench.residuals import Residual, edges, gaussian
from workbench.solvers import LevenbergMarquardt, Solver
from workbench.training.crew import ONE, Hands
from workbench.training.estimate import Estimate
from workbench.training.mesh_graph import edges_of
from workbench.training.registrations import Registrations

Array = NDArray[np.float64]
Index = NDArray[np.int64]
SITTING = 64  # registrations of one sitting: what a process is given at a time
TOLERANCE = 1e-10  # of the solver: poses of noiseless meshes are exact
FIRST_DAMPING = 1e-7  # of the stiffest turn, the root's: a wrist moves a thousandth as much


@dataclass(frozen=True, eq=False)
class OnVertices:
    """The vertices' distances: what E_D is made of. Where the body stands is sought as well."""

    free: tuple[str, ...] = ("pose", "trans")

    def on(self, faces: Index) -> "OnVertices":
        """The same on another mesh."""
        return self

    def residual(self, points: Points, observed: Block, trust: Block, sigma: float) -> Residual:
        """v - v^, in m, weighted by trust."""
        away = cs.vec(points.symbol - observed.symbol)
        weights = cs.vec(cs.repmat(trust.symbol.T, 3, 1))
        return Residual("vertices", away, sigma, "m", points=(points,), weights=weights)

    def trust(self, seen: Array) -> Array:
        """Of each vertex: what it is seen with divides its variance."""
        return seen


@dataclass(frozen=True, eq=False)
class OnEdges:
    """The edges' differences: where the body stands does not matter, and hardly its shape."""

    faces: Index
    free: tuple[str, ...] = ("pose",)

    def on(self, faces: Index) -> "OnEdges":
        """The same on another mesh."""
        return OnEdges(faces, self.free)

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
        return np.asarray(seen[self.pairs].min(axis=1))


Compared = OnVertices | OnEdges


def body_of_subjects(sitting: "Sitting") -> SkinnedBody:
    """Some subjects as one body: the betas of subject s are one at s, and zero elsewhere.

    Joints are vertices of their own, after the N of the surface, and the regressor reads them
    off, so that they are where the estimate has them.
    """
    N, K = sitting.weights.shape
    P = sitting.posedirs
    everybody = np.concatenate([sitting.templates, sitting.joints], axis=1)
    return SkinnedBody(
        template=np.zeros((N + K, 3)),
        shapedirs=np.ascontiguousarray(np.moveaxis(everybody, 0, 2)),
        posedirs=np.concatenate([P, np.zeros((K, *P.shape[1:]))]),
        J_regressor=csr_array(hstack([csr_array((K, N)), eye_array(K)])),
        weights=np.concatenate([sitting.weights, np.eye(K)]),
        parents=sitting.parents,
        faces=sitting.faces,
        joint_names=tuple(f"joint {k}" for k in range(K)),
        name="subjects",
    )


@dataclass(frozen=True)
class ShapePrior:
    """Betas are free as well, ordinary at so many standard deviations."""

    sigma: float = 1.0


@dataclass(frozen=True, eq=False)
class PoseFit:
    """Poses of one body from meshes of its first N vertices; its shape too, given a prior."""

    body: Body
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

    def values(
        self, start: Array, vertices: Array, seen: Array, betas: Array | None = None
    ) -> Values:
        """Pose (K, 3) rad, betas and trans from a first guess of the pose; not worse than it.

        Betas are those given, or zero, where they are not free.
        """
        values: Values = self.body.start() | {"pose": start, "observed": vertices}
        if betas is not None:
            values["betas"] = betas
        values["trust"] = self.compared.trust(seen)
        values["trans"] = self._trans(values, vertices, seen)
        solution = self.solver.solve(self.problem, values)
        found = {name: values[name] for name in ("pose", "betas", "trans")} | solution.values
        return found | {"trans": self._trans(found, vertices, seen)}

    def _trans(self, values: Values, vertices: Array, seen: Array) -> Array:
        """Where the body stands, given how."""
        posed = self.body.vertices(values["pose"], values["betas"])[: self.n_vertices]
        return np.average(vertices - posed, axis=0, weights=seen)


@dataclass(frozen=True, eq=False)
class Sitting:
    """Some registrations whose poses are to be found, and their S subjects."""

    templates: Array  # (S, N, 3) m
    joints: Array  # (S, K, 3) m
    posedirs: Array
    weights: Array
    parents: tuple[int, ...]
    faces: Index
    compared: Compared
    sigma: float  # m
    steps: int  # of Levenberg and Marquardt, at most, each
    subject: Index  # (c,), from 0 to S - 1
    poses: Array  # (c, K, 3) rad: where to start
    vertices: Array  # (c, N, 3) m
    seen: Array  # (c, N)


def poses_of(sitting: Sitting) -> Array:
    """(c, K, 3) rad."""
    body = body_of_subjects(sitting)
    solver = LevenbergMarquardt(
        max_iterations=sitting.steps, gradient_tolerance=TOLERANCE, first_damping=FIRST_DAMPING
    )
    fit = PoseFit(body, sitting.vertices.shape[1], sitting.compared, sitting.sigma, solver)
    who = np.eye(len(sitting.templates))[sitting.subject]
    each = zip(sitting.poses, sitting.vertices, sitting.seen, who, strict=True)
    return np.stack([fit.values(*one)["pose"] for one in each])


def fitted_poses(
    estimate: Estimate,
    registrations: Registrations,
    faces: Index,
    compared: Compared,
    sigma: float,
    steps: int,
    hands: Hands = ONE,
) -> Estimate:
    """Every registration's pose fitted anew, the estimate's as the start; `steps` at most each."""
    J = len(registrations.subject)
    some = [slice(at, min(at + SITTING, J)) for at in range(0, J, SITTING)]

    def task(rows: slice) -> Sitting:
        batch = registrations.read(rows)
        own, subject = np.unique(registrations.subject[rows], return_inverse=True)
        return Sitting(
            estimate.templates[own], estimate.joints[own], estimate.posedirs, estimate.weights,
            estimate.parents, faces, compared, sigma, steps,
            subject, estimate.poses[rows], batch.vertices, batch.seen,
        )  # fmt: skip

    poses = estimate.poses.copy()
    for rows, found in zip(some, hands.crew(poses_of, map(task, some)), strict=True):
        poses[rows] = found
        hands.say(rows.stop, len(poses))
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
