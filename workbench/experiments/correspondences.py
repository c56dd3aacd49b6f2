"""Fits to bodies of the model itself: every correspondence is given, and the answer is known."""

from dataclasses import replace

import numpy as np

from workbench.bodies.catalogue import load_skinned
from workbench.errors import UnknownName
from workbench.experiments.synthetic_people import (
    MADE_OF_THE_MODEL,
    exact_answer,
    person_at_origin,
)
from workbench.fitting.compared_solvers import LARGE
from workbench.fitting.mesh_start import STARTS
from workbench.fitting.meshes import mesh_fit
from workbench.fitting.setup import Setup


def known_correspondences(
    body: str = "default",
    seed: int = 0,
    pose_sigma: float = 0.3,
    noise: float = 0.0,
    start: str = "zero",
    compared: tuple[str, ...] = LARGE,
) -> Setup:
    """The vertices of a posed and shaped body of the model: pose_sigma in rad, noise in m.

    `start` names one of STARTS: `zero`, `placed` or `procrustes`. Raises UnknownName.
    """
    if start not in STARTS:
        raise UnknownName("start", start, STARTS)
    model = load_skinned(body)
    rng = np.random.default_rng(seed)
    truth = person_at_origin(model, rng, pose_sigma)
    surface = model.vertices(*truth.values())
    observed = surface + noise * rng.standard_normal(surface.shape)
    setup = mesh_fit(
        model,
        observed,
        f"The vertices of a body of the model (synthetic; pose {pose_sigma} rad, shape 1 sd, "
        f"noise {1e3 * noise:g} mm, seed {seed}) are given, each with its partner. Does the fit "
        f"find the pose and shape that made them, from the start `{start}`?",
        sigma=noise or 1e-3,
        start=STARTS[start](model, observed),
        truth=surface,
        compared=compared,
        synthetic=MADE_OF_THE_MODEL,
    )
    return replace(setup, known=None if noise else exact_answer(model, truth), made_of=truth)
