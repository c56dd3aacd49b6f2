"""SCAPE and BlendSCAPE from registrations in poses that nobody knows.

What SMPL's training found in the same registrations is where it begins: the weights and the joint
regressor, which it keeps, everybody's pose and each subject's rest shape, which it finds anew for
itself. Then blocks in turn, all else held:

shapes   everybody who stands: pose by the pose solver, un-posed triangle by triangle; the mean and
         the principal directions of deformation gradients, S
bends    Q by ridge least squares, E_Q being its magnitude
poses    every registration's pose by the same pose solver, each subject having a D of its own
persons  each subject's D by least squares, E_D being its smoothness over neighbours
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.bodies.triangles import TriangleBody
from workbench.geometry.triangles import edges, frames_on, gradients
from workbench.training.blocks import POSE_STEPS
from workbench.training.pose_training import FIRST_SIGMA
from workbench.training.poses import OnEdges, OnVertices, ShapePrior
from workbench.training.registrations import InMemory, kept_and_held_back
from workbench.training.training import Trained
from workbench.training.triangles.choice import Choice
from workbench.training.triangles.fitting import Fits, Search
from workbench.training.triangles.learning import PosedMeshes, learn_bends, learn_person
from workbench.training.triangles.shape_space import learn_shapes
from workbench.training.triangles.stitched_fit import CentredVertices, LeastSquares, Lsqr

Array = NDArray[np.float64]
SMOOTHNESS = 1e-6  # m^2, E_D
ROUGH = Lsqr(3e-3)  # for Q: beyond, subjects held back are explained no better
FINE = Lsqr(1e-3)  # for D


@dataclass(frozen=True)
class Effort:
    """How long the blocks go on, and which ridges of Q are tried."""

    rounds: int = 2
    ridges: tuple[float, ...] = (1e-2, 1e-3, 1e-4, 1e-5)  # m^2 per squared unit of posedirs, E_Q
    bends: LeastSquares = ROUGH
    persons: LeastSquares = FINE


QUICK = Effort()


@dataclass(frozen=True, eq=False)
class State:
    """What the blocks hand on."""

    body: TriangleBody  # with the template and shape directions of everybody
    D: Array  # (S, F, 3, 3): the subjects of the multi-pose set, on the template
    poses: Array  # (J, K, 3) rad: of that set
    standing: Array  # (P, K, 3) rad: of the multi-shape set

    @staticmethod
    def begin(untrained: TriangleBody, smpl: Trained) -> "State":
        """From the end of SMPL's training with shapes; `untrained` has its weights."""
        assert smpl.shapes is not None
        found, body = smpl.poses.estimate, untrained
        D = gradients(body.template, found.templates, body.faces)
        return State(body, D, found.poses, smpl.shapes.poses)

    @property
    def subjects(self) -> TriangleBody:
        """The body whose betas are one at a subject and zero elsewhere."""
        return replace(self.body, shapedirs=np.moveaxis(self.D - np.eye(3), 0, 3))

    def fits(self, posed: InMemory, steps: int = POSE_STEPS) -> Fits:
        """The subjects in registrations of theirs, poses sought from where they were."""
        who = np.eye(len(self.D))[posed.subject]
        return Search(OnVertices(), steps).of(self.subjects, posed.vertices, self.poses, who)


def train_triangles(
    begun: State,
    standing: InMemory,
    posed: InMemory,
    *,
    n_betas: int,
    ridge: float,
    effort: Effort = QUICK,
) -> State:
    """Blocks in turn, so many rounds of them, and shapes and bends once more."""
    state = begun
    for _ in range(effort.rounds):
        state = shapes(state, standing, n_betas)
        state = bends(state, posed, ridge, effort.bends)
        state = replace(state, poses=state.fits(posed).poses)
        state = persons(state, posed, effort.persons)
    return bends(shapes(state, standing, n_betas), posed, ridge, effort.bends)


def shapes(state: State, standing: InMemory, n_betas: int) -> State:
    """Template and shapedirs; from the poses known so far, then from those sought with them."""
    roughly = _with_shapes(state, standing, n_betas)
    seek = Search(OnEdges(state.body.faces), POSE_STEPS, FIRST_SIGMA, ShapePrior())
    poses = seek.of(roughly.body, standing.vertices, state.standing).poses
    return _with_shapes(replace(roughly, standing=poses), standing, n_betas)


def bends(state: State, posed: InMemory, ridge: float, by: LeastSquares) -> State:
    """posedirs."""
    meshes = PosedMeshes(posed.vertices, state.poses, posed.subject)
    each = np.eye(len(state.D))
    learned = learn_bends(state.subjects, meshes, each, ridge=ridge, by=by, measure=CentredVertices)
    return replace(state, body=replace(state.body, posedirs=learned.posedirs))


def persons(state: State, posed: InMemory, by: LeastSquares) -> State:
    """Each subject's D, from what is seen of him in all his poses."""
    D = []
    for i in range(len(state.D)):
        own = np.flatnonzero(posed.subject == i)
        meshes = PosedMeshes(posed.vertices[own], state.poses[own], posed.subject[own])
        D.append(
            learn_person(state.body, meshes, smoothness=SMOOTHNESS, by=by, measure=CentredVertices)
        )
    return replace(state, D=np.stack(D))


def choose_ridge(begun: State, posed: InMemory, effort: Effort = QUICK) -> Choice:
    """Q's ridge: learned from some subjects, judged on those held back, their poses sought anew."""
    kept, back = kept_and_held_back(posed.subject)
    first, second = (replace(begun, poses=begun.poses[rows]) for rows in (kept, back))
    shown, asked = (InMemory(posed.vertices[rows], posed.subject[rows]) for rows in (kept, back))
    left = []
    for ridge in effort.ridges:
        body = bends(first, shown, ridge, effort.bends).body
        left.append(1e3 * replace(second, body=body).fits(asked).rms(asked.vertices))
    return Choice(effort.ridges, tuple(left))


def unposed(body: TriangleBody, pose: Array, vertices: Array) -> Array:
    """The person at rest (N, 3) m, its mean at the origin, whom a body takes to a posed mesh.

    D_f takes Q_f e_f to B_f^-1 times the mesh's edges; what these D_f ask for is stitched.
    """
    at = body.arithmetic.at(pose, np.zeros(body.n_betas))
    straight = np.linalg.solve(at.B, edges(vertices, body.faces).transpose(0, 2, 1))
    found = np.asarray(straight.transpose(0, 2, 1), dtype=float)
    D = frames_on(found) @ np.linalg.inv(frames_on(at.bent))
    V = body.stitching.vertices(body.arithmetic.edges @ D.transpose(0, 2, 1))
    return np.asarray(V - V.mean(axis=0))


def _with_shapes(state: State, standing: InMemory, n_betas: int) -> State:
    body = state.body
    each = zip(state.standing, standing.vertices, strict=True)
    people = np.stack([unposed(body, pose, V) for pose, V in each])
    found = learn_shapes(people, body.faces, n_betas)
    D = state.D @ gradients(found.template, body.template, body.faces)  # the same subjects
    return replace(
        state, D=D, body=replace(body, template=found.template, shapedirs=found.shapedirs)
    )
