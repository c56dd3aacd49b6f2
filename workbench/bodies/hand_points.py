"""The 21 points of a hand: 16 joints, and 5 finger tips, which are vertices of the skin."""

import casadi as cs

from workbench.blocks import Points
from workbench.blocks.joined_points import joined
from workbench.bodies.body import Body
from workbench.errors import BadBody

FINGERS = ("thumb", "index", "middle", "ring", "pinky")
HAND_POINTS = ("wrist", *(f"{f}{end}" for f in FINGERS for end in ("1", "2", "3", "_tip")))
TIPS = "tips"


def hand_points(body: Body, pose: cs.MX, betas: cs.MX, trans: cs.MX) -> Points:
    """The points `HAND_POINTS` of a hand (3, 21) m: from the wrist, finger by finger, to the tips.

    This is the order of OpenPose, MediaPipe and FreiHAND. Joints and vertices are one placeholder,
    so that one residual compares them with 21 observed points. Raises BadBody for a body that has
    no such joints or no landmark set `tips`.
    """
    known = {*body.joint_names, *(body.landmarks[TIPS].names if TIPS in body.landmarks else ())}
    if missing := [name for name in HAND_POINTS if name not in known]:
        raise BadBody(
            f"body {body.name!r} has no {', '.join(missing[:3])}, which a hand has; take the "
            "embedded body 'hand', or give one of MANO's a landmark set called 'tips'"
        )
    at = pose, betas, trans
    return joined([body.joint_points(*at), body.landmark_points(TIPS, *at)], HAND_POINTS)
