"""The anatomical motions of a hand's joints: about which axes, and how far they are at rest.

A rotation vector has the axes of space, and an anatomist has others: a finger bends towards the
palm, deviates towards the thumb's side or away from it, and may twist about its own bone. These
axes follow from the places of the joints at rest, so that they are found for every body with the
joints of a hand, whichever way it lies at rest, and for a left hand as for a right one.
"""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.bodies.hand_points import FINGERS, TIPS
from workbench.errors import BadBody

FLEXION, DEVIATION, TWIST = "flexion", "radial deviation", "twist"
ABDUCTION = "palmar abduction"
SIDES = ("", "left_", "right_")  # before the names of a hand's joints
STRAIGHT = np.radians(8)  # joints are inside of fingers: a smaller bend of their places is none


@dataclass(frozen=True, eq=False)
class HandMotion:
    """One of the three motions of a joint.

    Attributes:
        joint: the name of the joint.
        motion: `flexion` (for the base of the thumb `palmar abduction`), `radial deviation`, which
            is towards the thumb's side, or `twist`.
        axis: (3,) a unit vector at rest. A positive turn about it is this motion.
        at_rest: in rad, how far the motion has gone in the zero pose. For flexion it is the angle
            between two bones, or, for a first bone, its angle to the plane of the palm. For
            deviation and twist it is 0.
    """

    joint: str
    motion: str
    axis: Array
    at_rest: float


def hands_of(body: Body) -> tuple[str, ...]:
    """The prefixes of the hands whose joints a body has: `""` for a body that is a hand."""
    known = set(body.joint_names)
    own = ("wrist", *(f"{finger}{i}" for finger in FINGERS for i in (1, 2, 3)))
    return tuple(side for side in SIDES if known >= {side + name for name in own})


def is_hand(body: Body) -> bool:
    """Whether a body is a hand alone: its root is a wrist, and fingers hang on it."""
    return body.joint_names[0] == "wrist" and "" in hands_of(body)


def hand_motions(body: Body, side: str = "") -> tuple[HandMotion, ...]:
    """The three motions of each of the 15 joints of a hand's fingers.

    The axes of a joint are at right angles: the bone, from the wrist outwards (twist); the one
    about which the bone turns to the palm (flexion); and the one about which it turns to the side
    of the thumb (deviation). The palm is the plane through wrist and middle finger that is as wide
    as the first joints of index and little finger; the thumb is on its inner side. The last two
    joints of the thumb bend towards the first joint of the little finger. A last bone ends at the
    finger's tip if the body has the landmarks `tips`, and otherwise goes on straight. `side` is
    left_ or right_ for one hand of a whole body.

    Raises BadBody for a body that has no such hand.
    """
    if side not in hands_of(body):
        raise BadBody(
            f"body {body.name!r} has no joints {side}wrist and {side}index1 to {side}thumb3, which "
            "a hand has; take the embedded body 'hand', or one of MANO's"
        )
    places = dict(zip(body.joint_names, body.joints(), strict=True))
    at = {name[len(side) :]: p for name, p in places.items() if name.startswith(side)}
    at |= _tips(body, side, at)
    palmar, thumbward = _palm(at)
    found: list[HandMotion] = []
    for finger in FINGERS:
        before = None
        for i in (1, 2, 3):
            end = f"{finger}{i + 1}" if i < 3 else f"{finger}_tip"
            bone = _unit(at[end] - at[f"{finger}{i}"])
            towards = palmar
            if finger == "thumb" and i > 1:
                towards = at["pinky1"] - at["thumb2"]
            bends = _unit(np.cross(bone, towards))
            bent = float(np.arcsin(bone @ palmar)) if before is None else _bend(before, bone, bends)
            aside = np.cross(bends, bone)
            if aside @ np.cross(bone, thumbward) < 0:
                aside = -aside
            first = ABDUCTION if finger == "thumb" and i == 1 else FLEXION
            joint = f"{side}{finger}{i}"
            found += [
                HandMotion(joint, first, bends, bent if abs(bent) > STRAIGHT else 0.0),
                HandMotion(joint, DEVIATION, aside, 0.0),
                HandMotion(joint, TWIST, bone, 0.0),
            ]
            before = bone
    return tuple(found)


def _tips(body: Body, side: str, at: dict[str, Array]) -> dict[str, Array]:
    """The tips of the fingers; where there are no landmarks, the last bone goes on straight."""
    known: dict[str, Array] = {}
    if TIPS in body.landmarks:
        known = dict(zip(body.landmark_names(TIPS), body.landmark(TIPS), strict=True))
    return {
        f"{finger}_tip": known.get(f"{side}{finger}_tip", 2 * at[f"{finger}3"] - at[f"{finger}2"])
        for finger in FINGERS
    }


def _palm(at: dict[str, Array]) -> tuple[Array, Array]:
    """Unit vectors out of the palm on its inner side, and in its plane towards the thumb."""
    along = _unit(at["middle1"] - at["wrist"])
    across = at["index1"] - at["pinky1"]
    thumbward = _unit(across - along * (along @ across))
    normal = np.cross(along, thumbward)
    return np.asarray(normal * np.sign(normal @ (at["thumb3"] - at["wrist"]))), thumbward


def _bend(before: Array, bone: Array, axis: Array) -> float:
    """The angle in rad about an axis from one bone to the next."""
    return float(np.arctan2(axis @ np.cross(before, bone), before @ bone))


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))
