"""A trained body in the form in which bodies are shipped: alike on both sides, few numbers."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from builder.local_blends import local_posedirs
from builder.population import SEARCH_RADIUS
from builder.regressors import regress
from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.errors import BadBody
from workbench.geometry.mirror import Mirror
from workbench.synthetic.teacher import at_most_four
from workbench.training.estimate import Estimate
from workbench.training.first_guess import Start
from workbench.training.pose_training import PoseModel
from workbench.training.shape_training import learn_shape_space


@dataclass(frozen=True, eq=False)
class PoseParts:
    """What female, male and neutral bodies of one mesh have in common."""

    start: Start
    mirror: Mirror
    estimate: Estimate  # weights and posedirs alike on both sides
    ridge: float


def pose_parts(model: PoseModel, start: Start) -> PoseParts:
    """Weights made even, then blend shapes learned with them. Raises BadBody without sides."""
    mirror = model.objective.active_mirror
    if mirror is None:
        raise BadBody("a body that is alike on both sides needs a mesh with sides")
    found = model.estimate
    weights = at_most_four((found.weights + mirror.weights(found.weights)) / 2, mirror.vertices)
    even = replace(found, weights=weights)
    posedirs, ridge = local_posedirs(model.objective, even, mirror)
    return PoseParts(start, mirror, replace(even, posedirs=posedirs), ridge)


def regressor_from(parts: PoseParts, subjects: Index) -> tuple[csr_array, Array]:
    """The joints of some subjects from their templates, and how far off each is, (K,) m rms."""
    people, joints = parts.estimate.templates[subjects], parts.estimate.joints[subjects]
    names, radius = parts.start.joint_names, SEARCH_RADIUS["joints"]
    rows = regress(people, joints, names, parts.mirror.vertices, radius)
    return csr_array(rows), regression_errors(rows, people, joints)


def regression_errors(regressor: Array, people: Array, points: Array) -> Array:
    """Root mean square distance of each regressed point from the true one, (M,) m."""
    away = np.einsum("mn,pnc->pmc", regressor, people, optimize=True) - points
    errors: Array = np.sqrt((away**2).sum(axis=2).mean(axis=0))
    return errors


def even_body(parts: PoseParts, people: Array, regressor: csr_array) -> tuple[SkinnedBody, Array]:
    """The body of people (P, N, 3) m, un-posed, with its explained variance."""
    space = learn_shape_space(people, parts.start.faces, parts.mirror, min(10, len(people) - 1))
    body = SkinnedBody(
        template=space.template,
        shapedirs=space.shapedirs,
        posedirs=parts.estimate.posedirs,
        J_regressor=regressor,
        weights=parts.estimate.weights,
        parents=parts.estimate.parents,
        faces=parts.start.faces,
        joint_names=parts.start.joint_names,
        mirror=parts.mirror.vertices,
        name="trained",
    )
    return body, space.explained
