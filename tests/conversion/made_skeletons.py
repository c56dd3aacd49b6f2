"""BVH files of a person in the names, the tree, the axes, the unit of many kinds of skeletons.

Chains of joints are written `name=joint`; `*` is a side as the kind spells it, `?` its first
letter. A name without a joint lies where its parent does. Each joint gets axes of its own at
random, so that the rest pose of the file is no pose of anybody.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.geometry.guesses import UNITS, UP_TO_Y
from workbench.motions import Motion

SIDES = ("left", "right")


@dataclass(frozen=True)
class Kind:
    """A kind of skeletons: chains from the root, and chains for each side."""

    middle: str
    sided: str
    sides: tuple[str, str] = ("Left", "Right")
    unit: str = "cm"
    up: str = "y"
    order: str = "ZXY"
    prefix: str = ""
    moves: int = 0  # which joint has channels of position

    def tree(self) -> list[tuple[str, int, str]]:
        """Name, parent and SMPL's joint (or nothing) of each joint, parents first."""
        found: list[tuple[str, int, str]] = []
        chains = [(chain, "", "") for chain in self.middle.split("; ")]
        for own, side in zip(self.sides, SIDES, strict=True):
            chains += [(chain, own, side) for chain in self.sided.split("; ")]
        for chain, own, side in chains:
            parent = -1
            for link in chain.split():
                name, _, joint = link.partition("=")
                if own:
                    joint = joint and f"{side}_{joint}" if "*" in name or "?" in name else joint
                    name = name.replace("*", own).replace("?", own[0])
                known = [k for k, (other, *_) in enumerate(found) if other == self.prefix + name]
                if not known:
                    found.append((self.prefix + name, parent, joint))
                    known = [len(found) - 1]
                parent = known[0]
        return found


LEG, ARM = "*UpLeg=hip *Leg=knee *Foot=ankle", "*Arm=shoulder *ForeArm=elbow *Hand=wrist"
LIKE_MIXAMO = Kind(
    "Hips=pelvis Spine=spine1 Spine1=spine2 Spine2=spine3 Neck=neck Head=head",
    f"Hips {LEG} *ToeBase=foot; Spine2 *Shoulder=collar {ARM} *HandIndex1; *Hand *HandThumb1",
)
KINDS = {
    "CMU (cgspeed)": Kind(
        "Hips=pelvis LowerBack Spine=spine1 Spine1=spine3 Neck Neck1=neck Head=head",
        f"Hips ?HipJoint {LEG} *ToeBase=foot; Spine1 *Shoulder {ARM} *FingerBase ?Thumb",
        unit="cmu",
        order="ZYX",
    ),
    "Mixamo and HumanIK": replace(LIKE_MIXAMO, prefix="mixamorig:"),
    "LAFAN1": replace(
        LIKE_MIXAMO, sided=f"Hips {LEG} *Toe=foot; Spine2 *Shoulder=collar {ARM}", order="ZYX"
    ),
    "Bandai-Namco": Kind(
        "joint_Root Hips=pelvis Spine=spine1 Chest=spine2 Neck=neck Head=head",
        "Hips UpperLeg_*=hip LowerLeg_*=knee Foot_*=ankle Toes_*=foot; "
        "Chest Shoulder_*=collar UpperArm_*=shoulder LowerArm_*=elbow Hand_*=wrist",
        sides=("L", "R"),
        moves=1,
        order="ZXY",
    ),
    "Rokoko": Kind(
        "Root Hips=pelvis Spine1=spine1 Spine2=spine2 Spine3 Spine4=spine3 Neck=neck Head=head",
        f"Hips *Thigh=hip *Shin=knee *Foot=ankle *Toe=foot; Spine4 *Shoulder=collar {ARM}",
        moves=1,
        order="YXZ",
    ),
    "Xsens (MVN)": Kind(
        "Pelvis=pelvis L5=spine1 L3=spine2 T12 T8=spine3 Neck=neck Head=head",
        "Pelvis *UpperLeg=hip *LowerLeg=knee *Foot=ankle *Toe=foot; "
        "T8 *Shoulder=collar *UpperArm=shoulder *ForeArm=elbow *Hand=wrist",
        up="z",
        unit="m",
    ),
    "Unreal mannequin": Kind(
        "root pelvis=pelvis spine_01=spine1 spine_02=spine2 spine_03=spine3 neck_01=neck head=head",
        "pelvis thigh_*=hip calf_*=knee foot_*=ankle ball_*=foot; "
        "spine_03 clavicle_*=collar upperarm_*=shoulder lowerarm_*=elbow hand_*=wrist index_01_*; "
        "upperarm_* upperarm_twist_01_*",
        sides=("l", "r"),
        up="z",
        moves=1,
    ),
    "Blender Rigify": Kind(
        "spine=pelvis spine.001=spine1 spine.002=spine2 spine.003=spine3 spine.004=neck spine.005 "
        "spine.006=head",
        "spine thigh.*=hip shin.*=knee foot.*=ankle toe.*=foot; "
        "spine.003 shoulder.*=collar upper_arm.*=shoulder forearm.*=elbow hand.*=wrist",
        sides=("L", "R"),
        prefix="DEF-",
        unit="m",
        order="XYZ",
    ),
    "MHR": Kind(
        "body_world root=pelvis c_spine0=spine1 c_spine1=spine2 c_spine2 c_spine3=spine3 "
        "c_neck=neck c_head=head",
        "root *_upleg=hip *_lowleg=knee *_foot=ankle *_ball=foot; "
        "c_spine3 *_clavicle=collar *_uparm=shoulder *_lowarm=elbow *_wrist=wrist",
        sides=("l", "r"),
        moves=1,
        order="ZYX",
    ),
}


