"""Fits to meshes of the body's own topology, in which every vertex has a known partner."""

from pathlib import Path

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Block, Values
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadFile
from workbench.fitting.body_priors import pose_prior, shape_prior
from workbench.fitting.compared_solvers import LARGE
from workbench.fitting.doubts import of_vertices
from workbench.fitting.mesh_start import placed
from workbench.fitting.setup import Measure, Setup, distances, rms
from workbench.geometry.meshes import read_registered, same_faces
from workbench.problem import Problem
from workbench.problem.naming import Bounds
from workbench.residuals import Residual, vertices
from workbench.residuals.kernels import Kernel, quadratic


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

    def measures(values: Values) -> tuple[Measure, ...]:
        found = body.vertices(*(values[block.name] for block in body.blocks()))
        references = {"vertex to observation": observed}
        if truth is not None:
            references[f"vertex to {'synthetic ' if synthetic else ''}truth"] = truth
        shown: list[Measure] = []
        for name, reference in references.items():
            off = distances(found, reference)
            shown += [rms(name, off), Measure(f"{name}, largest", float(off.max()), "mm")]
        return tuple(shown)

    return Setup(
        problem=Problem((data, *priors), ("pose", "betas", "trans"), bounds, (target,)),
        start=body.start() | (start or {}) | {target.name: observed},
        question=question,
        body=body,
        truth=truth,
        measures=measures,
        doubts=lambda values: of_vertices(
            np.linalg.norm(
                body.vertices(*(values[block.name] for block in body.blocks())) - observed, axis=1
            )
        ),
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
    mesh = read_registered(Path(path))
    observed = mesh.vertices
    if len(observed) != body.n_vertices:
        raise BadFile(
            f"{path} has {len(observed)} vertices, but body {body.name!r} has {body.n_vertices}; "
            "give a mesh of the body's topology, vertices in its order, or another --body"
        )
    spread = np.linalg.norm(observed.std(axis=0)) / np.linalg.norm(body.template.std(axis=0))
    if not 1 / 3 < spread < 3:
        raise BadFile(
            f"{path} is {spread:.3g} times as large as the body; metres are expected "
            "(millimetres look 1000 times, centimetres 100 times too large)"
        )
    return mesh_fit(
        body,
        observed,
        f"Which pose, shape and place of the body explain the vertices of {Path(path).name}?",
        sigma=sigma,
        priors=(shape_prior(body), pose_prior(body)),
        start=placed(body, observed),
        notes=()
        if same_faces(mesh.faces, body.faces)
        else (
            f"the faces of {Path(path).name} are not those of body {body.name!r}: that its "
            "vertices come in the body's order could not be checked",
        ),
    )
