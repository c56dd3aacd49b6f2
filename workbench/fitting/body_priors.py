"""The priors on a body's pose and shape that decide what observations leave open."""

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.bodies.hand_axes import hands_of
from workbench.bodies.pose_space import has_pose_space, pose_space
from workbench.priors.hand_limits import hand_limits
from workbench.priors.poses import shipped_gaussian
from workbench.residuals import Residual, gaussian

SMPL_JOINTS = 24  # of the bodies for which the pose prior was learned
BESIDE = 0.05  # rad, beside what a pose space says: nobody's poses are exactly in it


def pose_prior(body: Body, pose: cs.MX | None = None) -> Residual:
    """A Gaussian on all joint rotations but the root's: that of `pose_gaussian`.

    `pose` (3, K) rad is the symbol of one of several poses; without it, that of the body's blocks.
    """
    pose = body.blocks()[0].symbol if pose is None else pose
    mean, covariance = pose_gaussian(body)
    return gaussian(pose[:, 1:], mean=mean, covariance=covariance, unit="rad", name="pose prior")


def pose_gaussian(body: Body) -> tuple[Array, Array]:
    """The mean (K - 1, 3) rad of `pose_prior`, and a variance or covariance in rad^2.

    For SMPL's 24 joints both were learned from motion capture: `data/poses/cmu_gaussian.npz`, and
    PROVENANCE.md beside it names the source. A body with a pose space, such as a hand, has the
    space's Gaussian, and 0.05 rad of standard deviation about each axis beside it. Any other body
    gets 0.5 rad about its rest pose.
    """
    if body.n_joints == SMPL_JOINTS:
        learned = shipped_gaussian()
        return learned.mean, learned.covariance
    if has_pose_space(body):
        space = pose_space(body)
        rows = space.deviations[:, None] * space.components.reshape(space.n_components, -1)
        return space.mean, rows.T @ rows + BESIDE**2 * np.eye(rows.shape[1])
    return body.bind_pose[1:], np.array(0.25)


def shape_prior(body: Body) -> Residual:
    """A standard normal prior on the shape coefficients betas."""
    return gaussian(body.blocks()[1].symbol, name="shape prior")


def usual_priors(body: Body, pose: cs.MX | None = None) -> tuple[Residual, ...]:
    """The priors of a body's fits: on pose and shape, and the limits of the joints of its hands.

    `pose` is as for `pose_prior`.
    """
    limited = (hand_limits().residual(body, pose),) if hands_of(body) else ()
    return pose_prior(body, pose), shape_prior(body), *limited
