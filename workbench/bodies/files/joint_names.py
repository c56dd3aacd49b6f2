"""The joints of SMPL and its relatives: their names, which files leave out, and their trees."""

from collections.abc import Sequence

BODY = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2"),
    *("left_ankle", "right_ankle", "spine3", "left_foot", "right_foot", "neck"),
    *("left_collar", "right_collar", "head", "left_shoulder", "right_shoulder"),
    *("left_elbow", "right_elbow", "left_wrist", "right_wrist"),
)
FINGER_JOINTS = tuple(
    f"{finger}{i}" for finger in ("index", "middle", "pinky", "ring", "thumb") for i in (1, 2, 3)
)
HANDS = tuple(f"{side}_{name}" for side in ("left", "right") for name in FINGER_JOINTS)
NAMES = {
    16: ("MANO", ("wrist", *FINGER_JOINTS)),
    24: ("SMPL", (*BODY, "left_hand", "right_hand")),
    52: ("SMPL-H", (*BODY, *HANDS)),
    55: ("SMPL-X", (*BODY, "jaw", "left_eye", "right_eye", *HANDS)),
}
FLAME = ("root", "neck", "jaw", "left_eye", "right_eye")  # the head of Li et al. (2017)
_BODY_TREE = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)


def _fingers(wrist: int, first: int) -> tuple[int, ...]:
    """The parents of five fingers of three joints, the first of which has the number `first`."""
    return tuple(wrist if i % 3 == 0 else first + i - 1 for i in range(15))


FLAME_TREE = (-1, 0, 1, 1, 1)
TREES = {  # the parents of each family's joints
    "MANO": (-1, *_fingers(0, 1)),
    "SMPL": (*_BODY_TREE, 20, 21),
    "SMPL-H": (*_BODY_TREE, *_fingers(20, 22), *_fingers(21, 37)),
    "SMPL-X": (*_BODY_TREE, 15, 15, 15, *_fingers(20, 25), *_fingers(21, 40)),
    "FLAME": FLAME_TREE,
}


def family(n_joints: int, parents: Sequence[int] | None = None) -> str:
    """Which model a file with so many joints holds: SMPL, SMPL-H, SMPL-X, MANO or none of them.

    FLAME, of five joints, is told by its parents, and only if they are given.
    """
    if parents is not None and tuple(parents) == FLAME_TREE:
        return "FLAME"
    return NAMES[n_joints][0] if n_joints in NAMES else "SMPL-like"


def joint_names(n_joints: int, parents: Sequence[int] | None = None) -> tuple[str, ...]:
    """The names that the family's joints have, or joint_0, joint_1, ..."""
    if family(n_joints, parents) == "FLAME":
        return FLAME
    if n_joints in NAMES:
        return NAMES[n_joints][1]
    return tuple(f"joint_{k}" for k in range(n_joints))
