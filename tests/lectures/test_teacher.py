"""The teacher, who poses people by twists and dual quaternions, against known motions."""

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from builder.population import unskin
from tests.tiers import few
from workbench.arrays import Array
from workbench.bodies.forward.posing import Posing
from workbench.lectures.material.teacher import (
    DISTAL_SHARE,
    HALF_OF,
    JOINT,
    PARENTS,
    PROXIMAL_SHARE,
    Teacher,
    joint_positions,
    offsets,
    twist_about,
)


def skinned(points: Array, joints: Array, weights: Array, rotations: Array) -> Array:
    """Linear blend skinning once more, joint by joint and vertex by vertex, from the equations."""
    G: list[Array] = []
    for k, parent in enumerate(PARENTS):
        local = np.eye(4)
        local[:3, :3] = rotations[k]
        local[:3, 3] = joints[k] - (joints[parent] if parent >= 0 else 0)
        G.append(local if parent < 0 else G[parent] @ local)
    posed = np.zeros_like(points)
    for k, motion in enumerate(G):
        moved = (points - joints[k]) @ motion[:3, :3].T + motion[:3, 3]
        posed += weights[:, [k]] * moved
    return posed


def limb(weights_of: dict[int, float], ring: float) -> Teacher:
    """A ring of points around the middle of the left forearm, of radius 1 cm, at z = `ring`."""
    joints = np.zeros((24, 3))
    joints[JOINT["left_elbow"]], joints[JOINT["left_wrist"]] = (0.1, 0, 0), (0.3, 0, 0)
    joints[JOINT["left_knee"]], joints[JOINT["right_knee"]] = (0, -1, 0), (0, -1, 0)
    for name in ("right_elbow", "right_wrist", "left_ankle", "right_ankle"):
        joints[JOINT[name]] = (-0.1, -0.1, 0) if "elbow" in name else (-0.2, -2, 0)
    angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    points = np.stack([np.full(12, ring), 0.01 * np.cos(angles), 0.01 * np.sin(angles)], axis=1)
    weights = np.zeros((12, 32))
    for bone, share in weights_of.items():
        weights[:, bone] = share
    return Teacher(points, joints, csr_array(weights))


def test_teacher_turns_one_bone_rigidly() -> None:
    """All the weight on the wrist, which two rotations take along a screw."""
    teacher = limb({JOINT["left_wrist"]: 1.0}, ring=0.35)
    assert abs(teacher.vertices(np.zeros((24, 3))) - teacher.rest).max() < 1e-15
    pose = np.zeros((24, 3))
    pose[JOINT["left_elbow"]], pose[JOINT["left_wrist"]] = (0.3, -1.2, 0.5), (-0.4, 0.6, 1.1)
    R = Rotation.from_rotvec(pose).as_matrix()
    weights = teacher.weights.toarray()[:, :24]
    expected = skinned(teacher.rest, teacher.joints, weights, R)
    assert abs(teacher.vertices(pose) - expected).max() < 1e-14


def test_halves_of_an_arm_take_their_share_of_a_twist() -> None:
    far_half = 24 + HALF_OF.index(JOINT["left_elbow"])
    teacher = limb({far_half: 1.0}, ring=0.25)
    pose = np.zeros((24, 3))
    pose[JOINT["left_wrist"]] = (1.0, 0, 0)
    expected = teacher.rest @ Rotation.from_rotvec([DISTAL_SHARE, 0, 0]).as_matrix().T
    assert abs(teacher.vertices(pose) - expected).max() < 1e-14
    teacher = limb({JOINT["left_shoulder"]: 1.0}, ring=0.05)
    pose = np.zeros((24, 3))
    pose[JOINT["left_shoulder"]] = (1.0, 0, 0)  # the elbow lies along x
    expected = teacher.rest @ Rotation.from_rotvec([PROXIMAL_SHARE, 0, 0]).as_matrix().T
    assert abs(teacher.vertices(pose) - expected).max() < 1e-14


@pytest.mark.parametrize("angle", few([1.5, 0.5, 2.5], 1))
def test_teacher_keeps_the_radius_that_linear_blending_loses(angle: float) -> None:
    """The candy wrapper: at half weights a twist by a shrinks the ring by |cos(a / 2)|."""
    teacher = limb({JOINT["left_elbow"]: 0.5, JOINT["left_wrist"]: 0.5}, ring=0.3)
    pose = np.zeros((24, 3))
    pose[JOINT["left_wrist"]] = (angle, 0, 0)
    radii = np.linalg.norm(teacher.vertices(pose)[:, 1:], axis=1)
    assert radii == pytest.approx(0.01)
    R = Rotation.from_rotvec(pose).as_matrix()
    weights = teacher.weights.toarray()[:, :24]
    linear = skinned(teacher.rest, teacher.joints, weights, R)
    expected = 0.01 * np.cos(angle / 2)
    assert np.linalg.norm(linear[:, 1:], axis=1) == pytest.approx(expected)
    world = Posing.of(pose[None], PARENTS).world[0]
    placed = joint_positions(world, teacher.joints)
    shifts = offsets(world, placed, teacher.joints)
    correction = unskin(teacher.vertices(pose), weights, world, shifts) - teacher.rest
    assert (
        abs(
            skinned(teacher.rest + correction, teacher.joints, weights, R) - teacher.vertices(pose)
        ).max()
        < 1e-12
    )


def test_teacher_turns_with_the_root_by_any_angle() -> None:
    """Also where the quaternions of two bones come with opposite signs."""
    teacher = limb({JOINT["left_elbow"]: 0.5, JOINT["left_wrist"]: 0.5}, ring=0.3)
    pose = np.zeros((24, 3))
    pose[JOINT["left_wrist"]] = (0.4, 1.2, -0.3)
    before = teacher.vertices(pose)
    for angle in np.linspace(0, 2 * np.pi, 13):
        pose[0] = angle * np.array([0.6, 0.0, 0.8])
        turned = before @ Rotation.from_rotvec(pose[0]).as_matrix().T
        np.testing.assert_allclose(teacher.vertices(pose), turned, atol=1e-12)


def test_twist_is_what_turns_about_the_axis() -> None:
    axis = np.array([0.0, 0, 2])
    swing = Rotation.from_rotvec([0.4, -0.7, 0])
    twisted = (swing * Rotation.from_rotvec([0, 0, 0.9])).as_rotvec()
    assert twist_about(axis, twisted) == pytest.approx([0, 0, 0.9])
    assert twist_about(axis, swing.as_rotvec()) == pytest.approx([0, 0, 0], abs=1e-15)
