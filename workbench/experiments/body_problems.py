"""Fits of bodies of graded difficulty, for comparing solvers.

Every builder takes the body's name, the `seed` of the person and of the noise, and the number of
the `start`: 0 is the template at the origin, any other number is a random start, the same for each
solver. All data are synthetic.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from workbench.blocks import Values
from workbench.errors import check_known
from workbench.experiments.body_video import body_video
from workbench.experiments.experiment import Experiment
from workbench.experiments.synthetic_cameras import SIZE, looking_in
from workbench.experiments.synthetic_people import (
    MADE_OF_THE_MODEL,
    bent_person,
    drawn_person,
    exact_answer,
    likely_person,
    random_start,
    start_text,
    with_refined_answer,
)
from workbench.fitting.body_priors import pose_prior, shape_prior
from workbench.fitting.keypoints import keypoint_fit, landmark_set
from workbench.fitting.known_points import joint_fit, mesh_fit
from workbench.fitting.observations import Observations, photograph
from workbench.fitting.setup import BOUNDED, GRADED, KnownAnswer, Setup
from workbench.geometry.camera import Camera
from workbench.residuals.kernels import Kernel, geman_mcclure, huber, quadratic

BENT = 0.3  # rad about each axis of a joint, where no other sigma is given
KERNELS: Mapping[str, tuple[Kernel, float]] = {  # with the sigma that suits each, m
    "squares": (quadratic, 0.005),
    "huber": (huber(), 0.005),
    "geman-mcclure": (geman_mcclure, 0.05),
}


def body_vertices(
    body: str = "small",
    seed: int = 0,
    start: int = 0,
    pose_sigma: float = BENT,
    noise: float = 0.0,
    start_sigma: float = 0.3,
) -> Setup:
    """Fit a body whose vertices are all known; pose_sigma and start_sigma in rad, noise in m."""
    model, rng, truth = drawn_person(body, seed, bent_person, pose_sigma)
    surface = model.vertices(**truth)
    observed = surface + noise * rng.standard_normal(surface.shape)
    setup = mesh_fit(
        model,
        observed,
        f"The vertices of a synthetic body (pose {pose_sigma} rad, noise {1e3 * noise:g} mm, seed "
        f"{seed}) are known, each with its partner. Does the fit find its pose and shape"
        f"{start_text(start, start_sigma)}?",
        sigma=noise or 1e-3,
        start=random_start(model, seed, start, start_sigma),
        truth=surface,
        synthetic=MADE_OF_THE_MODEL,
        compared=GRADED,
    )
    if noise == 0:
        return replace(setup, known=exact_answer(model, truth), made_of=truth)
    return with_refined_answer(setup, truth)


def body_outliers(
    body: str = "small", seed: int = 0, start: int = 0, share: float = 0.2, kernel: str = "squares"
) -> Setup:
    """Fit vertices of which a `share` is 0.3 m off and the rest 5 mm, with one of KERNELS.

    `squares` trust all vertices, and `huber` bounds the pull of each. With `geman-mcclure` far
    vertices hardly pull, also good ones that are far off only because of where the fit starts.
    Raises UnknownName for another kernel.
    """
    check_known("kernel", kernel, KERNELS)
    robust, sigma = KERNELS[kernel]
    model, rng, truth = drawn_person(body, seed, bent_person, BENT)
    surface = model.vertices(**truth)
    off = np.where(rng.random(len(surface)) < share, 0.3, 0.005)  # m
    setup = mesh_fit(
        model,
        surface + off[:, None] * rng.standard_normal(surface.shape),
        f"Of the vertices of a synthetic body (seed {seed}), {100 * share:g} % lie 30 cm off, the "
        f"others 5 mm. Does the fit see past them{start_text(start)}?",
        sigma=sigma,
        kernel=robust,
        priors=(shape_prior(model),),
        start=random_start(model, seed, start),
        truth=surface,
        synthetic=MADE_OF_THE_MODEL,
        compared=GRADED,
    )
    return with_refined_answer(setup, truth)


def body_bounds(body: str = "small", seed: int = 0, start: int = 0, limit: float = 0.4) -> Setup:
    """Fit a body whose vertices are known, with angles bounded by `limit` rad and betas by 1.

    Many of the true values lie outside of these bounds.
    """
    model, _, truth = drawn_person(body, seed, bent_person, BENT)
    pose, betas, _ = (block.name for block in model.blocks())
    bounds = {pose: (-limit, limit), betas: (-1.0, 1.0)}

    def inside(values: Values) -> Values:
        return values | {name: np.clip(values[name], *bounds[name]) for name in bounds}

    surface = model.vertices(**truth)
    setup = mesh_fit(
        model,
        surface,
        f"The vertices of a synthetic body (pose 0.3 rad, seed {seed}) are known, but its angles "
        f"are bounded by {limit:g} rad and its betas by 1 sd. Which of them end at their bounds"
        f"{start_text(start)}?",
        sigma=0.005,
        bounds=bounds,
        start=inside(random_start(model, seed, start)),
        truth=surface,
        synthetic=MADE_OF_THE_MODEL,
        compared=BOUNDED,
    )
    return with_refined_answer(setup, truth, inside(truth))


def body_joints(body: str = "small", seed: int = 0, start: int = 0, noise: float = 0.01) -> Setup:
    """Fit all joints, known to `noise` m, with priors on pose and shape."""
    model, rng, truth = drawn_person(body, seed, likely_person)
    joints = model.joints(**truth)
    setup = joint_fit(
        model,
        joints + noise * rng.standard_normal(joints.shape),
        f"The joints of a synthetic body (seed {seed}) are known to {1e3 * noise:g} mm, and priors "
        f"say the rest. Which body is the likeliest{start_text(start)}?",
        sigma=noise,
        priors=(pose_prior(model), shape_prior(model)),
        start=random_start(model, seed, start),
        compared=GRADED,
        synthetic=MADE_OF_THE_MODEL,
    )
    return with_refined_answer(setup, truth)


def body_joints_alone(
    body: str = "small", seed: int = 0, start: int = 0, pose_sigma: float = BENT
) -> Setup:
    """Fit exact joints without priors: the Jacobian is rank-deficient, and many bodies fit."""
    model, _, truth = drawn_person(body, seed, bent_person, pose_sigma)
    setup = joint_fit(
        model,
        model.joints(**truth),
        f"The joints of a synthetic body (pose {pose_sigma} rad, seed {seed}) are known exactly, "
        f"and nothing else is. Is one of the bodies found that explain them{start_text(start)}?",
        sigma=0.01,
        start=random_start(model, seed, start),
        compared=GRADED,
        synthetic=MADE_OF_THE_MODEL,
    )
    return replace(
        setup, known=KnownAnswer("the joints are those of a synthetic person", 0.0), made_of=truth
    )


def body_cameras(
    body: str = "small", seed: int = 0, start: int = 0, cameras: int = 4, noise: float = 4.0
) -> Setup:
    """Fit keypoints in images of 1000 px from cameras around the body, with priors; noise in px."""
    model, rng, truth = drawn_person(body, seed, likely_person)
    kind = landmark_set(model)
    names, points = model.landmark_names(kind), model.landmark(kind, **truth)
    photographs = []
    for i in range(cameras):
        calibration = looking_in(2 * np.pi * i / cameras)
        camera = Camera()
        pixels = camera.pixels(points, camera.values(**calibration))
        pixels = pixels + noise * rng.standard_normal(pixels.shape)
        observed = np.column_stack([pixels, np.ones(len(pixels))])
        photographs.append(photograph(f"camera {i + 1}", (SIZE, SIZE), observed, calibration))
    setup = keypoint_fit(
        Observations(names, tuple(photographs)),
        model,
        f"{cameras} synthetic image{'s' * (cameras > 1)} (seed {seed}) show the keypoints of a "
        f"synthetic body to {noise:g} px, and priors say the rest. Which body is the likeliest"
        f"{start_text(start)}?",
        sigma=noise,
        compared=GRADED,
    )
    start_values = setup.start | random_start(model, seed, start)
    return with_refined_answer(
        replace(setup, start=start_values, synthetic=MADE_OF_THE_MODEL), truth
    )


BODIES = (
    Experiment("body-vertices", body_vertices, "every vertex known, no noise"),
    Experiment(
        "body-vertices-noisy", body_vertices, "every vertex known to 2 mm", {"noise": 0.002}
    ),
    Experiment(
        "body-vertices-bent",
        body_vertices,
        "every vertex known, joints bent by 1 rad per axis",
        {"pose_sigma": 1.0},
    ),
    Experiment(
        "body-vertices-far",
        body_vertices,
        "every vertex known, starts 1 rad off per axis",
        {"start": 1, "start_sigma": 1.0},
    ),
    Experiment("body-joints", body_joints, "joints known to 10 mm, and priors"),
    Experiment("body-joints-alone", body_joints_alone, "joints without a prior: rank-deficient"),
    Experiment("body-four-cameras", body_cameras, "keypoints in four images, and priors"),
    Experiment(
        "body-one-camera", body_cameras, "keypoints in one image, and priors", {"cameras": 1}
    ),
    Experiment("body-video", body_video, "a walk in eight frames, one shape for all of them"),
    Experiment("body-outliers", body_outliers, "a fifth of the vertices 30 cm off, squares"),
    Experiment(
        "body-outliers-huber",
        body_outliers,
        "a fifth of the vertices 30 cm off, Huber's kernel",
        {"kernel": "huber"},
    ),
    Experiment(
        "body-outliers-geman-mcclure",
        body_outliers,
        "a fifth of the vertices 30 cm off, Geman and McClure's kernel",
        {"kernel": "geman-mcclure"},
    ),
    Experiment("body-bounds", body_bounds, "every vertex known, bounds active at the answer"),
)
