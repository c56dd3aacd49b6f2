"""The names of the joints of SMPL and its relatives, which their files leave out."""

BODY = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2"),
    *("left_ankle", "right_ankle", "spine3", "left_foot", "right_foot", "neck"),
    *("left_collar", "right_collar", "head", "left_shoulder", "right_shoulder"),
    *("left_elbow", "right_elbow", "left_wrist", "right_wrist"),
)
FINGERS = tuple(
    f"{finger}{i}" for finger in ("index", "middle", "pinky", "ring", "thumb") for i in (1, 2, 3)
)
HANDS = tuple(f"{side}_{name}" for side in ("left", "right") for name in FINGERS)
NAMES = {
    16: ("MANO", ("wrist", *FINGERS)),
    24: ("SMPL", (*BODY, "left_hand", "right_hand")),
    52: ("SMPL-H", (*BODY, *HANDS)),
    55: ("SMPL-X", (*BODY, "jaw", "left_eye", "right_eye", *HANDS)),
}


def family(n_joints: int) -> str:
    """Which model a file with so many joints holds: SMPL, SMPL-H, SMPL-X, MANO or none of them."""
    return NAMES[n_joints][0] if n_joints in NAMES else "SMPL-like"


def joint_names(n_joints: int) -> tuple[str, ...]:
    """The family's names, or joint_0, joint_1, ..."""
    if n_joints in NAMES:
        return NAMES[n_joints][1]
    return tuple(f"joint_{k}" for k in range(n_joints))
