"""The priors on a body's pose and shape that decide what observations leave open."""

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.bodies.pose_space import pose_space
from workbench.priors.poses import shipped_gaussian
from workbench.residuals import Residual, gaussian

SMPL_JOINTS = 24  # of the bodies for which the pose prior was learned
TO_THE_WRISTS = 21  # of them, without the root; what is left are fingers as a whole
OTHERS, FINGERS = 0.5**2, 0.1**2  # rad^2: joints of which nothing is known; what no synergy moves


def pose_prior(body: Body, pose: cs.MX | None = None) -> Residual:
    """A Gaussian on all joint rotations but the root's, learned from motion capture.

    `data/poses/cmu_gaussian.npz` holds it, and PROVENANCE.md beside it names the source. See
    `pose_gaussian` for joints that were not recorded, such as fingers, and for other bodies.
    `pose` (3, K) rad is the symbol of one of several poses; without it, that of the body's blocks.
    """
    pose = body.blocks()[0].symbol if pose is None else pose
    mean, covariance = pose_gaussian(body)
    return gaussian(pose[:, 1:], mean=mean, covariance=covariance, unit="rad", name="pose prior")


def pose_gaussian(body: Body) -> tuple[Array, Array]:
    """The mean (K - 1, 3) rad of `pose_prior`, and a variance or covariance in rad^2.

    A body that has the joints of SMPL down to the wrists, such as one of SMPL-H, gets what was
    learned for these; its fingers get the Gaussian of its pose space, with 0.1 rad more about every
    axis, and all others a standard deviation of 0.5 rad about the rest pose. Every other body gets
    that for all of its joints.
    """
    learned = shipped_gaussian()
    if body.n_joints == SMPL_JOINTS:
        return learned.mean, learned.covariance
    names = body.joint_names[1:]
    if not {*learned.joint_names[:TO_THE_WRISTS]} <= {*names}:
        return body.bind_pose[1:], np.array(OTHERS)
    mean, covariance = body.bind_pose[1:].copy(), OTHERS * np.eye(3 * len(names))
    recorded = learned.joint_names[:TO_THE_WRISTS]
    _place(mean, covariance, names, recorded, learned.mean, learned.covariance)
    if {"hands_meanl", "hands_meanr"} <= body.extras.keys():
        space = pose_space(body)
        rows = space.components.reshape(space.n_components, -1)
        spread = (rows.T * space.deviations**2) @ rows + FINGERS * np.eye(rows.shape[1])
        _place(mean, covariance, names, space.joints, space.mean.ravel(), spread)
    return mean, covariance


def _place(
    mean: Array,
    covariance: Array,
    names: tuple[str, ...],
    some: tuple[str, ...],
    their_mean: Array,
    theirs: Array,
) -> None:
    """Write the Gaussian of some of the joints, the first in their own, to where they stand."""
    joints = np.array([names.index(name) for name in some])
    numbers = (3 * joints[:, None] + np.arange(3)).ravel()
    n = len(numbers)
    mean[joints] = their_mean[:n].reshape(-1, 3)
    covariance[np.ix_(numbers, numbers)] = theirs[:n, :n]


def shape_prior(body: Body) -> Residual:
    """A standard normal prior on the shape coefficients betas."""
    return gaussian(body.blocks()[1].symbol, name="shape prior")
