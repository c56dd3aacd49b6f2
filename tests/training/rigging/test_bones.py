"""The decomposition into rigid bones: each step by its own definition."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.training.rigging.made_motion import driven
from workbench.errors import BadArgument
from workbench.geometry.rigid import procrustes
from workbench.training.rigging.bones import Bones, fit_bone_weights, fit_bones, rigid_motions
from workbench.training.rigging.decomposition import (
    alike,
    bones_needed,
    clusters,
    noise_of,
    without_least,
)
from workbench.training.rigging.joints import joint_tree

GIVEN = driven(12, seed=3)


def rough() -> Bones:
    return clusters(GIVEN.body.template, GIVEN.meshes, 5)


def test_rigid_motions_of_whole_weights_are_procrustes() -> None:
    rest, meshes = GIVEN.body.template, GIVEN.meshes
    R, t = rigid_motions(rest, meshes.swapaxes(0, 1), np.ones(len(rest)))
    for turn, shift, mesh in zip(R, t, meshes, strict=True):
        motion = procrustes(rest, mesh)
        np.testing.assert_allclose(turn, motion.R, atol=1e-12)
        np.testing.assert_allclose(shift, motion.t, atol=1e-12)


def test_motion_of_a_weighted_bone_is_stationary() -> None:
    """No small turn or shift lowers sum |w (R p + t) - q|^2."""
    rng = np.random.default_rng(0)
    rest, targets, w = rng.random((9, 3)), rng.random((9, 1, 3)), rng.random(9)
    (R,), (t,) = rigid_motions(rest, targets, w)
    residual = w[:, None] * (rest @ R.T + t) - targets[:, 0]
    np.testing.assert_allclose(w @ residual, 0, atol=1e-12)
    np.testing.assert_allclose(w @ np.cross(rest @ R.T, residual), 0, atol=1e-12)


def test_alternation_never_raises_the_cost() -> None:
    rest, meshes = GIVEN.body.template, GIVEN.meshes
    bones, costs = rough(), []
    for _ in range(3):
        for step in (fit_bone_weights, fit_bones):
            bones = step(bones, rest, meshes)
            costs.append(bones.rms(rest, meshes))
    assert costs == sorted(costs, reverse=True)
    assert costs[-1] < 0.9 * costs[0]
    np.testing.assert_allclose(bones.weights.sum(axis=1), 1, atol=1e-12)
    assert bones.weights.min() >= 0
    assert (bones.weights > 0).sum(axis=1).max() <= 4


def test_rank_of_meshes_counts_bones() -> None:
    assert bones_needed(driven(30, seed=3).meshes, 1e-4) == 6
    hinge = np.ones((6, 3))
    hinge[3] = [0, 0, 1]
    assert bones_needed(driven(30, seed=3, allowed=hinge).meshes, 1e-4) == 6
    with pytest.raises(BadArgument, match="at most 64 are looked for"):
        bones_needed(np.random.default_rng(0).random((90, 300, 3)), 1e-3)


@pytest.mark.parametrize("sigma", [2e-4, 3e-3])
def test_singular_values_tell_the_noise(sigma: float) -> None:
    given = driven(24, seed=1).meshes
    noisy = given + sigma * np.random.default_rng(0).standard_normal(given.shape)
    assert noise_of(noisy) == pytest.approx(sigma, rel=0.02)
    assert bones_needed(noisy, 1.05 * np.sqrt(3) * sigma) == 6
    assert bones_needed(noisy, 1e-4) > 10
    assert noise_of(noisy[:9]) is None  # 19 of 27 singular values are motion
    assert noise_of(given) is None


def test_bones_that_move_alike_are_merged() -> None:
    bones = rough()
    twice = bones.with_bone(bones.rotations[:, 0], bones.translations[:, 0])
    weights = twice.weights.copy()
    weights[:, -1] = weights[:, 0] = weights[:, 0] / 2
    twice = Bones(twice.rotations, twice.translations, weights)
    rest = GIVEN.body.template
    for fewer in (alike(twice, rest, 1e-9), without_least(twice, rest)):
        assert fewer.count == bones.count
        assert fewer.rms(rest, GIVEN.meshes) == pytest.approx(bones.rms(rest, GIVEN.meshes))


def bones_of(body_poses: np.ndarray) -> Bones:
    """The true bones of the tube in some poses."""
    body = GIVEN.body
    joints, K = body.joints(), body.n_joints
    R, t = np.zeros((len(body_poses), K, 3, 3)), np.zeros((len(body_poses), K, 3))
    for i, pose in enumerate(body_poses):
        world = body.joints(pose)
        for k in range(K):
            turn = np.eye(3)
            at = k
            while at >= 0:
                turn = rotation(pose[at]) @ turn
                at = body.parents[at]
            R[i, k], t[i, k] = turn, world[k] - turn @ joints[k]
    return Bones(R, t, body.weights)


def rotation(vector: np.ndarray) -> np.ndarray:
    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


def test_joints_and_tree_of_true_bones_are_true() -> None:
    body = GIVEN.body
    poses = 0.5 * np.random.default_rng(1).standard_normal((8, 6, 3))
    poses[:, 3, :2] = 0  # a hinge about z
    bones = bones_of(poses)
    tree = joint_tree(bones, body.template)
    assert tree.edges == {frozenset((k, body.parents[k])) for k in range(1, 6)}
    for joint in tree.joints:
        assert joint.gap < 1e-12
        child = max(joint.bones)
        off = joint.place - body.joints()[child]
        if child == 3:
            np.testing.assert_allclose(joint.free, [[0, 0, joint.free[0, 2]]], atol=1e-9)
            np.testing.assert_allclose(off[:2], 0, atol=1e-9)
        else:
            assert not len(joint.free)
            np.testing.assert_allclose(off, 0, atol=1e-9)
