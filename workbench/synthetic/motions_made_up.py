"""Motions of sines, for examples and tests that need one and may not ship a recording."""

import numpy as np

from workbench.bodies import SkinnedBody
from workbench.motions import Motion

PACE = (0.3, 1.8)  # Hz, the slowest and the fastest sine


def made_up_motion(
    body: SkinnedBody, seconds: float, *, seed: int = 0, fps: float = 60.0, turn: float = 0.1
) -> Motion:
    """A body that hops, sways and moves all of its joints, each about each axis by three sines.

    `turn` is the standard deviation of each angle in rad; the root hops by about 3 cm. Nothing of
    it was recorded, and no person moves like this.
    """
    rng = np.random.default_rng(seed)
    times = np.arange(round(seconds * fps)) / fps
    shape = (body.n_joints + 1, 3, 3)  # the last one is for trans: three sines for each axis
    pace, phase = rng.uniform(*PACE, shape), rng.uniform(0, 2 * np.pi, shape)
    waves = np.sin(2 * np.pi * pace * times[:, None, None, None] + phase).sum(axis=-1)
    waves *= np.sqrt(2 / 3)  # a standard deviation of one
    pose = body.bind_pose + turn * waves[:, :-1]
    return Motion(pose, 0.03 * waves[:, -1], fps, body.joint_names, origin="made up of sines")
