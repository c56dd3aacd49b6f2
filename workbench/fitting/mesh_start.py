"""Where to begin a fit to a mesh of the body's topology: closed forms, no iteration."""

from collections.abc import Callable, Mapping

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Block, Layout, Values
from workbench.bodies.body import Body
from workbench.bodies.forward.posing import local_rotations, world_rotations
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix

Start = Callable[[Body, Array], Values]  # from a body and a mesh (N, 3) m of its topology
RIGID = 0.03  # m: how far off a body is whose parts are placed as if each were rigid


def zero(body: Body, observed: Array) -> Values:
    """Bind pose, mean shape and no translation: the template where it is."""
    return body.start()


def placed(body: Body, observed: Array) -> Values:
    """The root's rotation and the translation of the rest body moved rigidly onto a mesh."""
    motion = procrustes(body.vertices(), observed)
    return moved(body, motion.R, motion.t)


def moved(body: Body, R: Array, t: Array) -> Values:
    """Pose and trans of the rest body moved as a whole by p -> R p + t; the root turns about its
    own joint.
    """
    pose, _, trans = body.blocks()
    root = body.joints()[0]
    turned = body.bind_pose.copy()
    turned[0] = vector_from_matrix(R @ matrix_from_vector(turned[0]))
    return {pose.name: turned, trans.name: R @ root + t - root}


def from_correspondences(body: Body, observed: Array) -> Values:
    """Pose, betas and trans of a body near a mesh (N, 3) m, however far it is bent.

    Each part is moved rigidly onto the mesh by itself (Procrustes; vertices are weighted by the
    squares of their `vertex_weights`). The rotations along the tree are those of each part
    relative to its parent; their angles lie in [0, pi]. The vertices are then linear in betas and
    trans, which are solved for. Betas have their standard normal prior, because the shape would
    otherwise make up for parts that are not rigid.

    Raises NotNumbers, ShapeMismatch or NonFiniteValue for another mesh.
    """
    target = Block("observed", (body.n_vertices, 3), "m")
    mesh = Layout((target,)).pack({target.name: observed}).reshape(target.shape)
    bound = world_rotations(matrix_from_vector(body.bind_pose), body.parents)
    at_rest = local_rotations(bound, body.parents)
    weights = body.vertex_weights.T**2
    visible = np.count_nonzero(weights, axis=1) >= 3
    trusted = np.where(visible[:, None], weights, 1.0)
    world = np.stack([procrustes(body.template, mesh, each).R for each in trusted]) @ bound
    for k in np.flatnonzero(~visible):  # as in the bind pose, in its parent's frame
        world[k] = world[body.parents[k]] @ at_rest[k] if k else at_rest[0]
    found = vector_from_matrix(local_rotations(world, body.parents))
    shape, shift = _shape_of(body, found, mesh)
    pose, betas, trans = body.blocks()
    return {pose.name: found, betas.name: shape, trans.name: shift}


def _shape_of(body: Body, pose: Array, mesh: Array) -> tuple[Array, Array]:
    """Betas (B,) and trans (3,) m for a known pose, by ridge regression.

    A part is off as a whole, so all of its vertices together count as one observation.
    """
    B = body.n_betas
    sigma = RIGID * np.sqrt(body.n_vertices / body.n_joints)  # m, of a vertex
    mean, *along = body.vertices(pose, np.vstack([np.zeros(B), np.eye(B)]))
    columns = [(one - mean).ravel() for one in along]
    columns += [np.tile(axis, body.n_vertices) for axis in np.eye(3)]
    A = np.column_stack(columns) / sigma
    prior = np.eye(B, B + 3)  # none on trans
    right = np.concatenate([(mesh - mean).ravel() / sigma, np.zeros(B)])
    x = np.linalg.lstsq(np.vstack([A, prior]), right)[0]
    return x[:B], x[B:]


STARTS: Mapping[str, Start] = {
    "zero": zero,
    "placed": placed,
    "procrustes": from_correspondences,
}
"""The starts by the names that the command line uses."""
