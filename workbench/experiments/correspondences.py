"""Fits to meshes of the body's own topology: every vertex knows its partner."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.blocks import Block, Values
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_skinned
from workbench.errors import BadFile, UnknownName
from workbench.experiments.correspondence_start import STARTS, placed
from workbench.experiments.experiment import Measure, Setup
from workbench.experiments.keypoint_fit import pose_prior
from workbench.experiments.known import Known
from workbench.geometry.meshes import read_registered, same_faces
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.problem import Problem
from workbench.problem.bounds import Bounds
from workbench.residuals import Residual, gaussian, vertices
from workbench.residuals.kernels import Kernel, quadratic

Array = NDArray[np.float64]
MADE_OF_THE_MODEL = (
    "the observed body is the model itself, in a pose and a shape drawn at random, with noise "
    "where the question names some; nobody was measured, and a real person is no body of the model"
)
COMPARED = ("gauss-newton", "levenberg-marquardt", "ipopt", "nlopt-lbfgs")


def mesh_fit(
    body: SkinnedBody,
    observed: Array,
    question: str,
    *,
    sigma: float,
    priors: tuple[Residual, ...] = (),
    kernel: Kernel = quadratic,
    bounds: Bounds | None = None,
    start: Values | None = None,
    truth: Array | None = None,
    further: tuple[Measure, ...] = (),
    known: Known | None = None,
    compared: tuple[str, ...] = COMPARED,
    synthetic: str = "",
    notes: tuple[str, ...] = (),
) -> Setup:
    """Pose, betas and trans from the vertices (N, 3) m of a mesh of the topology; sigma in m.

    min |M(theta, beta) - V|^2, the course's align_3Dpoints. `synthetic` says what was made up,
    if the vertices were not measured.
    """
    pose, betas, trans = (block.symbol for block in body.blocks())
    target = Block("observed", (body.n_vertices, 3), "m")
    points = body.points(pose, betas, trans)
    data = vertices(points, target.symbol, sigma=sigma, kernel=kernel)

    def measures(values: Values) -> tuple[Measure, ...]:
        found = body.vertices(*(values[block.name] for block in body.blocks()))
        error = 1e3 * np.linalg.norm(found - observed, axis=1)
        shown = [
            Measure("vertex to observation, rms", float(np.sqrt(np.mean(error**2))), "mm"),
            Measure("vertex to observation, largest", float(error.max()), "mm"),
        ]
        if truth is not None:
            off = 1e3 * np.linalg.norm(found - truth, axis=1)
            of = f"vertex to {'synthetic ' if synthetic else ''}truth"
            shown.append(Measure(f"{of}, rms", float(np.sqrt(np.mean(off**2))), "mm"))
            shown.append(Measure(f"{of}, largest", float(off.max()), "mm"))
        return (*shown, *further)

    return Setup(
        problem=Problem((data, *priors), ("pose", "betas", "trans"), bounds, (target,)),
        start=body.start() | (start or {}) | {target.name: observed},
        question=question,
        body=body,
        truth=truth,
        measures=measures,
        priors=tuple(prior.name for prior in priors),
        compared=compared,
        known=known,
        synthetic=synthetic,
        notes=notes,
    )


def known_correspondences(
    body: str = "default",
    seed: int = 0,
    pose_sigma: float = 0.3,
    noise: float = 0.0,
    start: str = "zero",
    compared: tuple[str, ...] = COMPARED,
) -> Setup:
    """A posed and shaped body of the model itself: pose_sigma in rad, noise in m.

    `start` names one of STARTS: `zero`, `placed` or `procrustes`.
    """
    if start not in STARTS:
        raise UnknownName("start", start, STARTS)
    model = load_skinned(body)
    rng = np.random.default_rng(seed)
    pose = pose_sigma * rng.standard_normal((model.n_joints, 3))
    betas = rng.standard_normal(model.n_betas)
    truth = model.vertices(pose, betas)
    observed = truth + noise * rng.standard_normal(truth.shape)
    setup = mesh_fit(
        model,
        observed,
        f"The vertices of a body of the model (synthetic; pose {pose_sigma} rad, shape 1 sd, "
        f"noise {1e3 * noise:g} mm, seed {seed}) are given, each with its partner. Does the fit "
        f"find the pose and shape that made them, from the start `{start}`?",
        sigma=noise or 1e-3,
        start=STARTS[start](model, observed),
        truth=truth,
        compared=compared,
        known=None if noise else recovered(model, pose, betas),
        synthetic=MADE_OF_THE_MODEL,
    )
    names = (block.name for block in model.blocks())
    return replace(setup, made_of=dict(zip(names, (pose, betas, np.zeros(3)), strict=True)))


def recovered(body: SkinnedBody, pose: Array, betas: Array, trans: ArrayLike = (0, 0, 0)) -> Known:
    """That noiseless synthetic data are explained by what they were made of."""
    names = (block.name for block in body.blocks())
    turns = vector_from_matrix(matrix_from_vector(pose))  # at most half a turn: 2 pi are nothing
    made_of = (turns, betas, np.asarray(trans, dtype=float))
    values = dict(zip(names, made_of, strict=True))
    return Known("the synthetic body that the data were made of", 0.0, values)


def own_mesh(path: str | Path, body: SkinnedBody, sigma: float) -> Setup:
    """A user's mesh of the body's topology, in metres: placed rigidly, then fitted; sigma in m.

    Raises BadFile for another number of vertices, a file that does not keep their order (.stl), or
    a size that no person has.
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
        priors=(gaussian(body.blocks()[1].symbol, name="shape prior"), pose_prior(body)),
        start=placed(body, observed),
        compared=COMPARED,
        notes=()
        if same_faces(mesh.faces, body.faces)
        else (
            f"the faces of {Path(path).name} are not those of body {body.name!r}: that its "
            "vertices come in the body's order is taken on trust",
        ),
    )
