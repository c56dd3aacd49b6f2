"""The keypoints of detectors: their names, where files store them, and those of one person.

Hands have the names of SMPL-H's joints where these are the same points: `left_index1` is the
knuckle. Faces are numbered; no body of the package has landmarks for them.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from workbench.arrays import Array
from workbench.bodies.hand_points import HAND_POINTS
from workbench.errors import UnknownName
from workbench.fitting.observations import COCO, FEET, HEAD, LIMBS

Names = tuple[str, ...]

_ARMS, _LEGS = (
    tuple(f"{side}_{part}" for side in ("right", "left") for part in parts)
    for parts in (LIMBS[:3], LIMBS[3:])
)
_EYES_AND_EARS = tuple(f"{side}_{part}" for part in HEAD for side in ("right", "left"))
OPENPOSE_25 = ("nose", "neck", *_ARMS, "mid_hip", *_LEGS, *_EYES_AND_EARS, *FEET)
OPENPOSE_18 = tuple(name for name in OPENPOSE_25[:19] if name != "mid_hip")
_SIDES = ("left", "right")


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
    f"{side}_{part}" for part in ("big_toe", "small_toe", "heel") for side in ("left", "right")
)
HALPE_26 = (*COCO, "head_top", "neck", "mid_hip", *_TOES_AND_HEELS)  # AlphaPose (Fang et al. 2022)
HALPE_136 = (*HALPE_26, *face(68), *HANDS[0], *HANDS[1])
OPENPOSE_135 = (  # whose hands have no root, which is the wrist
    *(*COCO, "neck", "head_top", *FEET),
    *(*HANDS[0][1:], *HANDS[1][1:], *face(70)),
)
MEDIAPIPE_33 = (  # BlazePose (Bazarevsky et al. 2020); its points of a hand are knuckles
    "nose",
    *(f"{side}_eye{place}" for side in _SIDES for place in ("_inner", "", "_outer")),
    *(f"{side}_ear" for side in _SIDES),
    *(f"{side}_mouth" for side in _SIDES),
    *(f"{side}_{part}" for part in LIMBS[:3] for side in _SIDES),
    *(f"{side}_{part}" for part in ("pinky1", "index1", "thumb2") for side in _SIDES),
    *(f"{side}_{part}" for part in (*LIMBS[3:], "heel", "foot_index") for side in _SIDES),
)


@dataclass(frozen=True)
class KeypointLayout:
    """Where a file format stores the keypoints of a person.

    Attributes:
        name: what the format is called.
        main: the key of the body's keypoints; an entry without it is no person.
        bodies: the names of the keypoints under `main`, by their number.
        parts: the same for each further key, such as that of a hand.
    """

    name: str
    main: str
    bodies: Mapping[int, Names]
    parts: Mapping[str, Mapping[int, Names]]


OPENPOSE = KeypointLayout(
    "openpose",
    "pose_keypoints_2d",
    {25: OPENPOSE_25, 18: OPENPOSE_18, 135: OPENPOSE_135},
    {
        "hand_left_keypoints_2d": {21: HANDS[0]},
        "hand_right_keypoints_2d": {21: HANDS[1]},
        "face_keypoints_2d": {70: face(70)},
    },
)
BODIES_FILES = KeypointLayout(
    "alphapose", "joints", {17: COCO, 18: OPENPOSE_18}, {}
)  # its format cmu
COCO_FILES = KeypointLayout(
    "coco",
    "keypoints",
    {
        17: COCO,
        21: HAND_POINTS,
        23: COCO + FEET,
        26: HALPE_26,
        33: MEDIAPIPE_33,
        133: WHOLE_BODY,
        136: HALPE_136,
    },
    {
        "foot_kpts": {6: FEET},
        "face_kpts": {68: face(68)},
        "lefthand_kpts": {21: HANDS[0]},
        "righthand_kpts": {21: HANDS[1]},
    },
)

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
    "MediaPipe left hand 21": HANDS[0],
    "MediaPipe right hand 21": HANDS[1],
    "a hand 21, of either side": HAND_POINTS,
}


def counted_by_part(names: Iterable[str]) -> str:
    """Keypoints by part, for a sentence: `21 of the left hand, 68 of the face, neck, mid_hip`."""
    rest = list(names)
    counts = []
    for what, part in (("left hand", HANDS[0]), ("right hand", HANDS[1]), ("face", face(70))):
        if count := sum(name in part for name in rest):
            counts.append(f"{count} of the {what}")
            rest = [name for name in rest if name not in part]
    return ", ".join([*counts, *rest])


@dataclass(frozen=True, eq=False)
class DetectedPerson:
    """The keypoints of one person in a file.

    Attributes:
        names: the keypoints' names.
        points: (M, 3) u, v in px, and a confidence.
        size: width and height of the image in px, if the file says so.
        body: the names of the keypoints without hands and face.
        notes: sentences on what else the file holds.
    """

    names: tuple[str, ...]
    points: Array
    size: tuple[int, int] | None
    body: tuple[str, ...]
    notes: tuple[str, ...]


def no_such_person(path: str | Path, person: int, count: int) -> UnknownName:
    """The error for a person who is not among the `count` people of a file."""
    known = [str(number) for number in range(count)] if count <= 5 else []
    hint = "" if known else f"0 to {count - 1}"
    people = f"{count:,} {'person' if count == 1 else 'people'}"
    more = f"{path} holds {people}, counted from 0"
    return UnknownName("person", str(person), known, hint=hint, more=more)
