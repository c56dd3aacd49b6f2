"""Parts of a body, such as its head and its left forearm, and which vertices capsules stand for."""

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from workbench.arrays import Array, Index, Mask
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


# parts with a near and a far capsule, and where on the bone the far one begins: below the calf
CUT = {"thigh": 0.5, "shin": 0.6, "upper_arm": 0.5}
SIDED = ("pelvis",)  # parts with one on each side
STACKED = ("chest",)  # parts with a low and a high one
ENDINGS = ("_near", "_far", "_low", "_high")
THUMB = 0.05  # m from the axis of the hand
INNER = 0.015  # m below the convex hull of a part: inside of the mouth, eye sockets
ON_MIDLINE = 1e-6  # m


def parts_of_capsules(body: SkinnedBody) -> dict[str, Mask]:
    """For each capsule, which vertices (N,) it stands for.

    What lies more than 15 mm inside of the convex hull of the head is left out: mouth and eyes.
    """
    owner = owners(body)
    found: dict[str, Mask] = {}
    for k in part_joints(body):
        part, mask = BONES[body.joint_names[k]], owner == k
        if part == "head":
            mask = mask & ~_inner(body.template, mask)
        if part in SIDED:
            side = body.template[:, 0]
            found[f"left_{part}"] = mask & (side > -ON_MIDLINE)
            found[f"right_{part}"] = mask & (side < ON_MIDLINE)
        elif part == "head":
            low = np.asarray(body.template[:, 1] < body.joints()[k, 1])
            found |= {"head": mask & ~low, "jaw": mask & low}
        elif part in STACKED and mask.any():
            high = np.asarray(body.template[:, 1] > np.median(body.template[mask, 1]))
            found |= {f"{part}_low": mask & ~high, f"{part}_high": mask & high}
        elif limb := next((one for one in CUT if part.endswith(one)), ""):
            far = _far_end(body, k, CUT[limb])
            found |= {f"{part}_near": mask & ~far, f"{part}_far": mask & far}
        elif part.endswith("hand"):
            thumb = mask & _off_bone(body, k)
            found |= {part: mask & ~thumb, part.replace("hand", "thumb"): thumb}
        else:
            found[part] = mask
    return found


def _far_end(body: SkinnedBody, joint: int, cut: float) -> Mask:
    """The vertices (N,) beyond a share of the bone from a joint to its child."""
    joints = body.joints()
    start, end = joints[joint], joints[body.parents.index(joint)]
    return np.asarray((body.template - start - cut * (end - start)) @ (end - start) > 0)


def _off_bone(body: SkinnedBody, joint: int) -> Mask:
    """The vertices (N,) that are farther than 5 cm from the line through a joint and its child."""
    joints = body.joints()
    start, end = joints[joint], joints[body.parents.index(joint)]
    off = np.cross(body.template - start, (end - start) / np.linalg.norm(end - start))
    return np.asarray(np.linalg.norm(off, axis=1) > THUMB)


def part_of(capsule: str) -> str:
    """The part that a capsule stands for, in whole or in part."""
    whole = capsule
    for ending in ENDINGS:
        whole = whole.removesuffix(ending)
    if whole.partition("_")[2] in SIDED:
        return whole.partition("_")[2]
    return whole.replace("thumb", "hand").replace("jaw", "head")


def _inner(template: Array, part: Mask) -> Mask:
    try:
        planes = ConvexHull(template[part]).equations
    except (QhullError, ValueError):
        return np.zeros(len(part), dtype=bool)
    depth = -(template @ planes[:, :3].T + planes[:, 3]).max(axis=1)
    return np.asarray(depth > INNER)
