"""Training of shape: registrations of many people, un-posed, and their principal directions."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy.linalg
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.bodies.forward.posing import unpose
from workbench.geometry.mirror import Mirror
from workbench.geometry.solids import volume
from workbench.training.execution import SERIAL, Execution, NotLowered
from workbench.training.first_guess import FIRST_SIGMA, Start
from workbench.training.pose_training import KKT_TOLERANCE, PoseModel
from workbench.training.poses import JOB_SIZE, PoseFit, poses_of_segments
from workbench.training.registrations import Batch, Registrations, rows_of_jobs
from workbench.training.shares import JointRegressor, fit_joint_regressor
from workbench.training.subsampling import subsample

STEPS_IN_ROUND = 6  # of the fit of one pose in a round


@dataclass(frozen=True, eq=False)
class LearnedShapes:
    """T(betas) = template + shapedirs betas; betas in standard deviations of the population.

    Attributes:
        template: (N, 3) in metres.
        shapedirs: (N, 3, B) in metres per unit of betas.
        explained: (B,) the share of the population's variance.
    """

    template: Array
    shapedirs: Array
    explained: Array

    def betas(self, people: Array) -> Array:
        """The betas (P, B) of the shapes closest to people (P, N, 3) m."""
        deviations = (people - self.template).reshape(len(people), -1)
        basis = self.shapedirs.reshape(deviations.shape[1], -1)
        closest: Array = deviations @ basis / (basis**2).sum(axis=0)
        return closest


@dataclass(frozen=True, eq=False)
class ShapeModel:
    """The result of shape training.

    Attributes:
        space: the template and the shape directions.
        people: (P, N, 3) in metres, un-posed, with the root joint at the origin.
        poses: (P, K, 3) in radians, in which the people stood.
    """

    space: LearnedShapes
    people: Array
    poses: Array


def about_root(people: Array, regressor: csr_array) -> Array:
    """People (P, N, 3) m moved so that their regressed root joint is the origin."""
    root = regressor[[0]].toarray()[0]
    return np.asarray(people - (root @ people)[:, None])


UnposingJob = tuple[Batch, Array | None]  # and the poses (c, K, 3) rad to start from, if known


def unposing_jobs(
    registrations: Registrations, poses: Array | None = None
) -> Iterator[UnposingJob]:
    """The registrations in jobs, with their poses (J, K, 3) rad where these are known."""
    for rows in rows_of_jobs(len(registrations.subject), JOB_SIZE):
        yield registrations.read(rows), None if poses is None else poses[rows]


def unposed_people(
    body: SkinnedBody, shape_sigma: float | None, job: UnposingJob
) -> tuple[Array, Array]:
    """The poses (c, K, 3) rad of people, and the people at rest (c, N, 3) m.

    The poses are fitted, and the betas too if a sigma of their prior is given. If no pose is known,
    the segments are turned first. Vertices that were not scanned are taken from the body.
    """
    batch, starts = job
    few = subsample(body.template, body.faces)
    sparse, n = few.body(body), len(few.vertices)
    fit = PoseFit(sparse, n, FIRST_SIGMA, STEPS_IN_ROUND, few.faces, shape_sigma)
    poses, people = [], []
    for i, (V, confidence) in enumerate(zip(batch.vertices, batch.trust, strict=True)):
        own, trusted = V[few.vertices], confidence[few.vertices]
        start = (
            poses_of_segments(sparse.template[:n], sparse.weights[:n], body.parents, own, trusted)
            if starts is None
            else starts[i]
        )
        fitted = fit.values(start, own, trusted)
        if not confidence.all():
            whole = body.vertices(fitted["pose"], fitted["betas"], fitted["trans"])
            V = np.where(confidence[:, None] > 0, V, whole)
        poses.append(fitted["pose"])
        people.append(unpose(body, fitted["pose"], V))
    return np.stack(poses), np.stack(people)


def learn_shapes(
    body: SkinnedBody,
    registrations: Registrations,
    *,
    n_betas: int,
    mirror: Mirror | None,
    rounds: int = 2,
    execution: Execution = SERIAL,
) -> ShapeModel:
    """Fit poses, un-pose the people and find the principal directions, in a few rounds.

    The first round fits poses with the body's mean shape, as the paper does. Later rounds fit
    the shape directions of the round before as well, with a prior on betas.
    """
    J, N, K = len(registrations.subject), body.n_vertices, body.n_joints
    poses, people = np.zeros((J, K, 3)), np.zeros((J, N, 3))
    space: LearnedShapes | None = None
    for number in range(rounds):
        shaped, shape_sigma = body, None
        if space is not None:
            shaped = replace(body, template=space.template, shapedirs=space.shapedirs)
            shape_sigma = 1.0
        work = partial(unposed_people, shaped, shape_sigma)
        jobs = unposing_jobs(registrations, poses if number else None)
        done = 0
        for own_poses, own_people in execution.executor(work, jobs):
            rows = slice(done, done + len(own_poses))
            poses[rows], people[rows] = own_poses, own_people
            done = rows.stop
            execution.report.part("shapes", number * J + done, rounds * J)
        people = about_root(people, body.J_regressor)
        space = learn_shape_space(people, body.faces, mirror, min(n_betas, J - 1))
    assert space is not None  # there is a first round
    return ShapeModel(space, people, poses)


def start_shape(model: PoseModel, start: Start, n_betas: int) -> tuple[SkinnedBody, JointRegressor]:
    """A body with the shape directions of the multi-pose subjects, and its joint regressor.

    The directions are principal ones of the subjects' templates, with their root joints at zero;
    one subject has none. No registration shows where the root joint is: turning about another point
    only adds a translation. So its row is that of its ring. Raises NotLowered if the regressor is
    no minimum.
    """
    estimate, mirror = model.estimate, model.objective.active_mirror
    templates = estimate.templates
    regressor = fit_joint_regressor(templates, estimate.joints, model.objective.rings)
    if regressor.kkt > KKT_TOLERANCE:
        raise NotLowered(f"the joint regressor has a KKT residual of {regressor.kkt:.1e}")
    at_root = about_root(templates, regressor.matrix)
    n = min(n_betas, len(templates) - 1)
    space = learn_shape_space(at_root, start.faces, mirror, n)
    body = SkinnedBody(
        template=space.template,
        shapedirs=space.shapedirs,
        posedirs=estimate.posedirs,
        J_regressor=regressor.matrix,
        weights=estimate.weights,
        parents=estimate.parents,
        faces=start.faces,
        joint_names=start.joint_names,
        mirror=None if mirror is None else mirror.vertices,
        name="trained",
    )
    return body, regressor


def learn_shape_space(
    people: Array, faces: Index, mirror: Mirror | None, n_betas: int = 10
) -> LearnedShapes:
    """The principal components of un-posed people (P, N, 3) m, symmetric if there is a mirror.

    The sign of the first makes a positive beta taller; those of the others make it heavier. With
    `n_betas` of 0 there are none, as for one person.
    """
    P, N, _ = people.shape
    mean = people.mean(axis=0)
    template = mean if mirror is None else (mean + mirror.points(mean)) / 2
    if not n_betas:
        return LearnedShapes(template, np.zeros((N, 3, 0)), np.zeros(0))
    deviations = (people - template).reshape(P, -1)
    gram = deviations @ deviations.T
    last = [P - n_betas, P - 1]
    variances, coordinates = scipy.linalg.eigh(gram, subset_by_index=last)
    order = np.argsort(-variances)
    directions = (deviations.T @ coordinates[:, order]).reshape(N, 3, -1) / np.sqrt(P - 1)
    if mirror is not None:
        directions = (directions + mirror.directions(directions)) / 2
    return LearnedShapes(
        template=template,
        shapedirs=directions * _signs(template, directions, faces),
        explained=variances[order] / np.trace(gram),
    )


def _signs(template: Array, directions: Array, faces: Index) -> Array:
    signs = []
    for k, direction in enumerate(np.moveaxis(directions, 2, 0)):
        more, less = template + direction, template - direction
        grows = volume(more, faces) - volume(less, faces)
        if k == 0:
            grows = float(np.ptp(more[:, 1]) - np.ptp(less[:, 1]))
        signs.append(1.0 if grows > 0 else -1.0)
    return np.array(signs)
