"""Hands: their 21 points, the anatomical motions of their joints, and their mirror images."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.blocks import Points
from workbench.blocks.composed_points import joined
from workbench.bodies.body import Body, Landmarks
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import BadBody, NotSupported
from workbench.geometry.mirror import AXIAL, REFLECTION, Mirror, opposite

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
    available = {*body.joint_names, *(body.landmarks[TIPS].names if TIPS in body.landmarks else ())}
    if missing := [name for name in names if name not in available]:
        raise BadBody(
            f"body {body.name!r} has no {', '.join(missing[:3])}, which a hand has; say which hand "
            "of two (side='left'), take the embedded body 'hand' or 'full-hands', or give one of "
            "MANO's a landmark set called 'tips'"
        )
    symbols = pose, betas, trans
    every = [body.joint_points(*symbols), body.landmark_points(TIPS, *symbols)]
    return joined(every, names)


FLEXION, DEVIATION, TWIST = "flexion", "radial deviation", "twist"
ABDUCTION = "palmar abduction"
SIDE_PREFIXES = ("", "left_", "right_")  # before the names of a hand's joints
LEAST_BEND = np.radians(8)  # joints are inside of fingers: a smaller bend of their places is none


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
    names = set(body.joint_names)
    needed = ("wrist", *(f"{finger}{i}" for finger in FINGERS for i in (1, 2, 3)))
    return tuple(side for side in SIDE_PREFIXES if names >= {side + name for name in needed})


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
    joints = dict(zip(body.joint_names, body.joints(), strict=True))
    places = {name[len(side) :]: p for name, p in joints.items() if name.startswith(side)}
    places |= _tips(body, side, places)
    palmar, thumbward = _palm(places)
    motions: list[HandMotion] = []
    for finger in FINGERS:
        last_bone = None
        for i in (1, 2, 3):
            end = f"{finger}{i + 1}" if i < 3 else f"{finger}_tip"
            bone = _unit(places[end] - places[f"{finger}{i}"])
            towards = palmar
            if finger == "thumb" and i > 1:
                towards = places["pinky1"] - places["thumb2"]
            bends = _unit(np.cross(bone, towards))
            bent = float(
                np.arcsin(bone @ palmar)
                if last_bone is None
                else np.arctan2(bends @ np.cross(last_bone, bone), last_bone @ bone)
            )
            aside = np.cross(bends, bone)
            if aside @ np.cross(bone, thumbward) < 0:
                aside = -aside
            first = ABDUCTION if finger == "thumb" and i == 1 else FLEXION
            joint = f"{side}{finger}{i}"
            motions += [
                HandMotion(joint, first, bends, bent if abs(bent) > LEAST_BEND else 0.0),
                HandMotion(joint, DEVIATION, aside, 0.0),
                HandMotion(joint, TWIST, bone, 0.0),
            ]
            last_bone = bone
    return tuple(motions)


def _tips(body: Body, side: str, at: dict[str, Array]) -> dict[str, Array]:
    """The tips of the fingers; where there are no landmarks, the last bone goes on straight."""
    tips: dict[str, Array] = {}
    if TIPS in body.landmarks:
        tips = dict(zip(body.landmark_names(TIPS), body.landmark(TIPS), strict=True))
    return {
        f"{finger}_tip": tips.get(f"{side}{finger}_tip", 2 * at[f"{finger}3"] - at[f"{finger}2"])
        for finger in FINGERS
    }


def _palm(places: dict[str, Array]) -> tuple[Array, Array]:
    """Unit vectors out of the palm on its inner side, and in its plane towards the thumb."""
    along = _unit(places["middle1"] - places["wrist"])
    across = places["index1"] - places["pinky1"]
    thumbward = _unit(across - along * (along @ across))
    normal = np.cross(along, thumbward)
    return np.asarray(normal * np.sign(normal @ (places["thumb3"] - places["wrist"]))), thumbward


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


ROTATIONS = ("hands_mean", "hands_components")  # flat rotation vectors, one after another
SIDED = (*ROTATIONS, "hands_coeffs", "hands_deviations")  # of whole bodies, with l or r at the end
CORNERS = [0, 2, 1]  # the order in which a mirrored face has its corners
BY_CORNER = ("lmk_bary_coords", "dynamic_lmk_bary_coords", "ft")  # extras with a number for each


def mirrored(body: SkinnedBody, name: str) -> SkinnedBody:
    """The body seen in a mirror, x -> -x, under another name: every vertex, joint and shape.

    Vertices and joints keep their numbers, and faces look outwards again. Where its pose is
    theta * (1, -1, -1) and trans is reflected, its vertices are those of the body reflected, for
    all betas. Names change sides (left_index1 becomes right_index1), and so do the pose spaces of
    the hands of a whole body.

    Raises NotSupported for a body that does not have SMPL's pose features, is bound in a pose, or
    has free arrays or capsules.
    """
    if not body.is_smpl or body.bound_in is not None or body.free or body.capsules is not None:
        raise NotSupported(
            f"body {body.name!r} cannot be mirrored: only bodies with SMPL's skinning and pose "
            "features, without free arrays, capsules and a pose that they are bound in, can"
        )
    mirror = Mirror(np.arange(body.n_vertices), np.arange(body.n_joints))
    joints = body.rest_joints
    return replace(
        body,
        template=mirror.points(body.template),
        shapedirs=mirror.directions(body.shapedirs),
        posedirs=mirror.posedirs(body.posedirs),
        faces=body.faces[:, CORNERS],
        joint_names=tuple(map(opposite, body.joint_names)),
        rest_joints=None if joints is None else joints * REFLECTION,
        landmarks={
            key: Landmarks(tuple(map(opposite, some.names)), csr_array(some.regressor))
            for key, some in body.landmarks.items()
        },
        extras=_mirrored_extras(body.extras),
        name=name,
        card={**body.card, "name": name, "mirrored": f"{body.name} in a mirror, x -> -x"},
    )


def _mirrored_extras(extras: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """The pose spaces of hands in the mirror, and what is said corner by corner of faces."""
    arrays = dict(extras)
    for what in SIDED:
        for letter, other in (("", ""), ("l", "r"), ("r", "l")):
            arrays.pop(what + letter, None)
            if what + other in extras:
                rows = extras[what + other]
                arrays[what + letter] = _turned(rows) if what in ROTATIONS else rows
    corners = {key: extras[key][..., CORNERS] for key in BY_CORNER if key in extras}
    return arrays | corners


def _turned(rows: NDArray[Any]) -> NDArray[Any]:
    turned = rows.reshape(*rows.shape[:-1], -1, 3) * AXIAL
    return np.asarray(turned.reshape(rows.shape))
