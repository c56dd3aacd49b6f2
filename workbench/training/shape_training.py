"""Training of shape: registrations of many people, un-posed, and their principal directions."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.solvers import LevenbergMarquardt
from workbench.training.crew import ONE, Hands
from workbench.training.first_guess import Start
from workbench.training.joint_regressor import JointRegressor, fit_joint_regressor
from workbench.training.mirror import Mirror
from workbench.training.pose_training import FIRST_SIGMA, NotLowered, PoseModel
from workbench.training.poses import (
    FIRST_DAMPING,
    SITTING,
    TOLERANCE,
    Compared,
    OnEdges,
    PoseFit,
    ShapePrior,
    segments_turned,
)
from workbench.training.registrations import Registrations, pieces
from workbench.training.shape_space import ShapeSpace, learn_shape_space
from workbench.training.thinning import thinned
from workbench.training.unposing import unpose

Array = NDArray[np.float64]
Index = NDArray[np.int64]
STEPS = 6  # of the fit of one pose in a round
KKT = 1e-8


@dataclass(frozen=True, eq=False)
class Shapes:
    """Un-posed people, and what was found on the way."""

    space: ShapeSpace
    people: Array  # (P, N, 3) m, the root joint at the origin
    poses: Array  # (P, K, 3) rad


def body_of(model: PoseModel, start: Start, space: ShapeSpace, regressor: csr_array) -> SkinnedBody:
    """The arrays together."""
    estimate = model.estimate
    mirror = model.objective.held_even
    return SkinnedBody(
        template=space.template,
        shapedirs=space.shapedirs,
        posedirs=estimate.posedirs,
        J_regressor=regressor,
        weights=estimate.weights,
        parents=estimate.parents,
        faces=start.faces,
        joint_names=start.joint_names,
        mirror=None if mirror is None else mirror.vertices,
        name="trained",
    )


def regressor_of(model: PoseModel) -> JointRegressor:
    """J from the subjects' templates and joints. Raises NotLowered if it is not a minimum.

    Where the root joint is, no registration shows: turning about another point is a translation
    more. So its row is that of its ring.
    """
    templates, joints = model.estimate.templates, model.estimate.joints
    found = fit_joint_regressor(templates, joints, model.objective.rings)
    if found.kkt > KKT:
        raise NotLowered(f"the joint regressor has a KKT residual of {found.kkt:.1e}")
    return found


def subjects_space(
    model: PoseModel, regressor: csr_array, faces: Index, n_betas: int, mirror: Mirror | None
) -> ShapeSpace:
    """The principal directions of the subjects' own templates, each about its root joint."""
    templates = model.estimate.templates
    n = min(n_betas, len(templates) - 1)
    if n < 1:
        raise BadArgument(
            "shape cannot be learned from one subject; give registrations of more people"
        )
    return learn_shape_space(about_root(templates, regressor), faces, mirror, n)


def about_root(people: Array, regressor: csr_array) -> Array:
    """People (P, N, 3) m moved so that their regressed root joint is the origin."""
    root = regressor[[0]].toarray()[0]
    return np.asarray(people - (root @ people)[:, None])


@dataclass(frozen=True, eq=False)
class Visit:
    """Some people, each to be un-posed."""

    body: SkinnedBody
    compared: Compared
    shapes: ShapePrior | None
    poses: Array | None  # (c, K, 3) rad: where to start; None: segments are turned
    vertices: Array  # (c, N, 3) m
    seen: Array  # (c, N)