def still(motion: Motion, kind: Kind) -> Motion:
    """The motion without the turns of joints that the skeleton does not have."""
    there = {joint for _, _, joint in kind.tree()}
    pose = motion.pose * np.isin(motion.joint_names, [*there])[None, :, None]
    return replace(motion, pose=pose)


def joints_of(motion: Motion, body: Body, kind: Kind) -> tuple[Array, tuple[str, ...]]:
    """Where the kind's joints are, (T, K, 3) m, y up, and their names."""
    places, tree = motion.joints(body), kind.tree()
    at = np.zeros((len(motion), len(tree), 3))
    for k, (_, parent, joint) in enumerate(tree):
        if joint:
            at[:, k] = places[:, body.joint_names.index(joint)]
        elif parent >= 0:
            at[:, k] = at[:, parent]
    return at, tuple(name for name, *_ in tree)


def write_skeleton(path: Path, motion: Motion, body: Body, kind: Kind, seed: int = 0) -> Array:
    """Write the motion of a body as a BVH of this kind; the joints (T, K, 3) m, y up."""
    motion = still(motion, kind)
    at, _ = joints_of(motion, body, kind)
    tree, T = kind.tree(), len(motion)
    turn, metres = UP_TO_Y[kind.up].T, UNITS[kind.unit]
    there = at @ turn.T / metres
    world = _worlds(motion, body)
    axes = Rotation.random(len(tree), rng=np.random.default_rng(seed)).as_matrix()
    own = np.empty((T, len(tree), 3, 3))
    for k, (_, parent, joint) in enumerate(tree):
        if joint:
            own[:, k] = turn @ world[:, body.joint_names.index(joint)] @ axes[k]
        else:
            own[:, k] = own[:, parent] if parent >= 0 else np.eye(3)
    below = [[c for c, (_, p, _) in enumerate(tree) if p == k] for k in range(len(tree))]
    lines, columns = ["HIERARCHY"], []

    def add(k: int, depth: int) -> None:
        name, parent, _ = tree[k]
        tab = "\t" * depth
        local, offset = own[:, k], np.zeros((T, 3))
        if parent >= 0:
            back = own[:, parent].swapaxes(1, 2)
            local = back @ own[:, k]
            offset = np.einsum("tij,tj->ti", back, there[:, k] - there[:, parent])
        elif not kind.moves:
            offset = there[:, k]
        moves = k == kind.moves or k == 0
        if not moves:
            assert np.ptp(offset, axis=0).max() * metres < 1e-6, f"{name} is not rigid"
        rest = np.zeros(3) if moves else offset[0]
        lines.extend([f"{tab}{'JOINT' if k else 'ROOT'} {name}", f"{tab}{{"])
        lines.append(f"{tab}\tOFFSET " + " ".join(f"{x:.9f}" for x in rest))
        words = [f"{axis}rotation" for axis in kind.order]
        angles = Rotation.from_matrix(local).as_euler(kind.order, degrees=True)
        if moves:
            words = ["Xposition", "Yposition", "Zposition", *words]
            columns.append(offset)
        columns.append(angles)
        lines.append(f"{tab}\tCHANNELS {len(words)} {' '.join(words)}")
        for child in below[k]:
            add(child, depth + 1)
        if not below[k]:
            lines.extend([f"{tab}\tEnd Site", f"{tab}\t{{", f"{tab}\t\tOFFSET 0 0 0", f"{tab}\t}}"])
        lines.append(f"{tab}}}")

    add(0, 0)
    rows = np.concatenate(columns, axis=1)
    lines += ["MOTION", f"Frames: {T}", f"Frame Time: {1 / motion.fps:.9f}"]
    lines += [" ".join(f"{x:.9f}" for x in row) for row in rows]
    path.write_text("\n".join(lines) + "\n")
    return at


def _worlds(motion: Motion, body: Body) -> Array:
    """The rotations (T, K, 3, 3) of a body's joints, by multiplying along the tree."""
    local = Rotation.from_rotvec(motion.pose.reshape(-1, 3)).as_matrix()
    world = local.reshape(*motion.pose.shape[:2], 3, 3)
    for k, parent in enumerate(body.parents):
        if parent >= 0:
            world[:, k] = world[:, parent] @ world[:, k]
    return world
