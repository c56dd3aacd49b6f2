"""The chain, the binding matrices and the order of the pose features."""

import casadi as cs
import numpy as np
import pytest

from tests.bodies_made_up import random_body
from workbench import SkinnedBody
from workbench.bodies.forward.kinematics import (
    binding_motions,
    bones_of,
    pose_features,
    world_motions,
)
from workbench.geometry.rotation import matrix_from_vector, rodrigues

PARENTS = (-1, 0, 0, 1, 3, 2)
K = len(PARENTS)
RNG = np.random.default_rng(0)
JOINTS, POSE, BIND = RNG.normal(size=(3, 6, 3))


def rotations(vectors: np.ndarray) -> cs.DM:
    return cs.DM(np.hstack(list(matrix_from_vector(vectors))))


def test_the_chain_composes_from_the_root() -> None:
    motions = world_motions(rotations(POSE), [cs.DM(j) for j in JOINTS], PARENTS)
    expected: list[np.ndarray] = []
    for k, parent in enumerate(PARENTS):
        local = np.eye(4)
        local[:3, :3], local[:3, 3] = matrix_from_vector(POSE[k]), JOINTS[k]
        expected.append(local if k == 0 else expected[parent] @ local)
    for (R, t), G in zip(motions, expected, strict=True):
        np.testing.assert_allclose(np.asarray(R), G[:3, :3], atol=1e-14)
        np.testing.assert_allclose(np.asarray(t).ravel(), G[:3, 3], atol=1e-14)


def test_bones_of_a_t_pose_are_differences() -> None:
    bones = bones_of(cs.DM(JOINTS.T), rotations(np.zeros((K, 3))), PARENTS)
    for k in range(1, K):
        offset = JOINTS[k] - JOINTS[PARENTS[k]]
        np.testing.assert_allclose(np.asarray(bones[k]).ravel(), offset, atol=1e-15)


@pytest.mark.parametrize("bind", [np.zeros((K, 3)), BIND], ids=["T-pose", "other pose"])
def test_binding_motions_are_the_identity_in_the_bind_pose(bind: np.ndarray) -> None:
    G, posed = binding_motions(rotations(bind), rotations(bind), cs.DM(JOINTS.T), PARENTS)
    for motion in G:
        np.testing.assert_allclose(np.asarray(motion), np.eye(3, 4), atol=1e-14)
    np.testing.assert_allclose(np.asarray(posed).T, JOINTS, atol=1e-14)


def test_binding_motions_carry_the_joints_along() -> None:
    G, posed = binding_motions(rotations(POSE), rotations(BIND), cs.DM(JOINTS.T), PARENTS)
    for k in range(K):
        moved = np.asarray(G[k]) @ (*JOINTS[k], 1)
        np.testing.assert_allclose(moved, np.asarray(posed)[:, k], atol=1e-14)
        if k > 0:  # a joint belongs to its parent's part as well: parts do not come apart
            moved = np.asarray(G[PARENTS[k]]) @ (*JOINTS[k], 1)
            np.testing.assert_allclose(moved, np.asarray(posed)[:, k], atol=1e-14)


def test_the_posed_joints_are_the_explicit_sum_over_the_path() -> None:
    """J'_k = j_0 + sum over c on the path of R_parent(c) (j_c - j_parent(c))."""
    _, posed = binding_motions(
        rotations(POSE), rotations(np.zeros((K, 3))), cs.DM(JOINTS.T), PARENTS
    )
    R = matrix_from_vector(POSE)
    turned = [R[0]]
    for k in range(1, K):
        turned.append(turned[PARENTS[k]] @ R[k])
    for k in range(K):
        position, c = JOINTS[0].copy(), k
        while c > 0:
            position += turned[PARENTS[c]] @ (JOINTS[c] - JOINTS[PARENTS[c]])
            c = PARENTS[c]
        np.testing.assert_allclose(np.asarray(posed)[:, k], position, atol=1e-14)


def features(body: SkinnedBody, pose: np.ndarray) -> np.ndarray:
    out = pose_features(rodrigues(cs.DM(pose.T)), rodrigues(cs.DM(body.bind_pose.T)))
    return np.asarray(out).ravel()


@pytest.mark.parametrize("bound", [False, True])
def test_one_joint_touches_only_its_nine_features(bound: bool) -> None:
    body = random_body(n_joints=6, bound=bound)
    R0 = matrix_from_vector(body.bind_pose)
    np.testing.assert_array_equal(features(body, body.bind_pose), np.zeros(45))
    for k in range(6):
        pose = body.bind_pose.copy()
        pose[k] = [0.3, -0.5, 0.7]
        f = features(body, pose)
        difference = matrix_from_vector(pose[k]) - R0[k]
        for r in range(3):
            for c in range(3):
                if k > 0:  # the root has no features
                    n = 9 * (k - 1) + 3 * r + c
                    np.testing.assert_allclose(f[n], difference[r, c], atol=1e-15)
                    f[n] = 0
        assert not f.any()


def test_features_are_linear_in_the_rotations() -> None:
    R = cs.SX.sym("R", 3, 9)
    f = pose_features(R, rodrigues(cs.SX.zeros(3, 3)))
    assert cs.is_linear(f, cs.vec(R))


def test_a_chain_of_one_joint_has_no_features() -> None:
    assert pose_features(cs.MX.sym("R", 3, 3), cs.MX(cs.DM.eye(3))).shape == (0, 1)
