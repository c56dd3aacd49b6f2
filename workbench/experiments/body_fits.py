"""Fits of synthetic bodies: of graded difficulty for comparing solvers, and experiments by name."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Block, Values
from workbench.bodies import SkinnedBody, capsule_gaps, capsule_points, capsules_of
from workbench.bodies.catalogue import UNTRAINED, load_body, load_skinned
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.errors import BadArgument, UnknownName, check_known
from workbench.experiments.experiment import Experiment
from workbench.experiments.moving_people import body_video
from workbench.experiments.synthetic_people import (
    MADE_OF_THE_MODEL,
    SIZE,
    bent_person,
    drawn_person,
    exact_answer,
    likely_person,
    looking_in,
    person_at_origin,
    random_start,
    start_text,
    with_refined_answer,
)
from workbench.fitting.body_priors import pose_prior, shape_prior
from workbench.fitting.keypoints import keypoint_fit, landmark_set
from workbench.fitting.known_points import STARTS, joint_fit, mesh_fit
from workbench.fitting.observations import Observations, photograph
from workbench.fitting.placing import placed
from workbench.fitting.setup import (
    BOUNDED,
    GRADED,
    LARGE,
    SECOND_ORDER,
    KnownAnswer,
    Measure,
    Setup,
    distances,
    rms,
)
from workbench.geometry.camera import Camera
from workbench.priors.poses import draw_poses, shipped_mixture
from workbench.problem import Problem
from workbench.reading.arrays import read_expected, reals, shipped
from workbench.residuals import apart, landmarks, vertices
from workbench.residuals.kernels import Kernel, geman_mcclure, huber, quadratic
from workbench.solvers import solve

BEND_SIGMA = 0.3  # rad about each axis of a joint, where no other sigma is given
KERNELS: Mapping[str, tuple[Kernel, float]] = {  # with the sigma that suits each, m
    "squares": (quadratic, 0.005),
    "huber": (huber(), 0.005),
    "geman-mcclure": (geman_mcclure, 0.05),
}
ROOT_TURN = 1.5  # how much more the root is turned than other joints
STARTS_IN_WORDS = {
    "zero": "the template where it is",
    "placed": "the template moved onto them",
    "procrustes": "a pose in which each part is turned onto its vertices",
}
POSES_DRAWN = 100  # poses of which one is taken


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
    observed = _with_noise(model.vertices(*truth.values()), noise, rng)
    question = (
        f"The vertices of a body of the model (synthetic; pose {pose_sigma} rad, shape 1 sd, "
        f"noise {1e3 * noise:g} mm, seed {seed}) are given, each with its partner. Does the fit "
        f"find the pose and shape that made them, "
        f"starting from {STARTS_IN_WORDS[start]}?"
    )
    begin = STARTS[start](model, observed)
    return _of_vertices(model, truth, observed, question, noise, begin, compared)


def _of_vertices(
    model: SkinnedBody | TriangleBody,
    truth: Values,
    observed: Array,
    question: str,
    noise: float,
    start: Values,
    compared: tuple[str, ...],
) -> Setup:
    """A fit to all vertices, whose answer is known if there is no noise."""
    setup = mesh_fit(
        model,
        observed,
        question,
        sigma=noise or 1e-3,
        start=start,
        truth=model.vertices(*truth.values()),
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


def body_vertices(
    body: str = "small",
    seed: int = 0,
    start: int = 0,
    pose_sigma: float = BEND_SIGMA,
    noise: float = 0.0,
    start_sigma: float = 0.3,
) -> Setup:
    """Fit a body whose vertices are all known; pose_sigma and start_sigma in rad, noise in m."""
    model, rng, truth = drawn_person(body, seed, bent_person, pose_sigma)
    observed = _with_noise(model.vertices(**truth), noise, rng)
    question = (
        f"The vertices of a synthetic body (pose {pose_sigma} rad, noise {1e3 * noise:g} mm, seed "
        f"{seed}) are known, each with its partner. Does the fit find its pose and shape"
        f"{start_text(start, start_sigma)}?"
    )
    begin = random_start(model, seed, start, start_sigma)
    setup = _of_vertices(model, truth, observed, question, noise, begin, GRADED)
    return with_refined_answer(setup, truth) if noise else setup


def body_outliers(
    body: str = "small", seed: int = 0, start: int = 0, share: float = 0.2, kernel: str = "squares"
) -> Setup:
    """Fit vertices of which a `share` is 0.3 m off and the rest 5 mm, with one of KERNELS.

    `squares` trust all vertices, and `huber` bounds the influence of each. With `geman-mcclure` far
    vertices have hardly any, also good ones that are far off only because of where the fit starts.
    Raises UnknownName for another kernel.
    """
    check_known("kernel", kernel, KERNELS)
    robust, sigma = KERNELS[kernel]
    model, rng, truth = drawn_person(body, seed, bent_person, BEND_SIGMA)
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
    model, _, truth = drawn_person(body, seed, bent_person, BEND_SIGMA)
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
    setup = joint_fit(
        model,
        _with_noise(model.joints(**truth), noise, rng),
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
    body: str = "small", seed: int = 0, start: int = 0, pose_sigma: float = BEND_SIGMA
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


MODELS: Mapping[str, Callable[[SkinnedBody], SkinnedBody | TriangleBody]] = {
    "lbs": lambda body: replace(
        body, posedirs=np.zeros_like(body.posedirs), name=f"{body.name}, LBS"
    ),
    "smpl": lambda body: body,
    "scape": scape,
    "blend-scape": blend_scape,
}


def body_points(
    model: str = "smpl",
    body: str = "small",
    seed: int = 0,
    start: int = 0,
) -> Setup:
    """Fit one of MODELS to every seventh of its own vertices, seen with 5 mm of noise.

    The triangle models have the template, tree, shape space and J_regressor of `body`, and no
    learned posedirs. Raises UnknownName for another model.
    """
    check_known("model", model, MODELS)
    fitted, rng = MODELS[model](load_skinned(body)), np.random.default_rng(seed)
    truth = bent_person(fitted, rng, 0.4)
    pose, betas, trans = fitted.blocks()
    truth[pose.name][0] *= ROOT_TURN
    surface = fitted.vertices(**truth)
    indices = np.arange(0, fitted.n_vertices, 7)
    observed = _with_noise(surface[indices], 0.005, rng)
    points = fitted.points(pose.symbol, betas.symbol, trans.symbol, vertices=indices)
    data = vertices(points, observed, sigma=0.005)

    def measures(values: Values) -> tuple[Measure, ...]:
        here = fitted.vertices(*(values[block.name] for block in fitted.blocks()))
        return (
            rms("observed points", distances(here[indices], observed)),
            rms("vertex to synthetic truth", distances(here, surface)),
        )

    setup = Setup(
        problem=Problem((data, shape_prior(fitted)), (pose.name, betas.name, trans.name)),
        start=random_start(fitted, seed, start),
        question=f"{len(indices)} vertices of a synthetic person (seed {seed}) of the model "
        f"{model} are known to 5 mm. Does a fit of this model find the person{start_text(start)}?",
        body=fitted,
        truth=surface,
        measures=measures,
        priors=("shape prior",),
        compared=GRADED,
        synthetic=MADE_OF_THE_MODEL,
    )
    return with_refined_answer(setup, truth)


def registration(
    body: str = "default",
    person: int = 0,
    seed: int = 0,
    pose_sigma: float = 0.2,
    compared: tuple[str, ...] = LARGE,
) -> Setup:
    """Fit a posed person who was not among the training subjects, with all correspondences given.

    `pose_sigma` in rad. Raises UnknownName for a body without such people, or another person.
    """
    model = load_body(body)
    with shipped("bodies/held_out_people.npz", "file of held-out people") as archive:
        mesh, *_ = UNTRAINED.get(body, (body,))  # that of a triangle body is a skinned body's
        if mesh not in archive.headers:
            raise UnknownName("body with held-out people", body, archive.headers)
        templates = read_expected(archive, {mesh: reals("people", model.n_vertices, 3)})[mesh]
    if not 0 <= person < len(templates):
        raise UnknownName("person", str(person), hint=f"0 to {len(templates) - 1}")
    shape = replace(model, template=templates[person], name="held-out person")
    rng = np.random.default_rng(seed)
    truth = {
        "pose": pose_sigma * rng.standard_normal((model.n_joints, 3)),
        "betas": np.zeros(model.n_betas),
        "trans": rng.normal(0.0, 0.2, 3),
    }
    observed = shape.vertices(**truth)
    prior = shape_prior(model)
    setup = mesh_fit(
        model,
        observed,
        f"Person {person} (synthetic) was drawn from the same population, but is not one of those "
        "whom the shape directions were learned from. Every vertex is known; how near can ten "
        "directions come?",
        sigma=0.005,
        priors=(prior,),
        start=placed(model, observed),
        compared=compared,
        synthetic="the person is a mesh that a program made from artists' shapes, posed by the "
        "model's own skinning; nobody was measured",
    )
    nearest = solve(setup.problem.without(prior.name), setup.start | truth).values
    floor = setup.measures(setup.start | nearest)[0]  # vertex to observation, rms
    known = replace(floor, name="floor: without the prior, from the true pose, rms")
    return replace(setup, measures=lambda values: (*setup.measures(values), known))


def self_contact(body: str = "small", seed: int = 3, noise: float = 0.01) -> Setup:
    """Fit a body to its joints, which noise of so many m moved, in a pose that penetrates itself.

    Of `POSES_DRAWN` draws of the mixture of poses it is the one whose capsules overlap most nearly
    by 3 cm. What remains of the overlap has a standard deviation of 1 mm.
    """
    model = load_body(body)
    if not isinstance(model, SkinnedBody):
        raise BadArgument(f"the body {body!r} has no capsules; take small or default")
    rng = np.random.default_rng(seed)
    poses = draw_poses(shipped_mixture(), POSES_DRAWN, rng)
    overlap = -capsule_gaps(model, poses).min(axis=1)
    chosen = poses[int(np.argmin(abs(overlap - 0.03)))]
    pose, betas, trans = model.blocks()
    symbols = pose.symbol, betas.symbol, trans.symbol
    joints = model.joints(chosen)
    observed = Block("observed", joints.shape, "m", model.joint_names)
    data = landmarks(model.joint_points(*symbols), observed.symbol, sigma=noise, name="joints")
    capsules, ends = capsules_of(model), capsule_points(model, *symbols)
    contact = apart(ends, capsules.radii_in(betas.symbol), capsules.pairs, sigma=0.001)
    priors = (pose_prior(model), shape_prior(model))
    start = model.start() | {observed.name: joints + noise * rng.standard_normal(joints.shape)}

    def measures(values: dict[str, np.ndarray]) -> tuple[Measure, ...]:
        person = [values[block.name] for block in model.blocks()]
        gaps = capsule_gaps(model, *person)
        deepest = int(np.argmin(gaps))
        pair = capsules.pair_names[deepest].replace("_", " ")
        return (
            Measure("deepest overlap", float(1e3 * max(0.0, -gaps[deepest])), "mm", pair),
            rms("joint to observation", distances(model.joints(*person), start[observed.name])),
        )

    return Setup(
        problem=Problem(
            (data, *priors, contact), [b.name for b in model.blocks()], blocks=(observed,)
        ),
        start=start,
        question=f"The joints of a pose (seed {seed}) in which the body goes through itself were "
        f"observed to {1e3 * noise:g} mm. Which pose near it keeps the limbs apart?",
        body=model,
        measures=measures,
        priors=("pose prior", "shape prior"),
        compared=SECOND_ORDER,
        synthetic="the pose is a draw of the prior, in which nothing keeps limbs apart; nobody was "
        "observed",
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
MODEL_FITS = tuple(
    Experiment(f"body-points-{model}", body_points, f"53 points, {text}", {"model": model})
    for model, text in (
        ("lbs", "linear blend skinning"),
        ("smpl", "SMPL"),
        ("scape", "SCAPE"),
        ("blend-scape", "BlendSCAPE"),
    )
)
