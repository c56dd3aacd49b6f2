"""The priors on a body's pose and shape that decide what observations leave open."""

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.priors.poses import shipped_gaussian
from workbench.residuals import Residual, gaussian

SMPL_JOINTS = 24  # of the bodies for which the pose prior was learned


def pose_prior(body: Body, pose: cs.MX | None = None) -> Residual:
    """A Gaussian on all joint rotations but the root's, learned from motion capture.

    `data/poses/cmu_gaussian.npz` holds it, and PROVENANCE.md beside it names the source. A body
    that has not SMPL's 24 joints gets a standard deviation of 0.5 rad about its rest pose instead.
    `pose` (3, K) rad is the symbol of one of several poses; without it, that of the body's blocks.
    """
    pose = body.blocks()[0].symbol if pose is None else pose
    mean, covariance = pose_gaussian(body)
    return gaussian(pose[:, 1:], mean=mean, covariance=covariance, unit="rad", name="pose prior")


def pose_gaussian(body: Body) -> tuple[Array, Array]:
    """The mean (K - 1, 3) rad of `pose_prior`, and a variance or covariance in rad^2."""
    if body.n_joints != SMPL_JOINTS:
        return body.bind_pose[1:], np.array(0.25)
    learned = shipped_gaussian()
    return learned.mean, learned.covariance


def shape_prior(body: Body) -> Residual:
    """A standard normal prior on the shape coefficients betas."""
    return gaussian(body.blocks()[1].symbol, name="shape prior")
