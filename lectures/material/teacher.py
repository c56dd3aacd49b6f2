"""The teacher of pose-dependent deformation: a finer rig, blended by dual quaternions.

It is synthetic: no body was measured. Limbs have two bones each, so that twist spreads along
them, and dual quaternion skinning (Kavan et al. 2008) keeps the volume that linear blend skinning
loses where joints bend. What the two differ by is what pose blend shapes have to learn.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.bodies.ablations import without_pose_blend_shapes
from workbench.bodies.files.joint_names import joint_names
from workbench.bodies.forward.posing import Posing
from workbench.errors import BadFile
from workbench.geometry.mirror import opposites
from workbench.reading.arrays import check_numbers, read_expected, shipped, wholes

JOINT_NAMES = joint_names(24)
PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21)
MIRRORED_JOINTS = opposites(JOINT_NAMES)
N_JOINTS = len(JOINT_NAMES)
JOINT = {name: k for k, name in enumerate(JOINT_NAMES)}
# The far halves of the limbs move on their own in the fine rig: bones 24, 25, ... 31.
HALVED = ("shoulder", "elbow", "hip", "knee")
HALF_OF = [JOINT[f"{side}_{joint}"] for joint in HALVED for side in ("left", "right")]
N_FINE = N_JOINTS + len(HALF_OF)
PROXIMAL_SHARE = 0.5  # of a hip's or shoulder's own twist, taken by the near half of the limb
DISTAL_SHARE = 0.6  # of a wrist's or ankle's twist, taken by the far half of the limb before it
LIMBS = (("shoulder", "elbow"), ("hip", "knee"))  # these turn about their own axis
FORE_LIMBS = (("elbow", "wrist"), ("knee", "ankle"))  # these are turned by what follows
BEFORE = (*PARENTS, *HALF_OF)  # the bone before each of the 32
FILE_NAME = "fine_weights.npz"
BODIES = ("default", "small")
SHARES = 2**15  # weights are stored as whole multiples of 1 / SHARES


def joint_positions(R: Array, joints: Array, parents: Sequence[int] = PARENTS) -> Array:
    """Where joints are, (K, 3) m, whose bones have world rotations R (K, 3, 3).

    `joints` (K, 3) m are their positions without rotations; the root stays where it is.
    """
    placed = joints.copy()
    for k, parent in enumerate(parents[1:], start=1):
        placed[k] = placed[parent] + R[parent] @ (joints[k] - joints[parent])
    return placed


def offsets(R: Array, placed: Array, joints: Array) -> Array:
    """The offsets o (n, 3) m of the rigid motions v -> R v + o that take `joints` to `placed`."""
    moved: Array = placed - (R @ joints[..., None])[..., 0]
    return moved


def coarse(fine_weights: Array) -> Array:
    """Weights (N, 24) of the joints from those of the finer rig, (N, 32)."""
    weights: Array = fine_weights[:, :N_JOINTS].copy()
    weights[:, HALF_OF] += fine_weights[:, N_JOINTS:]
    return weights


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


def teacher_of(body: SkinnedBody) -> Teacher:
    """The synthetic teacher of an embedded body's mean person.

    Raises BadFile for a body whose fine weights are not shipped.
    """
    if body.name not in BODIES or body.parents != PARENTS or body.n_joints != N_JOINTS:
        raise BadFile(
            f"there is no teacher for body {body.name!r}; there is one for {' and '.join(BODIES)}, "
            "as load_body gives them"
        )
    parts, N = [f"{body.name}_{part}" for part in ("shares", "rows", "columns")], body.n_vertices
    with shipped(f"bodies/{FILE_NAME}", "file of fine weights") as archive:
        arrays = read_expected(archive, dict.fromkeys(parts, wholes("entries")))
        shares, rows, columns = (arrays[part] for part in parts)
        check_numbers(parts[1], rows, N)
        check_numbers(parts[2], columns, N_FINE)
    weights = csr_array((shares / SHARES, (rows, columns)), shape=(N, N_FINE))
    return Teacher(body.template, body.J_regressor @ body.template, weights)


def body_on_teachers_rig(body: SkinnedBody) -> SkinnedBody:
    """An embedded body with the teacher's weights, half limbs merged, and no pose blend shapes.

    A trained body's own weights depend on its blend shapes, and its poses are not the teacher's.
    Raises BadFile as `teacher_of` does.
    """
    weights = coarse(teacher_of(body).weights.toarray())
    assert body.mirror is not None  # embedded bodies are alike on both sides
    carried = replace(body, weights=at_most_four(weights, body.mirror))
    return without_pose_blend_shapes(carried)
