"""For which vertices of a body each capsule stands.

Each part has a capsule. Thighs, shins and upper arms, which taper, have a near and a far one; the
pelvis, which is wide and deep, has one on each side; the chest, which is narrower at the neck, has
a low and a high one; the head has one for the skull and one for the jaw, which reaches the chin;
and thumbs have their own.
"""

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from workbench.arrays import Array, Mask
from workbench.bodies.parts import BONES, owners, part_joints
from workbench.bodies.skinned import SkinnedBody

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
