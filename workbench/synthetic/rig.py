"""MakeHuman's `default` rig (163 bones) gathered into the 24 joints of SMPL."""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.synthetic.base_mesh import N_BODY, BaseMesh
from workbench.synthetic.skeleton import JOINT, JOINT_NAMES, MIRRORED_JOINTS, N_JOINTS
from workbench.synthetic.wheel import Wheel

# Bones by the joint that carries them; the first pattern that matches a bone's name decides.
CARRIED = (
    (r"root|pelvis|spine0[45]", "pelvis"),
    (r"spine03", "spine1"),
    (r"spine02|breast", "spine2"),
    (r"spine01", "spine3"),
    (r"upperleg", "hip"),
    (r"lowerleg", "knee"),
    (r"foot", "ankle"),
    (r"toe", "foot"),
    (r"clavicle|shoulder01", "collar"),
    (r"upperarm", "shoulder"),
    (r"lowerarm", "elbow"),
    (r"wrist|metacarpal|finger1", "wrist"),
    (r"finger", "hand"),
    (r"neck", "neck"),
    (r"", "head"),  # jaw, tongue, eyes and all of the face
)
# A joint stands at the mean of the heads of these bones.
PLACED = {
    "spine1": ("spine03",),
    "spine2": ("spine02",),
    "spine3": ("spine01",),
    "hip": ("upperleg01",),
    "knee": ("lowerleg01",),
    "ankle": ("foot",),
    "foot": tuple(f"toe{i}-1" for i in range(1, 6)),
    "neck": ("neck01",),
    "head": ("head",),
    "collar": ("clavicle",),
    "shoulder": ("upperarm01",),
    "elbow": ("lowerarm01",),
    "wrist": ("wrist",),
    "hand": tuple(f"finger{i}-1" for i in range(2, 6)),
}
SIDES = {"left": ".L", "right": ".R"}
# The distal halves of the limbs move on their own in the fine rig: bones 24, 25, ... 31.
DISTAL_HALVES = ("upperarm02", "lowerarm02", "upperleg02", "lowerleg02")
N_FINE = N_JOINTS + 2 * len(DISTAL_HALVES)


@dataclass(frozen=True, eq=False)
class Rig:
    """Joints and skinning weights of the base mesh.

    Attributes:
        joints: (24, 19158), each joint as a mean of base vertices, linear in shape.
        knuckles: (3, 19158), first joints of the left index, middle and little finger.
        fine_weights: (13380, 32), rows sum to one.
    """

    joints: csr_array
    knuckles: csr_array
    fine_weights: Array

    @property
    def weights(self) -> Array:
        """Weights (13380, 24) for linear blend skinning, with both halves of a limb added."""
        return coarse(self.fine_weights)


def coarse(fine_weights: Array) -> Array:
    """Weights (N, 24) of the joints from those of the finer rig, (N, 32)."""
    weights: Array = fine_weights[:, :N_JOINTS].copy()
    weights[:, HALF_OF] += fine_weights[:, N_JOINTS:]
    return weights


def read_rig(wheel: Wheel, mesh: BaseMesh) -> Rig:
    """The rig of the wheel."""
    bones = wheel.json("mpfb2/rigs/standard/rig.default.json")
    influences = wheel.json("mpfb2/rigs/standard/weights.default.json")["weights"]

    def mean_of_heads(names: list[str]) -> Array:
        heads = [_mean_of(_head(bones[name]["head"], mesh), mesh) for name in names]
        mean: Array = np.mean(heads, axis=0)
        return mean

    places = [mean_of_heads(_bones_of(name)) for name in JOINT_NAMES[1:]]
    pelvis = _mean_of(mesh.groups["joint-pelvis"], mesh)
    return Rig(
        joints=csr_array(np.array([pelvis, *places])),
        knuckles=csr_array(np.array([mean_of_heads([f"finger{i}-1.L"]) for i in (2, 3, 5)])),
        fine_weights=_fine_weights(influences),
    )


def carrier(bone: str) -> int:
    """The joint that carries a bone: `lowerarm02.L` -> 18, the left elbow."""
    kind = next(joint for pattern, joint in CARRIED if re.match(pattern, bone))
    side = {".L": "left_", ".R": "right_"}.get(bone[-2:], "")
    return JOINT[side + kind] if side + kind in JOINT else JOINT[kind]


HALF_OF = [carrier(f"{half}{side}") for half in DISTAL_HALVES for side in SIDES.values()]


def _fine_weights(influences: dict[str, list[tuple[int, float]]]) -> Array:
    weights = np.zeros((N_BODY, N_FINE))
    halves = [f"{half}{side}" for half in DISTAL_HALVES for side in SIDES.values()]
    for bone, pairs in influences.items():
        column = N_JOINTS + halves.index(bone) if bone in halves else carrier(bone)
        for vertex, weight in pairs:
            if vertex < N_BODY:
                weights[vertex, column] += weight
    weights /= weights.sum(axis=1, keepdims=True)
    return weights


def _bones_of(joint: str) -> list[str]:
    side, _, kind = joint.rpartition("_")
    return [name + SIDES.get(side, "") for name in PLACED[kind]]


def _head(head: dict[str, Any], mesh: BaseMesh) -> list[int]:
    match head["strategy"]:
        case "CUBE":
            return list(mesh.groups[head["cube_name"]])
        case "VERTEX":
            return [head["vertex_index"]]
        case _:
            return list(head["vertex_indices"])


def _mean_of(vertices: list[int], mesh: BaseMesh) -> Array:
    row = np.zeros(len(mesh.vertices))
    row[vertices] = 1 / len(vertices)
    return row


def at_most_four(weights: Array, mirror: Index) -> Array:
    """The four largest weights of each vertex, in rows that sum to one, the same on both sides.

    On the midline a joint is kept together with its mirror image, or both are dropped.
    """
    order = np.argsort(-weights, axis=1, kind="stable")
    kept = np.zeros(weights.shape, dtype=bool)
    np.put_along_axis(kept, order[:, :4], True, axis=1)
    kept &= weights > 1e-3
    midline = mirror == np.arange(len(mirror))
    kept[midline] &= kept[midline][:, MIRRORED_JOINTS]
    cut = np.where(kept, weights, 0.0)
    cut /= cut.sum(axis=1, keepdims=True)
    return cut
