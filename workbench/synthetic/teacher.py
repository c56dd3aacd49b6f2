"""The teacher of pose-dependent deformation: a finer rig, blended by dual quaternions.

It is synthetic: no body was measured. Limbs have two bones each, so that twist spreads along
them, and dual quaternion skinning (Kavan et al. 2008) keeps the volume that linear blend skinning
loses where joints bend. What the two differ by is what pose blend shapes have to learn.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from workbench.arrays import Array
from workbench.bodies.forward.posing import Posing
from workbench.synthetic.rig import HALF_OF
from workbench.synthetic.skeleton import JOINT, PARENTS, joint_positions, offsets

PROXIMAL_SHARE = 0.5  # of a hip's or shoulder's own twist, taken by the near half of the limb
DISTAL_SHARE = 0.6  # of a wrist's or ankle's twist, taken by the far half of the limb before it
LIMBS = (("shoulder", "elbow"), ("hip", "knee"))  # these turn about their own axis
FORE_LIMBS = (("elbow", "wrist"), ("knee", "ankle"))  # these are turned by what follows
BEFORE = (*PARENTS, *HALF_OF)  # the bone before each of the 32


@dataclass(frozen=True, eq=False)
class Teacher:
    """One person on the fine rig of 32 bones.

    Attributes:
        rest: (N, 3) in metres, the surface at rest.
        joints: (24, 3) in metres, at rest.
        weights: (N, 32), rows sum to one.
    """

    rest: Array
    joints: Array
    weights: csr_array

    def vertices(self, pose: Array) -> Array:
        """The posed surface (N, 3) m of one pose (24, 3) rad."""
        R, shifts = self._bone_motions(pose)
        return dual_quaternion_skinned(self.rest, self.weights, R, shifts, BEFORE)

    def _bone_motions(self, pose: Array) -> tuple[Array, Array]:
        """The rotation R (32, 3, 3) and offset o (32, 3) m of each bone, v -> R v + o."""
        posing = Posing.of(pose[None], PARENTS)
        local, R = posing.local[0], posing.world[0]
        placed = joint_positions(R, self.joints)
        near, far = R.copy(), R[HALF_OF]
        for side in ("left", "right"):
            for top, end in LIMBS:
                k, child = JOINT[f"{side}_{top}"], JOINT[f"{side}_{end}"]
                near[k] = R[PARENTS[k]] @ self._partly_untwisted(local[k], k, child)
            for top, end in FORE_LIMBS:
                k, child = JOINT[f"{side}_{top}"], JOINT[f"{side}_{end}"]
                twist = twist_about(self.joints[child] - self.joints[k], pose[child])
                far[HALF_OF.index(k)] = (
                    R[k] @ Rotation.from_rotvec(DISTAL_SHARE * twist).as_matrix()
                )
        bones, at = np.concatenate([near, far]), [*range(len(PARENTS)), *HALF_OF]
        return bones, offsets(bones, placed[at], self.joints[at])

    def _partly_untwisted(self, rotation: Array, k: int, child: int) -> Array:
        """A local rotation (3, 3) with only a share of its twist about the bone."""
        vector = Rotation.from_matrix(rotation).as_rotvec()
        twist = twist_about(self.joints[child] - self.joints[k], vector)
        back: Array = Rotation.from_rotvec(-(1 - PROXIMAL_SHARE) * twist).as_matrix()
        return rotation @ back


def twist_about(axis: Array, rotation: Array) -> Array:
    """The part of a rotation (rotation vector, rad) that turns about `axis`, as such a vector."""
    a = axis / np.linalg.norm(axis)
    *vector, scalar = Rotation.from_rotvec(rotation).as_quat(canonical=True)
    angle: Array = 2 * np.arctan2(np.array(vector) @ a, scalar) * a
    return angle


def dual_quaternion_skinned(
    rest: Array, weights: csr_array, R: Array, shifts: Array, before: Sequence[int]
) -> Array:
    """Points `rest` (N, 3) m blended by dual quaternions with weights (N, B).

    Bone b moves by v -> R_b v + o_b, with rotations R (B, 3, 3) and `shifts` o (B, 3) m; `before`
    (B,) is the bone before each, on whose side its quaternion has to be.
    """
    q = _same_side(Rotation.from_matrix(R).as_quat(), before)
    x, y, z, w = q.T
    ox, oy, oz = shifts.T
    dual = 0.5 * np.stack(
        [
            w * ox + oy * z - oz * y,
            w * oy + oz * x - ox * z,
            w * oz + ox * y - oy * x,
            -(ox * x + oy * y + oz * z),
        ],
        axis=1,
    )
    blend = weights @ np.concatenate([q, dual], axis=1)
    blend /= np.linalg.norm(blend[:, :4], axis=1, keepdims=True)
    return _move(rest, blend[:, :3], blend[:, 3:4], blend[:, 4:7], blend[:, 7:])


def _same_side(q: Array, before: Sequence[int]) -> Array:
    """Unit quaternions (B, 4), signs so that none is far from that of the bone before it."""
    signed = q.copy()
    for k, parent in enumerate(before[1:], start=1):
        if signed[k] @ signed[parent] < 0:
            signed[k] *= -1
    return signed


def _move(v: Array, q: Array, w: Array, dual: Array, dual_w: Array) -> Array:
    """Points (N, 3) moved by unit dual quaternions, one each."""
    turned = v + 2 * np.cross(q, np.cross(q, v) + w * v)
    moved: Array = turned + 2 * (w * dual - dual_w * q + np.cross(q, dual))
    return moved
