"""Fits to bodies of the model itself, whose vertices or joints are given one by one."""

from dataclasses import replace

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadArgument, check_known
from workbench.experiments.synthetic_people import (
    MADE_OF_THE_MODEL,
    drawn_person,
    exact_answer,
    likely_person,
    person_at_origin,
)
from workbench.fitting.body_priors import pose_prior, shape_prior
from workbench.fitting.known_points import STARTS, joint_fit, mesh_fit
from workbench.fitting.setup import LARGE, SECOND_ORDER, Setup


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
    check_known("start", start, STARTS)
    model, rng, truth = drawn_person(body, seed, person_at_origin, pose_sigma)
    surface = model.vertices(*truth.values())
    observed = _with_noise(surface, noise, rng)
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


def shape_from_landmarks(
    body: str = "default", seed: int = 0, pose_sigma: float | None = None, noise: float = 0.01
) -> Setup:
    """Fit a body to its own 3D joints with noise, at a synthetic pose and shape.

    Both are drawn from the priors of the fit, so that intervals of its posterior can be compared
    with the truth; with `pose_sigma`, angles are normal about the bind pose, with that standard
    deviation in rad, whatever the prior says. `noise`, which is the residuals' sigma as well, is in
    m. Raises BadArgument if there is no noise.
    """
    if not noise > 0:
        raise BadArgument(f"noise must be above zero metres, not {noise}; it is the sigma as well")
    if pose_sigma is None:
        model, rng, truth = drawn_person(body, seed, likely_person)
        drawn = "pose and shape drawn from the priors"
    else:
        model, rng, truth = drawn_person(body, seed, person_at_origin, pose_sigma)
        drawn = f"pose {pose_sigma} rad, shape 1 sd"
    return joint_fit(
        model,
        _with_noise(model.joints(*truth.values()), noise, rng),
        f"The {model.n_joints} joints of a body of the model (synthetic; {drawn}, "
        f"seed {seed}) are known to {1e3 * noise:g} mm. What do they say about its "
        "shape, and what do they leave open?",
        sigma=noise,
        priors=(shape_prior(model), pose_prior(model)),
        truth=truth,
        compared=SECOND_ORDER,
        synthetic=MADE_OF_THE_MODEL,
    )


def _with_noise(points: Array, noise: float, rng: np.random.Generator) -> Array:
    return points + noise * rng.standard_normal(points.shape)
