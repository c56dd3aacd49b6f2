"""Elbows and knees that should not bend backwards: SMPLify's E_a."""

from collections.abc import Mapping
from typing import NamedTuple

import casadi as cs

from workbench.blocks import Block
from workbench.errors import BadResidual, some_of
from workbench.residuals.residual import Residual


class Hinge(NamedTuple):
    """The axis of a rotation vector about which a joint bends, and the sign of bending backwards.

    Attributes:
        axis: 0, 1 or 2, for x, y or z.
        backwards: 1 if a positive angle bends the joint backwards, -1 if a negative one does.
    """

    axis: int
    backwards: int


HINGES: Mapping[str, Hinge] = {
    "left_elbow": Hinge(1, 1),
    "right_elbow": Hinge(1, -1),
    "left_knee": Hinge(0, -1),
    "right_knee": Hinge(0, -1),
}  # of bodies with SMPL's joints: entries 55, 58, 12 and 15 of the pose


def bending(
    pose: Block,
    hinges: Mapping[str, Hinge] = HINGES,
    *,
    sigma: float = 1.0,
    name: str = "bending",
) -> Residual:
    """exp(s theta) for the angle theta of each hinge joint, where s theta > 0 bends it backwards.

    The cost is 1/2 sum of exp(2 s theta) / sigma^2, which grows quickly for a joint that bends
    backwards and is nearly 0 for one that bends as it should. It is E_a of SMPLify (Bogo et al.,
    Keep it SMPL, 2016, section 3.3), whose code has the residual exp(s theta) as well, and thus
    the energy exp(2 s theta), while its text writes exp(theta) with theta < 0 for natural bending.
    A straight joint has the value 1; `sigma` has no unit.

    `pose` is a block (K, 3) rad whose rows are labelled by joints. Raises BadResidual if it is
    none, or has none of the hinges' joints.
    """
    joints = pose.labels or ()
    if len(pose.shape) != 2 or pose.shape[1] != 3 or not joints:
        raise BadResidual(
            f"block {pose.name!r} {pose.shape} is no pose: rotation vectors (K, 3) whose rows are "
            "labelled by joints; give the first of body.blocks()"
        )
    present = {joint: hinge for joint, hinge in hinges.items() if joint in joints}
    if not present:
        raise BadResidual(
            f"residual {name!r} is about the joints {some_of(sorted(hinges))}, and block "
            f"{pose.name!r} has none of them; give the hinges of this body"
        )
    labels = tuple(present)
    return Residual(name, bent_back(pose, present), sigma, labels=labels, blocks=(pose,))


def bent_back(pose: Block, hinges: Mapping[str, Hinge]) -> cs.MX:
    """exp(s theta) of each of these hinges, (H, 1); all of them are among the pose's labels."""
    joints = pose.labels or ()
    angles = [
        hinge.backwards * pose.symbol[hinge.axis, joints.index(joint)]
        for joint, hinge in hinges.items()
    ]
    return cs.exp(cs.vertcat(*angles))
