"""SCAPE and BlendSCAPE from registrations whose poses are not known.

It begins with the result of SMPL's training on the same registrations. Skinning weights and joint
regressor stay as they are; everybody's pose and each subject's rest shape are found anew, in
blocks, each of which holds everything else fixed:

`fit_shapes`             the poses of the multi-shape set, whose people are un-posed triangle by
                         triangle; then the mean and the principal directions of their deformation
                         gradients, S
`fit_pose_deformations`  Q by ridge least squares; E_Q is its magnitude
`fits`                   the pose of every registration, each subject having a D of its own
`fit_subjects`           each subject's D by least squares; E_D is its smoothness over neighbours
"""

from dataclasses import dataclass, replace

import numpy as np

from builder.training import training_and_held_out
from builder.triangle_learning import Lsqr, learn_pose_deformations, learn_subject
from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.geometry.triangles import edges, frames_on, gradients
from workbench.training.blocks import POSE_STEPS
from workbench.training.first_guess import FIRST_SIGMA, FIRST_STEPS
from workbench.training.poses import (
    FittedMeshes,
    PoseFit,
    poses_of_segments,
)
from workbench.training.registrations import InMemory
from workbench.training.training import Trained
from workbench.training.triangles import PosedMeshes, learn_gradient_shapes

AnyBody = SkinnedBody | TriangleBody
SIGMA = 0.002  # m: a mesh from the body, per coordinate; as in training
STEPS = 6  # of pose and shape after the edges; more of them change less than 0.01 mm
SMOOTHNESS = 1e-6  # m^2, E_D
ROUGH = Lsqr(3e-3)  # for Q: a smaller tolerance explains held-out subjects no better
FINE = Lsqr(1e-3)  # for D


def fit_held_out(body: AnyBody, first: SkinnedBody, meshes: Array) -> FittedMeshes:
    """Fit pose, betas and trans of a body to meshes (M, N, 3) m of people it was not trained on.

    For any body, the segments of `first` are turned onto the mesh. Then the pose is fitted to the
    edges with the mean shape, and pose and shape to the vertices, betas being standard normal.
    """
    trusted, segments = np.ones(first.n_vertices), (first.template, first.weights, first.parents)
    turned = np.stack([poses_of_segments(*segments, V, trusted) for V in meshes])
    N = body.n_vertices
    by_edges = PoseFit(body, N, FIRST_SIGMA, FIRST_STEPS, first.faces)
    near = by_edges.fits(turned, meshes).poses
    return PoseFit(body, N, SIGMA, STEPS, shape_sigma=1.0).fits(near, meshes)


@dataclass(frozen=True)
class TriangleOptions:
    """How long the alternation goes on.

    Attributes:
        rounds: how often the blocks are run in turn.
        ridges: the ridges of Q (E_Q) to choose from, in m^2 per squared unit of posedirs.
        bends: the least-squares method for Q.
        persons: the least-squares method for D.
    """

    rounds: int = 2
    ridges: tuple[float, ...] = (1e-2, 1e-3, 1e-4, 1e-5)
    bends: Lsqr = ROUGH
    persons: Lsqr = FINE


QUICK = TriangleOptions()


@dataclass(frozen=True)
class RidgeChoice:
    """The values of a hyperparameter that were tried, and their errors.

    Attributes:
        tried: the values.
        errors: the root mean square distance of vertices, in mm, on the subjects held out.
    """

    tried: tuple[float, ...]
    errors: tuple[float, ...]

    @property
    def chosen(self) -> float:
        """The value with the smallest error."""
        return self.tried[int(np.argmin(self.errors))]


@dataclass(frozen=True, eq=False)
class TriangleEstimate:
    """The unknowns of the alternation.

    Attributes:
        body: the triangle body, with the template and shape directions of everybody.
        D: (S, F, 3, 3) the deformation gradients of the multi-pose subjects, on the template.
        poses: (J, K, 3) in radians, of the multi-pose set.
        standing: (P, K, 3) in radians, of the multi-shape set.
    """

    body: TriangleBody
    D: Array
    poses: Array
    standing: Array

    @staticmethod
    def begin(untrained: TriangleBody, smpl: Trained) -> "TriangleEstimate":
        """The first estimate, from SMPL's training with shapes; `untrained` has its weights."""
        assert smpl.shapes is not None
        found, body = smpl.poses.estimate, untrained
        D = gradients(body.template, found.templates, body.faces)
        return TriangleEstimate(body, D, found.poses, smpl.shapes.poses)

    @property
    def subjects(self) -> TriangleBody:
        """The body of all subjects: for subject s, beta s is one and the others are zero."""
        return replace(self.body, shapedirs=np.moveaxis(self.D - np.eye(3), 0, 3))

    def fits(self, posed: InMemory, steps: int = POSE_STEPS) -> FittedMeshes:
        """The subjects fitted to their registrations, from the poses of the estimate."""
        fit = PoseFit(self.subjects, posed.n_vertices, SIGMA, steps)
        return fit.fits(self.poses, posed.vertices, betas=np.eye(len(self.D))[posed.subject])


