"""Fits to meshes and joints whose partners on the body are known, and where they begin."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Block, Layout, Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.forward.posing import local_rotations, world_rotations
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadFile
from workbench.fitting.body_priors import pose_prior, shape_prior
from workbench.fitting.doubts import of_vertices
from workbench.fitting.placing import placed
from workbench.fitting.setup import LARGE, Measure, Setup, distances, rms
from workbench.geometry.meshes import read_registered, same_faces
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.problem import Problem
from workbench.problem.naming import Bounds
from workbench.residuals import Residual, landmarks, vertices
from workbench.residuals.kernels import Kernel, quadratic

Start = Callable[[Body, Array], Values]  # from a body and a mesh (N, 3) m of its topology
RIGID_ERROR = 0.03  # m: how far off a body is whose parts are placed as if each were rigid


def from_correspondences(body: Body, observed: Array) -> Values:
    """Pose, betas and trans of a body near a mesh (N, 3) m, however far it is bent.

    Each part is moved rigidly onto the mesh by itself (Procrustes; vertices are weighted by the
    squares of their `vertex_weights`); its rotation is relative to its parent's. The vertices are
    then linear in betas and trans, which are solved for. Betas have their standard normal prior,
    because the shape would otherwise make up for parts that are not rigid.

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
    vectors = vector_from_matrix(local_rotations(world, body.parents))
    shape, shift = _shape_of(body, vectors, mesh)
    pose, betas, trans = body.blocks()
    return {pose.name: vectors, betas.name: shape, trans.name: shift}


def _shape_of(body: Body, pose: Array, mesh: Array) -> tuple[Array, Array]:
    """Betas (B,) and trans (3,) m for a known pose, by ridge regression.

    A part is off as a whole, so all of its vertices together count as one observation.
    """
    B = body.n_betas
    sigma = RIGID_ERROR * np.sqrt(body.n_vertices / body.n_joints)  # m, of a vertex
    mean, *along = body.vertices(pose, np.vstack([np.zeros(B), np.eye(B)]))
    columns = [(moved_vertices - mean).ravel() for moved_vertices in along]
    columns += [np.tile(axis, body.n_vertices) for axis in np.eye(3)]
    A = np.column_stack(columns) / sigma
    prior = np.eye(B, B + 3)  # none on trans
    right = np.concatenate([(mesh - mean).ravel() / sigma, np.zeros(B)])
    x = np.linalg.lstsq(np.vstack([A, prior]), right)[0]
    return x[:B], x[B:]


STARTS: Mapping[str, Start] = {
    "zero": lambda body, observed: body.start(),  # the template where it is
    "placed": placed,
    "procrustes": from_correspondences,
}
"""The starts by the names that the command line uses."""


def mesh_fit(
    body: SkinnedBody | TriangleBody,
    observed: Array,
    question: str,
    *,
    sigma: float,
    priors: tuple[Residual, ...] = (),
    kernel: Kernel = quadratic,
    bounds: Bounds | None = None,
    start: Values | None = None,
    truth: Array | None = None,
    compared: tuple[str, ...] = LARGE,
    synthetic: str = "",
    notes: tuple[str, ...] = (),
) -> Setup:
    """Fit pose, betas and trans to a mesh (N, 3) m of the body's topology; sigma is in m.

    Minimizes |M(theta, beta) - V|^2, as align_3Dpoints does in the lecture of Pons-Moll and
    Swoboda (Body Models II, 2018). `truth` (N, 3) m is the true
    surface, where it is known. `synthetic` says in a sentence what was made up, if the vertices
    were not measured.
    """
    pose, betas, trans = (block.symbol for block in body.blocks())
    target = Block("observed", (body.n_vertices, 3), "m")
    points = body.points(pose, betas, trans)
    data = vertices(points, target.symbol, sigma=sigma, kernel=kernel)

    def places(values: Values) -> Array:
        return body.vertices(*(values[block.name] for block in body.blocks()))

    def measures(values: Values) -> tuple[Measure, ...]:
        surface = places(values)
        references = {"vertex to observation": observed}
        if truth is not None:
            references[f"vertex to {'synthetic ' if synthetic else ''}truth"] = truth
        shown: list[Measure] = []
        for name, reference in references.items():
            off = distances(surface, reference)
            shown += [rms(name, off), Measure(f"{name}, largest", float(off.max()), "mm")]
        return tuple(shown)

    return Setup(
        problem=Problem(
            (data, *priors), [block.name for block in body.blocks()], bounds, (target,)
        ),
        start=body.start() | (start or {}) | {target.name: observed},
        question=question,
        body=body,
        truth=truth,
        measures=measures,
        doubts=lambda values: of_vertices(np.linalg.norm(places(values) - observed, axis=1)),
        priors=tuple(prior.name for prior in priors),
        compared=compared,
        synthetic=synthetic,
        notes=notes,
    )


