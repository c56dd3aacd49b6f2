"""Parts of a body, such as its head and its left forearm: their vertices, and their neighbours."""

import numpy as np

from workbench.arrays import Index
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import BadBody
from workbench.geometry.mirror import opposite

BONES = {  # a part for each of these joints of SMPL, and what it is called
    "pelvis": "pelvis",
    "spine1": "belly",
    "spine2": "ribs",
    "spine3": "chest",
    "neck": "neck",
    "head": "head",
    **{
        f"{side}_{joint}": f"{side}_{part}"
        for side in ("left", "right")
        for joint, part in (
            ("hip", "thigh"),
            ("knee", "shin"),
            ("ankle", "foot"),
            ("shoulder", "upper_arm"),
            ("elbow", "forearm"),
            ("wrist", "hand"),
            ("hand", "fingers"),
        )
    },
}  # collars carry few vertices, which belong to the chest
TRUNK = ("pelvis", "belly", "ribs", "chest")


def part_joints(body: SkinnedBody) -> list[int]:
    """The joints that have a part, in the order of the body. Raises BadBody if there is none."""
    found = [k for k, name in enumerate(body.joint_names) if name in BONES]
    if not found:
        raise BadBody(
            f"body {body.name!r} has none of the joints of SMPL after which parts and capsules are "
            "named, such as left_elbow; make Capsules(...) of your own"
        )
    return found


def solid_of(part: str) -> str:
    """The solid that a part belongs to: the torso, a hand with its fingers, or the part itself."""
    return "torso" if part in TRUNK else part.replace("fingers", "hand")


def owners(body: SkinnedBody) -> Index:
    """The joint (N,) of each vertex's part: the one that moves it most.

    If that joint has no part, it is its nearest ancestor that has one.
    """
    owner = list(range(body.n_joints))
    for k, name in enumerate(body.joint_names):
        if name not in BONES and k:
            owner[k] = owner[body.parents[k]]
    return np.asarray(np.array(owner)[body.weights.argmax(axis=1)], dtype=np.int64)


def separate(body: SkinnedBody, joints: list[int]) -> Index:
    """Pairs (P, 2) of these joints' parts that are not neighbours: places in the list.

    Neighbours are parent and child on the tree of the joints that are listed, and children of one
    parent unless they are mirror images.
    """
    above = {}
    for k in joints:
        parent = body.parents[k]
        while parent not in joints and parent >= 0:
            parent = body.parents[parent]
        above[k] = parent
    names = body.joint_names
    found = [
        (i, j)
        for j in range(len(joints))
        for i in range(j)
        if (
            above[joints[j]] != joints[i]
            and above[joints[i]] != joints[j]
            and above[joints[i]] != above[joints[j]]
        )
        or opposite(names[joints[i]]) == names[joints[j]]
    ]
    return np.array(found, dtype=np.int64).reshape(-1, 2)