def train_triangles(
    start: TriangleEstimate,
    standing: InMemory,
    posed: InMemory,
    *,
    n_betas: int,
    ridge: float,
    options: TriangleOptions = QUICK,
) -> TriangleEstimate:
    """Run all blocks in turn for a number of rounds, then shapes and Q once more."""
    estimate = start
    for _ in range(options.rounds):
        estimate = fit_shapes(estimate, standing, n_betas)
        estimate = fit_pose_deformations(estimate, posed, ridge, options.bends)
        estimate = replace(estimate, poses=estimate.fits(posed).poses)
        estimate = fit_subjects(estimate, posed, options.persons)
    return fit_pose_deformations(
        fit_shapes(estimate, standing, n_betas), posed, ridge, options.bends
    )


def fit_shapes(estimate: TriangleEstimate, standing: InMemory, n_betas: int) -> TriangleEstimate:
    """Learn template and shapedirs from the poses known so far, then from poses fitted again."""
    roughly = _with_shapes(estimate, standing, n_betas)
    body = roughly.body
    fit = PoseFit(body, body.n_vertices, FIRST_SIGMA, POSE_STEPS, body.faces, 1.0)
    poses = fit.fits(estimate.standing, standing.vertices).poses
    return _with_shapes(replace(roughly, standing=poses), standing, n_betas)


def fit_pose_deformations(
    estimate: TriangleEstimate, posed: InMemory, ridge: float, by: Lsqr
) -> TriangleEstimate:
    """Learn posedirs, all else being held."""
    meshes = PosedMeshes(posed.vertices, estimate.poses, posed.subject)
    each = np.eye(len(estimate.D))
    learned = learn_pose_deformations(estimate.subjects, meshes, each, ridge=ridge, by=by)
    return replace(estimate, body=replace(estimate.body, posedirs=learned.posedirs))


def fit_subjects(estimate: TriangleEstimate, posed: InMemory, by: Lsqr) -> TriangleEstimate:
    """Learn each subject's D from all registrations of the subject."""
    D = []
    for i in range(len(estimate.D)):
        own = np.flatnonzero(posed.subject == i)
        meshes = PosedMeshes(posed.vertices[own], estimate.poses[own], posed.subject[own])
        D.append(learn_subject(estimate.body, meshes, smoothness=SMOOTHNESS, by=by))
    return replace(estimate, D=np.stack(D))


def choose_ridge(
    start: TriangleEstimate, posed: InMemory, options: TriangleOptions = QUICK
) -> RidgeChoice:
    """Choose the ridge of Q: learn it from most subjects, and fit the poses of the others."""
    halves = []
    for rows in training_and_held_out(posed.subject):
        own = InMemory(posed.vertices[rows], posed.subject[rows])
        halves.append((replace(start, poses=start.poses[rows]), own))
    (first, training), (second, held_out) = halves
    errors = []
    for ridge in options.ridges:
        body = fit_pose_deformations(first, training, ridge, options.bends).body
        errors.append(1e3 * replace(second, body=body).fits(held_out).rms(held_out.vertices))
    return RidgeChoice(options.ridges, tuple(errors))


def unposed(body: TriangleBody, pose: Array, vertices: Array) -> Array:
    """The person at rest, (N, 3) m about its mean, from whom the body makes a posed mesh.

    D_f maps Q_f e_f to B_f^-1 times the mesh's edges; the triangles with these D_f are stitched.
    """
    at = body.arithmetic.evaluate(pose, np.zeros(body.n_betas))
    straight = np.linalg.solve(at.B, edges(vertices, body.faces).transpose(0, 2, 1))
    found = np.asarray(straight.transpose(0, 2, 1), dtype=float)
    D = frames_on(found) @ np.linalg.inv(frames_on(at.bent))
    V = body.stitching.vertices(body.arithmetic.packed.edges @ D.transpose(0, 2, 1))
    return np.asarray(V - V.mean(axis=0))


def _with_shapes(estimate: TriangleEstimate, standing: InMemory, n_betas: int) -> TriangleEstimate:
    body = estimate.body
    each = zip(estimate.standing, standing.vertices, strict=True)
    people = np.stack([unposed(body, pose, V) for pose, V in each])
    found = learn_gradient_shapes(people, body.faces, n_betas)
    D = estimate.D @ gradients(found.template, body.template, body.faces)  # the same subjects
    return replace(
        estimate, D=D, body=replace(body, template=found.template, shapedirs=found.shapedirs)
    )
