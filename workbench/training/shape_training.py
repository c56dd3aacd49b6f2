"""Training of shape: registrations of many people, un-posed, and their principal directions."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.solvers import LevenbergMarquardt
from workbench.training.first_guess import Start
from workbench.training.joint_regressor import JointRegressor, fit_joint_regressor
from workbench.training.mirror import Mirror
from workbench.training.pose_training import FIRST_SIGMA, NotLowered, PoseModel
from workbench.training.poses import (
    TOLERANCE,
    Compared,
    OnEdges,
    PoseFit,
    Say,
    ShapePrior,
    segments_turned,
    untold,
)
from workbench.training.registrations import Registrations, batches
from workbench.training.shape_space import ShapeSpace, learn_shape_space
from workbench.training.unposing import unpose

Array = NDArray[np.float64]
Index = NDArray[np.int64]
STEPS = 8  # of the fit of one pose in a round
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


def learn_shapes(
    body: SkinnedBody,
    registrations: Registrations,
    *,
    n_betas: int,
    mirror: Mirror | None,
    rounds: int = 2,
    compared: Compared | None = None,
    prior: float = 1.0,
    say: Say = untold,
) -> Shapes:
    """Pose-normalise, un-pose and find the principal directions; then with those once more.

    In the first round poses are fitted with the body's mean shape, as in the paper; in later
    ones with its shape directions as well, betas ordinary at `prior` standard deviations.
    """
    data = OnEdges(body.faces) if compared is None else compared
    J, N, K = len(registrations.subject), body.n_vertices, body.n_joints
    poses, people = np.zeros((J, K, 3)), np.zeros((J, N, 3))
    solver = LevenbergMarquardt(max_iterations=STEPS, gradient_tolerance=TOLERANCE)
    space: ShapeSpace | None = None
    for round_number in range(rounds):
        shaped = body if space is None else replace(
            body, template=space.template, shapedirs=space.shapedirs
        )  # fmt: skip
        shapes = None if space is None else ShapePrior(prior)
        fit = PoseFit(shaped, N, data, FIRST_SIGMA, solver, shapes)
        for batch in batches(registrations):
            for at in range(len(batch.subject)):
                j = batch.some.start + at
                V, seen = batch.vertices[at], batch.seen[at]
                if round_number == 0:
                    poses[j] = segments_turned(body.template, body.weights, body.parents, V, seen)
                found = fit.values(poses[j], V, seen)
                poses[j] = found["pose"]
                if not seen.all():  # what was not scanned is taken from the model
                    filled = shaped.vertices(found["pose"], found["betas"], found["trans"])
                    V = np.where(seen[:, None] > 0, V, filled)
                people[j] = unpose(shaped, poses[j], V).vertices
                say(round_number * J + j + 1, rounds * J)
        people = about_root(people, body.J_regressor)
        space = learn_shape_space(people, body.faces, mirror, min(n_betas, J - 1))
    assert space is not None  # there is a first round
    return Shapes(space, people, poses)


def start_shape(model: PoseModel, start: Start, n_betas: int) -> tuple[SkinnedBody, JointRegressor]:
    """The body with the shapes of the multi-pose subjects alone."""
    regressor = regressor_of(model)
    space = subjects_space(model, regressor.matrix, start.faces, n_betas, model.objective.held_even)
    return body_of(model, start, space, regressor.matrix), regressor
