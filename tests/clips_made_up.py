"""Motions of a body through poses drawn from the shipped priors; nobody was recorded for them."""

from dataclasses import replace

import numpy as np

import workbench as wb
from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.bodies.spaces import pose_space
from workbench.priors.poses import shipped_mixture

EVERY = 10  # frames from one drawn pose to the next
COMPONENTS = 6  # of the poses of a hand


def clip(body: Body, frames: int, seed: int = 0) -> wb.Motion:
    """A motion through poses that are drawn, 30 frames a second, ten from one to the next.

    Joints of SMPL follow the mixture learned from recorded poses, and fingers the pose space of
    the embedded hands; other joints turn by about a tenth of a radian. The shape is drawn as well.
    """
    rng, n = np.random.default_rng(seed), frames // EVERY + 2
    prior = shipped_mixture()
    keys, names = prior.draw(n, rng), list(prior.joint_names)
    pose: Array = rng.normal(scale=0.1, size=(n, body.n_joints, 3))
    pose[:, 0] = np.cumsum(rng.normal(scale=0.3, size=(n, 3)), axis=0)
    for k, name in enumerate(body.joint_names):
        if name in names:
            pose[:, k] = keys[:, 1 + names.index(name)]
    for side, which in (("left", "hand-left"), ("right", "hand")):
        if f"{side}_index1" in body.joint_names:
            hand = wb.load_body(which)
            space = pose_space(hand, COMPONENTS)
            drawn = rng.normal(size=(n, COMPONENTS)) * space.deviations
            fingers = space.poses(hand, drawn)
            for k, name in enumerate(hand.joint_names[1:], start=1):
                pose[:, body.joint_names.index(f"{side}_{name}")] = fingers[:, k]
    trans = np.cumsum(rng.normal(scale=0.1, size=(n, 3)), axis=0) + [0, 0.9, 0]
    fps = 30.0 / EVERY
    found = wb.Motion(pose, trans, fps, tuple(body.joint_names), rng.normal(size=body.n_betas))
    return replace(found.resampled(30.0)[:frames], origin="made up")
