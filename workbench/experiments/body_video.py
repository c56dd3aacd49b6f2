"""A synthetic person who walks, filmed by cameras: a sequence of frames that share one shape."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Block, Values
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_skinned
from workbench.errors import BadArgument
from workbench.experiments.experiment import Measure, Setup
from workbench.experiments.keypoint_fit import landmark_set, pose_prior
from workbench.experiments.synthetic_cameras import looking_in
from workbench.experiments.synthetic_people import beginning, likely_person, polished
from workbench.geometry.camera import Camera
from workbench.problem import Problem, sequence
from workbench.residuals import gaussian, keypoints, smooth

Array = NDArray[np.float64]
SWINGS = {
    "left_hip": 0.4, "right_hip": -0.4, "left_shoulder": -0.4, "right_shoulder": 0.4,
}  # rad, forwards and backwards  # fmt: skip
PERIOD = 8  # frames of two steps
SPEED = 0.04  # m a frame
POSE_SIGMA, TRANS_SIGMA = 0.2, 0.05  # rad and m: what is ordinary from frame to frame
FILMED = (
    "the filmed body is the model itself, which swings its arms and legs, with noise in the "
    "images; nobody was filmed, and a real person is no body of the model"
)
COMPARED = ("gauss-newton", "levenberg-marquardt", "ipopt")


def body_video(
    body: str = "small",
    seed: int = 0,
    start: int = 0,
    frames: int = 8,
    cameras: int = 2,
    noise: float = 4.0,
    missing: float = 0.1,
) -> Setup:
    """Keypoints in the frames of a video, `missing` of which (a share) were not seen; noise in px.

    Pose and place are those of each frame, smooth in time; all frames share the betas. The cameras
    stand on a half circle in front of the person, who is seen from the front and the side by two.
    """
    if not 0 <= missing < 1:
        raise BadArgument(f"missing is the share of keypoints not seen, from 0 to 1, not {missing}")
    if frames < 2:
        raise BadArgument(f"a video has two frames or more, not {frames}")
    if cameras < 1:
        raise BadArgument(f"a video is seen by one camera or more, not by {cameras}")
    model = load_skinned(body)
    rng = np.random.default_rng(seed)
    truth = walk(model, rng, frames)
    pose, betas, trans = model.blocks()
    kind = landmark_set(model)
    names = model.landmark_names(kind)
    points = model.landmark_points(kind, pose.symbol, betas.symbol, trans.symbol)
    moving = zip(truth[pose.name], truth[trans.name], strict=True)
    places = np.array([model.landmark(kind, p, truth[betas.name], t) for p, t in moving])
    terms, blocks, shared = [], [], [betas.name]
    values = dict(beginning_of_all(model, seed, start, frames))
    for i in range(cameras):
        name = f"camera {i + 1}"
        camera = Camera(f"{name}/")
        numbers = camera.values(**looking_in(np.pi * i / cameras))
        pixels = np.array([camera.pixels(p, numbers) for p in places])
        observed = Block(f"{name}/observed", pixels.shape[1:], "px", names)
        confidence = Block(f"{name}/confidence", pixels.shape[1:2], "1", names)
        values |= numbers | {
            observed.name: pixels + noise * rng.standard_normal(pixels.shape),
            confidence.name: (rng.random(pixels.shape[:2]) >= missing).astype(float),
        }
        terms.append(
            keypoints(
                points, camera, observed.symbol, confidence.symbol, sigma=noise,
                name=f"keypoints({name})",
            )
        )  # fmt: skip
        blocks += [observed, confidence]
        shared += [block.name for block in camera.blocks]
    priors = (pose_prior(model), gaussian(betas.symbol, name="shape prior"))
    frame = Problem((*terms, *priors), [block.name for block in model.blocks()], blocks=blocks)
    between = (
        smooth(pose.name, sigma=POSE_SIGMA, name="smooth pose"),
        smooth(trans.name, sigma=TRANS_SIGMA, name="smooth place"),
    )
    problem = sequence([frame] * frames, shared=shared, between=between)
    how = f", from random start {start} (0.3 rad)" if start else ", from the template"
    setup = Setup(
        problem=problem,
        start=values,
        question=f"A synthetic body (seed {seed}) walks through {frames} frames, seen by {cameras} "
        f"camera{'s' * (cameras > 1)} to {noise:g} px; {100 * missing:g} % of its keypoints are "
        f"missing. Its shape is one and the same in all frames, and its motion is smooth. Which "
        f"motion is the likeliest{how}?",
        measures=lambda found: _measures(model, found, truth),
        priors=(*(prior.name for prior in priors), "smooth pose", "smooth place"),
        compared=COMPARED,
        synthetic=FILMED,
        made_of=truth,
    )
    return replace(setup, known=polished(problem, setup.start, truth))


def walk(body: SkinnedBody, rng: np.random.Generator, frames: int) -> Values:
    """Pose (T, K, 3), betas (B,) and trans (T, 3) of a likely person who goes forwards.

    Hips and shoulders swing, where the body's joints have SMPL's names.
    """
    pose, _, trans = (block.name for block in body.blocks())
    person = likely_person(body, rng)
    phase = np.sin(2 * np.pi * np.arange(frames) / PERIOD)
    poses = np.repeat(person[pose][None], frames, axis=0)
    for joint, angle in SWINGS.items():
        if joint in body.joint_names:
            poses[:, body.joint_names.index(joint), 0] += angle * phase
    steps = SPEED * (np.arange(frames) - (frames - 1) / 2)
    return person | {pose: poses, trans: person[trans] + steps[:, None] * [0.0, 0.0, 1.0]}


def beginning_of_all(body: SkinnedBody, seed: int, start: int, frames: int) -> Values:
    """One start for every frame; see `beginning`."""
    pose, _, trans = (block.name for block in body.blocks())
    one = beginning(body, seed, start, 0.3)
    return one | {name: np.repeat(one[name][None], frames, axis=0) for name in (pose, trans)}


def _measures(body: SkinnedBody, values: Mapping[str, Array], truth: Values) -> tuple[Measure, ...]:
    pose, betas, trans = (block.name for block in body.blocks())

    def joints(found: Mapping[str, Array]) -> Array:
        moving = zip(found[pose], found[trans], strict=True)
        return np.array([body.joints(p, found[betas], t) for p, t in moving])

    off = 1e3 * np.linalg.norm(joints(values) - joints(truth), axis=2)  # (T, K) mm
    wrong = values[betas] - truth[betas]
    return (
        Measure("joint to synthetic truth, rms", float(np.sqrt(np.mean(off**2))), "mm"),
        Measure("joint to synthetic truth, worst frame", float(off.mean(axis=1).max()), "mm"),
        Measure("betas to synthetic truth, rms", float(np.sqrt(np.mean(wrong**2))), "sd"),
    )
