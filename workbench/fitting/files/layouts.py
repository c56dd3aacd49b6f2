"""The names of the keypoints of detectors, and the keys under which files store them.

Hands have the names of SMPL-H's joints where these are the same points: `left_index1` is the
knuckle. Faces are numbered; no body of the package has landmarks for them.
"""

import re
from collections.abc import Iterable

from workbench.bodies.hands import HAND_POINTS
from workbench.fitting.observations import COCO, FEET, HEAD, LIMBS, SIDES

Names = tuple[str, ...]

_ARMS, _LEGS = (
    tuple(f"{side}_{part}" for side in ("right", "left") for part in parts)
    for parts in (LIMBS[:3], LIMBS[3:])
)
_EYES_AND_EARS = tuple(f"{side}_{part}" for part in HEAD for side in ("right", "left"))
OPENPOSE_25 = ("nose", "neck", *_ARMS, "mid_hip", *_LEGS, *_EYES_AND_EARS, *FEET)
OPENPOSE_18 = tuple(name for name in OPENPOSE_25[:19] if name != "mid_hip")


def hand(side: str) -> Names:
    """The 21 points of a hand, from its root outwards, in the order of OpenPose and COCO."""
    fingers = ("thumb", "index", "middle", "ring", "pinky")
    tips = ("1", "2", "3", "_tip")
    return (f"{side}_hand_root", *(f"{side}_{finger}{i}" for finger in fingers for i in tips))


def face(count: int) -> Names:
    """The names of a face's `count` points: 68, or 70 with OpenPose's two pupils."""
    return tuple(f"face_{i}" for i in range(count))


HANDS = (hand("left"), hand("right"))
WHOLE_BODY = (*COCO, *FEET, *face(68), *HANDS[0], *HANDS[1])
_TOES_AND_HEELS = tuple(
    f"{side}_{part}" for part in ("big_toe", "small_toe", "heel") for side in SIDES
)
HALPE_26 = (*COCO, "head_top", "neck", "mid_hip", *_TOES_AND_HEELS)  # AlphaPose (Fang et al. 2022)
HALPE_136 = (*HALPE_26, *face(68), *HANDS[0], *HANDS[1])
OPENPOSE_135 = (  # whose hands have no root, which is the wrist
    *(*COCO, "neck", "head_top", *FEET),
    *(*HANDS[0][1:], *HANDS[1][1:], *face(70)),
)
MEDIAPIPE_33 = (  # BlazePose (Bazarevsky et al. 2020); its points of a hand are knuckles
    "nose",
    *(f"{side}_eye{place}" for side in SIDES for place in ("_inner", "", "_outer")),
    *(f"{side}_ear" for side in SIDES),
    *(f"{side}_mouth" for side in SIDES),
    *(f"{side}_{part}" for part in LIMBS[:3] for side in SIDES),
    *(f"{side}_{part}" for part in ("pinky1", "index1", "thumb2") for side in SIDES),
    *(f"{side}_{part}" for part in (*LIMBS[3:], "heel", "foot_index") for side in SIDES),
)


def _sapiens_hand(side: str) -> Names:
    """A hand from the tip of each finger to its knuckle, and the wrist, as Goliath orders them."""
    fingers = hand(side)[1:]
    ordered = tuple(name for f in range(0, 20, 4) for name in reversed(fingers[f : f + 4]))
    return (*ordered, f"{side}_wrist")


SAPIENS_308 = (  # Goliath's points (Khirodkar et al., Sapiens, 2024)
    *(name for name in COCO if "wrist" not in name),
    *FEET,
    *(*_sapiens_hand("right"), *_sapiens_hand("left")),
    *(f"{side}_{part}" for part in ("olecranon", "cubital_fossa", "acromion") for side in SIDES),
    "neck",
    *face(238),
)

# the names of a person's points by their number, where files have none
BODIES: dict[int, Names] = {
    len(names): names
    for names in (
        *(COCO, OPENPOSE_18, HAND_POINTS, COCO + FEET, OPENPOSE_25, HALPE_26, MEDIAPIPE_33),
        *(SAPIENS_308[:70], WHOLE_BODY, OPENPOSE_135, HALPE_136, SAPIENS_308),  # 70: SAM 3D Body's
    )
}
PARTS: dict[str, dict[int, Names]] = {  # keys beside those of the body, and names by their number
    key: names
    for keys, names in (
        ("hand_left_keypoints_2d hand_left_keypoints lefthand_kpts handl2d", {21: HANDS[0]}),
        ("hand_right_keypoints_2d hand_right_keypoints righthand_kpts handr2d", {21: HANDS[1]}),
        (
            "face_keypoints_2d face_keypoints face_kpts face2d",
            {count: face(count) for count in (68, 70)},
        ),
        ("foot_kpts", {6: FEET}),
    )
    for key in keys.split()
}
KNOWN = {*(name for names in BODIES.values() for name in names), *HANDS[0], *HANDS[1]}
ALIASES = {"pelvis": "mid_hip", "hip": "mid_hip", "hips": "mid_hip", "top_of_head": "head_top"}


def _plain(name: str) -> str:
    return re.sub(r"[\W_]", "", name).lower()


BY_PLAIN_NAME = {_plain(alias): name for alias, name in ALIASES.items()} | {
    form: name
    for name in sorted(KNOWN)
    for form in (
        _plain(name),
        *(_plain(name.replace(side, side[0], 1)) for side in SIDES if name.startswith(side)),
    )
}


def keypoint_name(name: object) -> str:
    """What the package calls a keypoint: `left_big_toe` for LBigToe, `left-big-toe`, leftBigToe.

    A name that it does not know stays as it is.
    """
    text = str(name)[:100]
    return BY_PLAIN_NAME.get(_plain(text), text)


KEYPOINT_SCHEMAS: dict[str, Names] = {  # the names of the points of each schema, in its order
    "COCO 17": COCO,
    "COCO 23, with feet": COCO + FEET,
    "COCO-WholeBody 133": WHOLE_BODY,
    "OpenPose COCO 18": OPENPOSE_18,
    "OpenPose BODY_25": OPENPOSE_25,
    "OpenPose BODY_135": OPENPOSE_135,
    "OpenPose left hand 21": HANDS[0],
    "OpenPose right hand 21": HANDS[1],
    "OpenPose face 70": face(70),
    "Halpe 26 (AlphaPose)": HALPE_26,
    "Halpe 136 (AlphaPose)": HALPE_136,
    "MediaPipe pose 33": MEDIAPIPE_33,
    "Sapiens 308": SAPIENS_308,
    "SAM 3D Body 70": SAPIENS_308[:70],
    "MediaPipe left hand 21": HANDS[0],
    "MediaPipe right hand 21": HANDS[1],
    "a hand 21, of either side": HAND_POINTS,
}


def counted_by_part(names: Iterable[str]) -> str:
    """Keypoints by part, for a sentence: `21 of the left hand, 68 of the face, neck, mid_hip`."""
    parts: dict[str, list[str]] = {"left hand": [], "right hand": [], "face": [], "": []}
    for name in names:
        side = next((side for side in SIDES if name in hand(side)), "")
        parts[f"{side} hand" if side else "face" if name.startswith("face_") else ""].append(name)
    rest = parts.pop("")
    return ", ".join([*(f"{len(own)} of the {what}" for what, own in parts.items() if own), *rest])
