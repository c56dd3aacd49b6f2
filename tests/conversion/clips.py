"""Short motions of a body, drawn from the shipped prior of poses; nobody was recorded for them."""

from dataclasses import replace

import numpy as np

import workbench as wb
from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.priors.poses import shipped_mixture


def clip(body: Body, frames: int = 8, seed: int = 0, betas: float = 1.0) -> wb.Motion:
    """A motion through random poses, ten frames from one to the next, 30 frames a second.

    Joints that the prior does not know turn by about a tenth of a radian.
    """
    rng, n = np.random.default_rng(seed), frames // 10 + 2
    prior = shipped_mixture()
    keys, names = prior.draw(n, rng), list(prior.joint_names)
    pose: Array = rng.normal(scale=0.1, size=(n, body.n_joints, 3))
    pose[:, 0] = rng.normal(scale=0.3, size=(n, 3))
    for k, name in enumerate(body.joint_names):
        if name in names:
            pose[:, k] = keys[:, 1 + names.index(name)]
    trans = rng.normal(scale=0.2, size=(n, 3)) + [0, 0.9, 0]
    shape = betas * rng.normal(size=body.n_betas)
    found = wb.Motion(pose, trans, 3.0, tuple(body.joint_names), shape).resampled(30)[:frames]
    return replace(found, origin="made up")