def unposed_people(visit: Visit) -> tuple[Array, Array]:
    """Their poses (c, K, 3) rad, and them at rest (c, N, 3) m."""
    body = visit.body
    solver = LevenbergMarquardt(
        max_iterations=STEPS, gradient_tolerance=TOLERANCE, first_damping=FIRST_DAMPING
    )
    few = thinned(body.template, body.faces)
    sparse, n = few.body(body), len(few.vertices)
    compared = visit.compared.on(few.faces)
    fit = PoseFit(sparse, n, compared, FIRST_SIGMA, solver, visit.shapes)
    poses, people = [], []
    for i, (V, seen) in enumerate(zip(visit.vertices, visit.seen, strict=True)):
        own, trust = V[few.vertices], seen[few.vertices]
        start = (
            segments_turned(sparse.template[:n], sparse.weights[:n], body.parents, own, trust)
            if visit.poses is None
            else visit.poses[i]
        )
        found = fit.values(start, own, trust)
        if not seen.all():  # what was not scanned is taken from the model
            filled = body.vertices(found["pose"], found["betas"], found["trans"])
            V = np.where(seen[:, None] > 0, V, filled)
        poses.append(found["pose"])
        people.append(unpose(body, found["pose"], V).vertices)
    return np.stack(poses), np.stack(people)


def learn_shapes(
    body: SkinnedBody,
    registrations: Registrations,
    *,
    n_betas: int,
    mirror: Mirror | None,
    rounds: int = 2,
    compared: Compared | None = None,
    prior: float = 1.0,
    hands: Hands = ONE,
) -> Shapes:
    """Pose-normalise, un-pose and find the principal directions; then with those once more.

    In the first round poses are fitted with the body's mean shape, as in the paper; in later
    ones with its shape directions as well, betas ordinary at `prior` standard deviations.
    """
    data = OnEdges(body.faces) if compared is None else compared
    J, N, K = len(registrations.subject), body.n_vertices, body.n_joints
    poses, people = np.zeros((J, K, 3)), np.zeros((J, N, 3))
    runs = [slice(at, min(at + SITTING, J)) for at in range(0, J, SITTING)]
    space: ShapeSpace | None = None
    for number in range(rounds):
        shaped, shapes = body, None
        if space is not None:
            shaped = replace(body, template=space.template, shapedirs=space.shapedirs)
            shapes = ShapePrior(prior)
        visit = partial(_visit, shaped, registrations, data, shapes, poses if number else None)
        found = hands.crew(unposed_people, map(visit, runs))
        for some, (own_poses, own_people) in zip(runs, found, strict=True):
            poses[some], people[some] = own_poses, own_people
            hands.say(number * J + some.stop, rounds * J)
        people = about_root(people, body.J_regressor)
        space = learn_shape_space(people, body.faces, mirror, min(n_betas, J - 1))
    assert space is not None  # there is a first round
    return Shapes(space, people, poses)


def _visit(
    body: SkinnedBody,
    registrations: Registrations,
    compared: Compared,
    shapes: ShapePrior | None,
    poses: Array | None,
    some: slice,
) -> Visit:
    batch = registrations.read(some)
    own = None if poses is None else poses[some]
    return Visit(body, compared, shapes, own, batch.vertices, batch.seen)


def unposed_at(
    body: SkinnedBody, registrations: Registrations, poses: Array, hands: Hands = ONE
) -> Array:
    """People (P, N, 3) m about their root joints, from poses (P, K, 3) rad found elsewhere.

    Every vertex of theirs must have been seen.
    """
    runs = pieces(registrations)
    visits = (AtPoses(body, poses[some], registrations.read(some).vertices) for some in runs)
    people = np.concatenate(list(hands.crew(unposed_visit, visits)))
    return about_root(people, body.J_regressor)


@dataclass(frozen=True, eq=False)
class AtPoses:
    """Some people, whose poses are known."""

    body: SkinnedBody
    poses: Array  # (c, K, 3) rad
    vertices: Array  # (c, N, 3) m


def unposed_visit(visit: AtPoses) -> Array:
    """Them at rest, (c, N, 3) m."""
    each = zip(visit.poses, visit.vertices, strict=True)
    return np.stack([unpose(visit.body, pose, V).vertices for pose, V in each])


def start_shape(model: PoseModel, start: Start, n_betas: int) -> tuple[SkinnedBody, JointRegressor]:
    """The body with the shapes of the multi-pose subjects alone."""
    regressor = regressor_of(model)
    space = subjects_space(model, regressor.matrix, start.faces, n_betas, model.objective.held_even)
    return body_of(model, start, space, regressor.matrix), regressor
