"""The 21 points of a hand: 16 joints, and 5 finger tips, which are vertices of the skin."""

import casadi as cs

from workbench.blocks import Points
from workbench.blocks.composed_points import chosen, joined
from workbench.bodies.body import Body
from workbench.errors import BadBody

FINGERS = ("thumb", "index", "middle", "ring", "pinky")
HAND_POINTS = ("wrist", *(f"{f}{end}" for f in FINGERS for end in ("1", "2", "3", "_tip")))
TIPS = "tips"


def hand_points(
    body: Body, pose: cs.MX, betas: cs.MX, trans: cs.MX, side: str | None = None
) -> Points:
    """The points `HAND_POINTS` of a hand (3, 21) m: from the wrist, finger by finger, to the tips.

    This is the order of OpenPose, MediaPipe and FreiHAND. Joints and vertices are one placeholder,
    so that one residual compares them with 21 observed points. `side` is `left` or `right` for a
    body with two hands, whose points have that side in front of their names; a hand alone needs
    none. Raises BadBody for a body that has no such joints or no landmark set `tips`.
    """
    prefix = "" if side is None else f"{side}_"
    names = tuple(prefix + name for name in HAND_POINTS)
    known = {*body.joint_names, *(body.landmarks[TIPS].names if TIPS in body.landmarks else ())}
    if missing := [name for name in names if name not in known]:
        two = "left_wrist" in known and side is None
        instead = (
            "say which hand, side='left' or side='right'"
            if two
            else "take the embedded body 'hand' or 'full-hands', or give one of MANO's a landmark "
            "set called 'tips'"
        )
        raise BadBody(
            f"body {body.name!r} has no {', '.join(missing[:3])}, which a hand has; {instead}"
        )
    at = pose, betas, trans
    every = [body.joint_points(*at), body.landmark_points(TIPS, *at)]
    return joined(every, names) if side is None else chosen(joined(every), names)
