"""How far joints turn: bounds of a body's pose, and a residual for the joints of hands."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks import Block
from workbench.bodies.body import Body
from workbench.bodies.hands import hand_motions, hands_of
from workbench.errors import BadArgument, BadBody, check_known
from workbench.residuals import Residual, limits

LIMIT_SETS = ("anatomical", "recorded")
SIGMA = 0.1  # rad: limits of hands are averages over people, and nobody's own


@dataclass(frozen=True)
class JointLimits:
    """How far joints turn about each axis, as bounds of the entries of rotation vectors.

    A limit that is infinite or missing is no limit. Each range is that of a turn about its axis
    alone, from the T-pose; for turns about several axes at once the box is an approximation.
    """

    # (lower, upper) in rad, by joint and axis
    limits: Mapping[tuple[str, int], tuple[float, float]]
    sources: Mapping[str, str]  # where the limits are from

    def bounds(self, pose: Block) -> tuple[Array, Array]:
        """Lower and upper (K, 3) rad for a block of rotation vectors labelled by joints.

        As `Problem(..., bounds={"pose": limits.bounds(pose)})`. Raises BadArgument for a block
        that is not such a pose, or has none of these joints.
        """
        joints = pose.labels or ()
        if len(pose.shape) != 2 or pose.shape[-1] != 3 or not joints:
            raise BadArgument(
                f"block {pose.name!r} {pose.shape} is no pose: rotation vectors (K, 3) whose rows "
                "are labelled with names of joints; give the first of body.blocks()"
            )
        known = {joint for joint, _ in self.limits}
        if known.isdisjoint(joints):
            raise BadArgument(
                f"no joint of block {pose.name!r} is among those known: {', '.join(sorted(known))}"
            )
        lower, upper = np.full(pose.shape, -np.inf), np.full(pose.shape, np.inf)
        for (joint, axis), ends in self.limits.items():
            if joint in joints:
                row = joints.index(joint)
                lower[row, axis], upper[row, axis] = ends
        return lower, upper


def _content(name: str) -> Any:
    path = files("workbench") / "data" / "joint_limits" / f"{name}.json"
    return json.loads(path.read_text("utf-8"))


def joint_limits(name: str = "anatomical") -> JointLimits:
    """The joint limits of this name.

    `anatomical`: normal ranges of motion as measured on people, for hips, knees, ankles,
    shoulders, elbows and wrists. `recorded`: the extremes in the motion capture that the pose
    prior was learned from, for every joint that it moves. Raises UnknownName.

    Sources and licences: `workbench/data/joint_limits/PROVENANCE.md`.
    """
    check_known("set of joint limits", name, LIMIT_SETS)
    content = _content(name)
    limits = {
        (row["joint"], "xyz".index(row["axis"])): (
            -np.inf if row["lower"] is None else float(np.radians(row["lower"])),
            np.inf if row["upper"] is None else float(np.radians(row["upper"])),
        )
        for row in content["limits"]
    }
    return JointLimits(limits, content["sources"])


@dataclass(frozen=True)
class HandLimits:
    """How far each joint of a hand turns about its anatomical axes.

    The angle of a motion is a . theta + a0, with the rotation vector theta of the joint, the axis a
    of the motion and its angle a0 at rest (`hand_motions`). For turns about one axis alone this is
    exact, as the measured ranges are; for several together it is an approximation.
    """

    # (lower, upper) in rad, by joint (without a side) and motion
    limits: Mapping[tuple[str, str], tuple[float, float]]
    sources: Mapping[str, str]  # where the limits are from

    def residual(
        self,
        body: Body,
        pose: cs.MX | None = None,
        *,
        sigma: float = SIGMA,
        name: str = "hand limits",
    ) -> Residual:
        """How far each motion of the body's hands is beyond its limits, in rad.

        `pose` (3, K) is an expression, such as that of a `PoseSpace`; without it, the symbol of the
        body's block. Raises BadBody for a body without hands.
        """
        theta = body.blocks()[0].symbol if pose is None else pose
        sides = hands_of(body)
        if not sides:
            raise BadBody(
                f"body {body.name!r} has no hand with 15 joints of fingers, whose limits are known;"
                " take the embedded body 'hand', or one of MANO's"
            )
        angles, ranges, labels = [], [], []
        for side in sides:
            for motion in hand_motions(body, side):
                bounds = self.limits.get((motion.joint[len(side) :], motion.motion))
                if bounds is not None:
                    turn = theta[:, body.joint_names.index(motion.joint)]
                    angles.append(cs.dot(cs.DM(motion.axis), turn) + motion.at_rest)
                    labels.append(f"{motion.joint}, {motion.motion}")
                    ranges.append(bounds)
        lower, upper = np.array(ranges).T
        return limits(
            cs.vertcat(*angles),
            lower,
            upper,
            sigma=sigma,
            name=name,
            unit="rad",
            labels=tuple(labels),
        )


def hand_limits() -> HandLimits:
    """Normal ranges of motion of the joints of the fingers, as measured on people.

    That fingers hardly twist, and that their last two joints hardly move aside, is assumed: these
    ranges are 10 or 20 degrees to either side. For the base of the thumb only palmar abduction has
    limits, because its other motions are measured in a plane that moves with it. Sources:
    `workbench/data/joint_limits/PROVENANCE.md`.
    """
    content = _content("hand")
    ends = {
        (row["joint"], row["motion"]): (np.radians(row["lower"]), np.radians(row["upper"]))
        for row in content["limits"]
    }
    return HandLimits(ends, content["sources"])
