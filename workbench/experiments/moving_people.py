"""Synthetic people in motion: one who walks, filmed by cameras, and one who wears markers."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Block, Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.catalogue import load_body
from workbench.errors import BadArgument
from workbench.experiments.synthetic_people import (
    drawn_person,
    likely_person,
    looking_in,
    random_start,
    start_text,
    with_refined_answer,
)
from workbench.fitting.body_priors import pose_prior, shape_prior
from workbench.fitting.keypoints import camera_residual, landmark_set
from workbench.fitting.marker_sets import MARKERS, MarkerSet, default_markers
from workbench.fitting.markers import marker_fit
from workbench.fitting.setup import SECOND_ORDER, Measure, Setup, distances, rms
from workbench.geometry.camera import Camera
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.problem import Problem, sequence
from workbench.residuals import Residual, smooth
from workbench.residuals.kernels import quadratic

SWINGS = {
    "left_hip": 0.4,
    "right_hip": -0.4,
    "left_shoulder": -0.4,
    "right_shoulder": 0.4,
}  # rad, forwards and backwards
FRAMES_PER_CYCLE = 8  # frames of two steps
SPEED = 0.04  # m a frame
POSE_SIGMA, TRANS_SIGMA = 0.2, 0.05  # rad and m: the usual change from frame to frame
FILM_IS_SYNTHETIC = (
    "the filmed body is the model itself, which swings its arms and legs, with noise in the "
    "images; nobody was filmed, and a real person is no body of the model"
)


def body_video(
    body: str = "small",
    seed: int = 0,
    start: int = 0,
    frames: int = 8,
    cameras: int = 2,
    noise: float = 4.0,
    missing: float = 0.1,
) -> Setup:
    """Fit keypoints in the frames of a video, of which a share `missing` was not observed.

    Noise is in px. Each frame has its own pose and trans, smooth in time; all share the betas. The
    cameras stand on a half circle in front of the person; two of them look from the front and the
    side.
    """
    if not 0 <= missing < 1:
        raise BadArgument(
            f"missing is the share of keypoints that were not observed, from 0 to 1, not {missing}"
        )
    if frames < 2:
        raise BadArgument(f"a video has two frames or more, not {frames}")
    if cameras < 1:
        raise BadArgument(f"a video is seen by one camera or more, not by {cameras}")
    model, rng, truth = drawn_person(body, seed, walk, frames)
    pose, betas, trans = model.blocks()
    kind = landmark_set(model)
    names = model.landmark_names(kind)
    points = model.landmark_points(kind, pose.symbol, betas.symbol, trans.symbol)
    posed = zip(truth[pose.name], truth[trans.name], strict=True)
    places = np.array([model.landmark(kind, p, truth[betas.name], t) for p, t in posed])
    terms: list[Residual] = []
    blocks: list[Block] = []
    shared = [betas.name]
    values = dict(random_start(model, seed, start))
    for name in (pose.name, trans.name):
        values[name] = np.repeat(values[name][None], frames, axis=0)
    for i in range(cameras):
        camera = Camera(f"camera {i + 1}/")
        residual, observations = camera_residual(points, camera, names, noise, quadratic)
        numbers = camera.values(**looking_in(np.pi * i / cameras))
        pixels = np.array([camera.pixels(p, numbers) for p in places])
        observed, confidence = (block.name for block in observations)
        values |= numbers | {
            observed: pixels + noise * rng.standard_normal(pixels.shape),
            confidence: (rng.random(pixels.shape[:2]) >= missing).astype(float),
        }
        terms.append(residual)
        blocks += observations
        shared += [block.name for block in camera.blocks]
    priors = (pose_prior(model), shape_prior(model))
    frame = Problem((*terms, *priors), [block.name for block in model.blocks()], blocks=blocks)
    between = (
        smooth(pose.name, sigma=POSE_SIGMA, name="smooth pose"),
        smooth(trans.name, sigma=TRANS_SIGMA, name="smooth place"),
    )
    problem = sequence([frame] * frames, shared=shared, between=between)
    setup = Setup(
        problem=problem,
        start=values,
        question=f"A synthetic body (seed {seed}) walks through {frames} frames, seen by {cameras} "
        f"camera{'s' * (cameras > 1)} to {noise:g} px; {100 * missing:g} % of its keypoints are "
        f"missing. Its shape is one and the same in all frames, and its motion is smooth. Which "
        f"motion is the likeliest{start_text(start)}?",
        measures=lambda values: _measures(model, values, truth),
        priors=(*(prior.name for prior in priors), "smooth pose", "smooth place"),
        compared=SECOND_ORDER,
        synthetic=FILM_IS_SYNTHETIC,
    )
    return with_refined_answer(setup, truth)


def walk(body: Body, rng: np.random.Generator, frames: int) -> Values:
    """Pose (T, K, 3) rad, betas (B,) and trans (T, 3) m of a likely person who walks forwards.

    Hips and shoulders swing, if the body's joints have SMPL's names.
    """
    pose, _, trans = (block.name for block in body.blocks())
    person = likely_person(body, rng)
    phase = np.sin(2 * np.pi * np.arange(frames) / FRAMES_PER_CYCLE)
    poses = np.repeat(person[pose][None], frames, axis=0)
    for joint, angle in SWINGS.items():
        if joint in body.joint_names:
            poses[:, body.joint_names.index(joint), 0] += angle * phase
    steps = SPEED * (np.arange(frames) - (frames - 1) / 2)
    return person | {pose: poses, trans: person[trans] + steps[:, None] * [0.0, 0.0, 1.0]}


def _measures(body: Body, values: Mapping[str, Array], truth: Values) -> tuple[Measure, ...]:
    pose, betas, trans = (block.name for block in body.blocks())

    def joints(values: Mapping[str, Array]) -> Array:
        frames = zip(values[pose], values[trans], strict=True)
        return np.array([body.joints(p, values[betas], t) for p, t in frames])

    errors = distances(joints(values), joints(truth))  # (T, K)
    return (
        rms("joint to synthetic truth", errors),
        Measure("joint to synthetic truth, worst frame", float(errors.mean(axis=1).max()), "mm"),
        rms("betas to synthetic truth", values[betas] - truth[betas], "sd"),
    )


Placed = Callable[[SkinnedBody, MarkerSet, Array, float, np.random.Generator], Array]
MARKERS_ARE_SYNTHETIC = (
    "the person is the model itself, in poses that are drawn from the pose prior, with made-up "
    "places of the markers; nobody was recorded, skin does not slide, and no marker is mislabelled"
)


def markers(
    body: str = "default",
    seed: int = 0,
    frames: int = 12,
    noise: float = 1.0,
    missing: float = 0.05,
    apart: float = 5.0,
) -> Setup:
    """Fit poses, shape and offsets to 41 markers in some frames, as MoSh does.

    Noise is in mm. A share `missing` of the places was not seen. The markers sit `apart` mm from
    their nominal places, along each axis. Raises BadArgument for a body without SMPL's joints.
    """
    if not 0 <= missing < 1:
        raise BadArgument(f"missing is a share of the markers, from 0 to 1, not {missing}")
    if frames < 1 or not noise > 0 or apart < 0:
        raise BadArgument("markers need one frame or more, a noise above 0 mm, and apart from 0 mm")
    model = load_body(body)
    if not isinstance(model, SkinnedBody):
        raise BadArgument(f"markers have offsets on a SkinnedBody, and {body} is none")
    rng = np.random.default_rng(seed)
    worn = default_markers(model)
    poses = draw_poses(shipped_gaussian(), frames, rng)
    truth, observed = dressed_person(model, worn, poses, rng, noise / 1e3, missing, apart / 1e3)
    setup = marker_fit(
        observed,
        model,
        worn,
        f"A synthetic person (seed {seed}) wears {len(worn.names)} markers, up to several mm from "
        f"their nominal places, seen in {frames} frames to {noise:g} mm; {100 * missing:g} % are "
        "missing. Which shape, and which places of the markers, explain them?",
        sigma=noise / 1e3,
    )
    return replace(
        setup,
        measures=lambda values: (*true_measures(model, values, truth), *setup.measures(values)),
        synthetic=MARKERS_ARE_SYNTHETIC,
        made_of=truth,
    )


def dressed_person(
    body: SkinnedBody,
    worn: MarkerSet,
    poses: Array,
    rng: np.random.Generator,
    noise: float,
    missing: float,
    apart: float,
    placed: Placed | None = None,
) -> tuple[Values, Array]:
    """A random person in poses (T, K, 3) rad with markers: the truth, and markers (T, M, 3) m.

    Offsets are those of `placed`, or else normally distributed about the nominal ones, with a
    standard deviation of `apart` m along each axis.
    """
    T, M = len(poses), len(worn.names)
    betas = rng.normal(size=body.n_betas)
    if placed is None:
        offsets = worn.nominal + apart * rng.normal(size=worn.nominal.shape)
    else:
        offsets = placed(body, worn, betas, apart, rng)
    trans = rng.normal(size=(T, 3)) * [1.0, 0.1, 1.0]
    exact = worn.on(body).landmark(MARKERS, poses, betas, trans, offsets)
    observed = exact + noise * rng.normal(size=exact.shape)
    observed[rng.random((T, M)) < missing] = np.nan
    pose, shape, place = (block.name for block in body.blocks())
    return {pose: poses, shape: betas, place: trans, "offsets": offsets}, observed


def true_measures(body: SkinnedBody, values: Values, truth: Values) -> tuple[Measure, ...]:
    """How far the shape at rest and the offsets are from the truth, root mean squares in mm."""
    betas = body.blocks()[1].name
    difference = body.shapedirs @ (values[betas] - truth[betas])
    return (
        rms("rest shape to synthetic truth", 1e3 * np.linalg.norm(difference, axis=1)),
        rms(
            "offsets to synthetic truth",
            1e3 * np.linalg.norm(values["offsets"] - truth["offsets"], axis=1),
        ),
    )
