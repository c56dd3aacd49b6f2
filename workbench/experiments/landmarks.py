"""Shape from 3D joints alone: what 24 points say about ten numbers, and what they leave open."""

import numpy as np

from workbench.blocks import Block, Values
from workbench.bodies.catalogue import load_skinned
from workbench.errors import BadArgument
from workbench.experiments.correspondences import MADE_OF_THE_MODEL
from workbench.experiments.experiment import Measure, Setup
from workbench.experiments.keypoint_fit import pose_prior
from workbench.problem import Problem
from workbench.residuals import gaussian
from workbench.residuals import landmarks as seen_in_space


def shape_from_landmarks(
    body: str = "default", seed: int = 0, pose_sigma: float = 0.3, noise: float = 0.01
) -> Setup:
    """A posed and shaped body of the model (synthetic): its joints in space, give or take `noise`.

    `pose_sigma` in rad, `noise` in m, the truth kept for the measures.
    """
    if not noise > 0:
        raise BadArgument(f"noise must be above zero metres, not {noise}; it is the sigma as well")
    model = load_skinned(body)
    rng = np.random.default_rng(seed)
    pose, betas, trans = model.blocks()
    truth = {
        pose.name: pose_sigma * rng.standard_normal((model.n_joints, 3)),
        betas.name: rng.standard_normal(model.n_betas),
        trans.name: np.zeros(3),
    }
    joints = model.joints(*truth.values())
    observed = Block("observed", joints.shape, "m", model.joint_names)
    points = model.joint_points(pose.symbol, betas.symbol, trans.symbol)
    data = seen_in_space(points, observed.symbol, sigma=noise, name="joints")
    priors = (gaussian(betas.symbol, name="shape prior"), pose_prior(model))
    surface = model.vertices(*truth.values())

    def measures(values: Values) -> tuple[Measure, ...]:
        given = [values[block.name] for block in model.blocks()]
        off = 1e3 * np.linalg.norm(model.joints(*given) - joints, axis=1)
        skin = 1e3 * np.linalg.norm(model.vertices(*given) - surface, axis=1)
        wrong = values[betas.name] - truth[betas.name]
        return (
            Measure("joint to synthetic truth, rms", float(np.sqrt(np.mean(off**2))), "mm"),
            Measure("vertex to synthetic truth, rms", float(np.sqrt(np.mean(skin**2))), "mm"),
            Measure("betas to synthetic truth, rms", float(np.sqrt(np.mean(wrong**2))), "sd"),
        )

    return Setup(
        problem=Problem([data, *priors], [block.name for block in model.blocks()],
                        blocks=[observed]),
        start=model.start() | {
            observed.name: joints + noise * rng.standard_normal(joints.shape)
        },
        question=f"The {model.n_joints} joints of a body of the model (synthetic; pose "
        f"{pose_sigma} rad, shape 1 sd, seed {seed}) are known to {1e3 * noise:g} mm. What do they "
        "say about its shape, and what do they leave open?",
        body=model,
        truth=surface,
        measures=measures,
        priors=tuple(prior.name for prior in priors),
        compared=("gauss-newton", "levenberg-marquardt", "ipopt"),
        synthetic=MADE_OF_THE_MODEL,
        made_of=truth,
    )  # fmt: skip