def own_mesh(path: str | Path, body: SkinnedBody | TriangleBody, sigma: float) -> Setup:
    """Fit a user's mesh of the body's topology, in metres, from a rigid placement; sigma is in m.

    Raises BadFile for another number of vertices, a file format that does not keep their order
    (.stl), or a size that no person has.
    """
    mesh = read_registered(Path(path), points_alone=True)
    observed = mesh.vertices
    if len(observed) != body.n_vertices:
        raise BadFile(
            f"{path} has {len(observed)} vertices, but body {body.name!r} has {body.n_vertices}; "
            "give a mesh of the body's topology, vertices in its order, or another --body; "
            "`workbench register` takes a scan"
        )
    spread = np.linalg.norm(observed.std(axis=0)) / np.linalg.norm(body.template.std(axis=0))
    if not 1 / 3 < spread < 3:
        raise BadFile(
            f"{path} is {spread:.3g} times as large as the body; metres are expected "
            "(millimetres look 1000 times, centimetres 100 times too large)"
        )
    unchecked = (
        f"the faces of {Path(path).name} are not those of body {body.name!r}: that its "
        "vertices come in the body's order could not be checked"
    )
    return mesh_fit(
        body,
        observed,
        f"Which pose, shape and place of the body explain the vertices of {Path(path).name}?",
        sigma=sigma,
        priors=(shape_prior(body), pose_prior(body)),
        start=placed(body, observed),
        notes=() if same_faces(mesh.faces, body.faces) else (unchecked,),
    )


def joint_fit(
    body: SkinnedBody | TriangleBody,
    observed: Array,
    question: str,
    *,
    sigma: float,
    priors: tuple[Residual, ...] = (),
    start: Values | None = None,
    truth: Values | None = None,
    compared: tuple[str, ...] = (),
    synthetic: str = "",
) -> Setup:
    """Fit pose, betas and trans to the positions (K, 3) m of a body's joints; sigma is in m.

    `truth` holds pose, betas and trans of the body of which synthetic joints were made; with it,
    distances are measured from that body. `synthetic` says in a sentence what was made up.
    """
    pose, betas, trans = body.blocks()
    target = Block("observed", observed.shape, "m", body.joint_names)
    points = body.joint_points(pose.symbol, betas.symbol, trans.symbol)
    data = landmarks(points, target.symbol, sigma=sigma, name="joints")
    surface = None if truth is None else body.vertices(*truth.values())

    def measures(values: Values) -> tuple[Measure, ...]:
        fitted = [values[block.name] for block in body.blocks()]
        joints = body.joints(*fitted)
        if truth is None or surface is None:
            return (rms("joint to observation", distances(joints, observed)),)
        return (
            rms("joint to synthetic truth", distances(joints, body.joints(*truth.values()))),
            rms("vertex to synthetic truth", distances(body.vertices(*fitted), surface)),
            rms("betas to synthetic truth", values[betas.name] - truth[betas.name], "sd"),
        )

    return Setup(
        problem=Problem((data, *priors), [block.name for block in body.blocks()], blocks=(target,)),
        start=body.start() | (start or {}) | {target.name: observed},
        question=question,
        body=body,
        truth=surface,
        measures=measures,
        priors=tuple(prior.name for prior in priors),
        compared=compared,
        synthetic=synthetic,
        made_of=truth,
    )
