"""What detectors call the keypoints that they write without names, part by part of a person.

Hands have the names of SMPL-H's joints where these are the same points: `left_index1` is the
knuckle. Faces are numbered; no body of the package has landmarks for them.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from workbench.experiments.observations import COCO, FEET

Names = tuple[str, ...]

_LIMBS = ("shoulder", "elbow", "wrist")
_ARMS = tuple(f"{side}_{part}" for side in ("right", "left") for part in _LIMBS)
OPENPOSE_25 = (
    "nose", "neck", *_ARMS, "mid_hip", "right_hip", "right_knee", "right_ankle", "left_hip",
    "left_knee", "left_ankle", "right_eye", "left_eye", "right_ear", "left_ear",
    "left_big_toe", "left_small_toe", "left_heel", "right_big_toe", "right_small_toe",
    "right_heel",
)  # fmt: skip
OPENPOSE_18 = (
    "nose", "neck", *_ARMS, "right_hip", "right_knee", "right_ankle", "left_hip", "left_knee",
    "left_ankle", "right_eye", "left_eye", "right_ear", "left_ear",
)  # fmt: skip


def hand(side: str) -> Names:
    """The 21 points of a hand, from its root outwards, as OpenPose and COCO-WholeBody have them."""
    fingers = ("thumb", "index", "middle", "ring", "pinky")
    tips = ("1", "2", "3", "_tip")
    return (f"{side}_hand_root", *(f"{side}_{finger}{i}" for finger in fingers for i in tips))


def face(count: int) -> Names:
    """68 points, which OpenPose's two pupils follow."""
    return tuple(f"face_{i}" for i in range(count))


HANDS = (hand("left"), hand("right"))
WHOLE_BODY = (*COCO, *FEET, *face(68), *HANDS[0], *HANDS[1])


@dataclass(frozen=True)
class Layout:
    """Where a kind of file has the points of a person, by key and number of points."""

    main: str  # the key without which there is nobody
    bodies: Mapping[int, Names]  # what `main` may hold
    parts: Mapping[str, Mapping[int, Names]]  # what may come beside it


OPENPOSE = Layout(
    "pose_keypoints_2d",
    {25: OPENPOSE_25, 18: OPENPOSE_18},
    {
        "hand_left_keypoints_2d": {21: HANDS[0]},
        "hand_right_keypoints_2d": {21: HANDS[1]},
        "face_keypoints_2d": {70: face(70)},
    },
)
COCO_FILES = Layout(
    "keypoints",
    {17: COCO, 23: COCO + FEET, 133: WHOLE_BODY},
    {
        "foot_kpts": {6: FEET},
        "face_kpts": {68: face(68)},
        "lefthand_kpts": {21: HANDS[0]},
        "righthand_kpts": {21: HANDS[1]},
    },
)


def gathered(names: Iterable[str]) -> str:
    """Keypoints for a sentence: `21 of the left hand, 68 of the face, neck, mid_hip`."""
    left = list(names)
    said = []
    for what, part in (("left hand", HANDS[0]), ("right hand", HANDS[1]), ("face", face(70))):
        if count := sum(name in part for name in left):
            said.append(f"{count} of the {what}")
            left = [name for name in left if name not in part]
    return ", ".join([*said, *left])
