"""Fits to meshes of the body's own topology: every vertex knows its partner."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Block, Values
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_body
from workbench.errors import BadFile
from workbench.experiments.experiment import Measure, Setup
from workbench.experiments.keypoint_fit import pose_prior
from workbench.geometry.meshes import read_mesh
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.problem import Problem
from workbench.residuals import Residual, gaussian, vertices

Array = NDArray[np.float64]
COMPARED = ("gauss-newton", "levenberg-marquardt", "ipopt", "nlopt-lbfgs")


def mesh_fit(
    body: SkinnedBody,
    observed: Array,
    question: str,
    *,
    sigma: float,
    priors: tuple[Residual, ...] = (),
    start: Values | None = None,
    truth: Array | None = None,
    further: tuple[Measure, ...] = (),
    compared: tuple[str, ...] = COMPARED,
) -> Setup:
    """Pose, betas and trans from the vertices (N, 3) m of a mesh of the topology; sigma in m.

    min |M(theta, beta) - V|^2, the course's align_3Dpoints.
    """
    pose, betas, trans = (block.symbol for block in body.blocks())
    target = Block("observed", (body.n_vertices, 3), "m")
    points = body.points(pose, betas, trans)
    data = vertices(points, target.symbol, sigma=sigma)

    def measures(values: Values) -> tuple[Measure, ...]:
        found = body.vertices(*(values[block.name] for block in body.blocks()))
        error = 1e3 * np.linalg.norm(found - observed, axis=1)
        shown = [
            Measure("vertex to observation, rms", float(np.sqrt(np.mean(error**2))), "mm"),
            Measure("vertex to observation, largest", float(error.max()), "mm"),
        ]
        if truth is not None:
            off = 1e3 * np.linalg.norm(found - truth, axis=1)
            shown.append(Measure("vertex to truth, rms", float(np.sqrt(np.mean(off**2))), "mm"))
            shown.append(Measure("vertex to truth, largest", float(off.max()), "mm"))
        return (*shown, *further)

    return Setup(
        problem=Problem((data, *priors), ("pose", "betas", "trans"), blocks=(target,)),
        start=body.start() | (start or {}) | {target.name: observed},
        question=question,
        body=body,
        truth=truth,
        measures=measures,
        priors=tuple(prior.name for prior in priors),
        compared=compared,
    )


def placed(body: SkinnedBody, observed: Array) -> Values:
    """The root's rotation and the translation of the rest body moved rigidly onto a mesh."""
    motion = procrustes(body.vertices(), observed)
    root = body.joints()[0]
    pose, _, trans = body.blocks()
    turned = body.bind_pose.copy()
    turned[0] = vector_from_matrix(motion.R @ matrix_from_vector(turned[0]))
    return {pose.name: turned, trans.name: motion(root) - root}


def known_correspondences(
    body: str = "default",
    seed: int = 0,
    pose_sigma: float = 0.3,
    noise: float = 0.0,
    compared: tuple[str, ...] = COMPARED,
) -> Setup:
    """A posed and shaped body of the model itself, start at zero: pose_sigma in rad, noise in m."""
    model = load_body(body)
    rng = np.random.default_rng(seed)
    truth = model.vertices(
        pose_sigma * rng.standard_normal((model.n_joints, 3)), rng.standard_normal(model.n_betas)
    )
    observed = truth + noise * rng.standard_normal(truth.shape)
    return mesh_fit(
        model,
        observed,
        f"The vertices of a body of the model (synthetic; pose {pose_sigma} rad, shape 1 sd, "
        f"noise {1e3 * noise:g} mm, seed {seed}) are given, each with its partner. Does the fit "
        "find the pose and shape that made them, from zero?",
        sigma=noise or 1e-3,
        truth=truth,
        compared=compared,
    )


def own_mesh(path: str | Path, body: SkinnedBody, sigma: float) -> Setup:
    """A user's mesh of the body's topology, in metres: placed rigidly, then fitted; sigma in m.

    Raises BadFile for another number of vertices, or a size that no person has.
    """
    observed = read_mesh(Path(path)).vertices
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
    )
