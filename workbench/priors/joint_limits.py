"""How far joints turn, as bounds of a body's pose."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Block
from workbench.errors import BadArgument, check_known

KNOWN = ("anatomical", "recorded")


@dataclass(frozen=True)
class JointLimits:
    """How far joints turn about each axis, as bounds of the entries of rotation vectors.

    A limit that is infinite or missing is no limit. Each range is that of a turn about its axis
    alone, from the T-pose; for turns about several axes at once the box is an approximation.

    Attributes:
        limits: (lower, upper) in rad, by joint and axis.
        sources: where the limits are from.
    """

    limits: Mapping[tuple[str, int], tuple[float, float]]
    sources: Mapping[str, str]

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
        lower, upper = np.full(pose.shape, -np.inf), np.full(pose.shape, np.inf)
        found = False
        for (joint, axis), (low, high) in self.limits.items():
            if joint in joints:
                row, found = joints.index(joint), True
                lower[row, axis], upper[row, axis] = low, high
        if not found:
            known = ", ".join(sorted({joint for joint, _ in self.limits}))
            raise BadArgument(f"no joint of block {pose.name!r} is among those known: {known}")
        return lower, upper

    def widened(self, margin: float) -> "JointLimits":
        """These limits, with each end farther out by `margin` rad."""
        wider = {at: (low - margin, high + margin) for at, (low, high) in self.limits.items()}
        return JointLimits(wider, self.sources)

    def over(self, others: "JointLimits") -> "JointLimits":
        """These limits, completed by the others where these have none."""
        both = dict(others.limits)
        for at, (low, high) in self.limits.items():
            below, above = both.get(at, (-np.inf, np.inf))
            both[at] = (
                low if np.isfinite(low) else min(below, high),
                high if np.isfinite(high) else max(above, low),
            )
        return JointLimits(both, {**others.sources, **self.sources})


def joint_limits(name: str = "anatomical") -> JointLimits:
    """The joint limits of this name.

    `anatomical`: normal ranges of motion as measured on people, for hips, knees, ankles,
    shoulders, elbows and wrists. `recorded`: the extremes in the motion capture that the pose
    prior was learned from, for every joint that it moves. Raises UnknownName.

    Sources and licences: `workbench/data/joint_limits/PROVENANCE.md`.
    """
    check_known("set of joint limits", name, KNOWN)
    text = (files("workbench") / "data" / "joint_limits" / f"{name}.json").read_text("utf-8")
    content = json.loads(text)
    limits = {
        (row["joint"], "xyz".index(row["axis"])): (
            -np.inf if row["lower"] is None else float(np.radians(row["lower"])),
            np.inf if row["upper"] is None else float(np.radians(row["upper"])),
        )
        for row in content["limits"]
    }
    return JointLimits(limits, content["sources"])
