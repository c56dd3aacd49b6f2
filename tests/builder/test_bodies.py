"""How bodies are built: T-pose, mirror, rig, shapes, blend shapes, each with a known answer."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from builder.base_mesh import carrier
from builder.bodies import regression_errors
from builder.population import to_t_pose
from builder.pose_priors import mirrored_pose
from builder.sets import regress
from tests.lectures.test_teacher import skinned
from workbench.arrays import Array
from workbench.bodies.catalogue import load_skinned
from workbench.geometry.mirror import Mirror
from workbench.lectures.material.teacher import (
    JOINT,
    JOINT_NAMES,
    MIRRORED_JOINTS,
    PARENTS,
    at_most_four,
)
from workbench.training.shape_training import learn_shape_space


@pytest.fixture(scope="module")
def small():  # type: ignore[no-untyped-def]
    return load_skinned("small")


@pytest.fixture(scope="module")
def mirror(small) -> Mirror:  # type: ignore[no-untyped-def]
    return Mirror(small.mirror, MIRRORED_JOINTS)


def test_t_pose_is_undone_by_skinning(small) -> None:  # type: ignore[no-untyped-def]
    """The exact inverse: what was un-posed is found again by skinning as it is written down."""
    rng = np.random.default_rng(0)
    vertices = small.template + rng.normal(scale=0.02, size=small.template.shape)
    joints = small.J_regressor @ small.template
    joints = skinned(joints, joints, np.eye(24), _arms_down()) + np.array([0.1, 0.9, -0.2])
    wrist = joints[JOINT["left_wrist"]]
    knuckles = wrist + np.array([[0.06, -0.06, 0.03], [0.07, -0.07, 0.0], [0.06, -0.06, -0.04]])
    rest = to_t_pose(vertices, joints, knuckles, small.weights)
    world = rest.rotations.transpose(0, 2, 1)
    local = np.stack(
        [world[k] if parent < 0 else world[parent].T @ world[k] for k, parent in enumerate(PARENTS)]
    )
    back = skinned(rest.vertices, rest.joints, small.weights, local) + joints[0]
    assert abs(back - vertices).max() < 1e-10
    assert abs(rest.vertices - vertices).max() > 0.1  # it did move


def _arms_down() -> Array:
    pose = np.zeros((24, 3))
    pose[JOINT["left_shoulder"]], pose[JOINT["right_shoulder"]] = (0, 0.1, -0.8), (0, -0.1, 0.8)
    pose[JOINT["left_elbow"]], pose[JOINT["right_elbow"]] = (0, -0.3, 0), (0, 0.3, 0)
    matrices: Array = Rotation.from_rotvec(pose).as_matrix()
    return matrices


def test_mirrored_pose_gives_the_mirrored_body(small, mirror: Mirror) -> None:  # type: ignore[no-untyped-def]
    """M(mirrored pose) = mirrored M(pose), skinning and pose blend shapes together."""
    rng = np.random.default_rng(1)
    pose = rng.normal(scale=0.6, size=(24, 3))

    def posed(pose: Array) -> Array:
        R = Rotation.from_rotvec(pose).as_matrix()
        person = small.template + small.shapedirs @ np.arange(-1, 1, 0.2)
        rest = person + small.posedirs @ (R - np.eye(3))[1:].ravel()
        return skinned(rest, small.J_regressor @ person, small.weights, R)

    here, there = posed(pose), posed(mirrored_pose(pose, MIRRORED_JOINTS))
    assert abs(mirror.points(here) - there).max() < 1e-13
    assert abs(here - there).max() > 0.1


def test_bones_go_to_the_joint_that_carries_them() -> None:
    carried = ("lowerarm02.L", "breast.R", "spine05", "metacarpal2.R", "finger3-2.L", "tongue01")
    joints = ("left_elbow", "spine2", "pelvis", "right_wrist", "left_hand", "head")
    assert [JOINT_NAMES[carrier(bone)] for bone in carried] == list(joints)


def test_cutting_to_four_weights_is_symmetric() -> None:
    weights = np.zeros((1, 24))
    for name, share in (("spine2", 0.3), ("spine3", 0.25), ("neck", 0.2)):
        weights[0, JOINT[name]] = share
    weights[0, [JOINT["left_collar"], JOINT["right_collar"]]] = 0.125
    cut = at_most_four(weights, np.array([0]))
    assert cut[0, JOINT["left_collar"]] == cut[0, JOINT["right_collar"]] == 0
    assert cut.sum() == pytest.approx(1)
    assert cut[0, JOINT["spine2"]] == pytest.approx(0.3 / 0.75)


def test_shape_space_is_found_again(small, mirror: Mirror) -> None:  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(0)
    betas = rng.normal(size=(60, 2))
    betas = (betas - betas.mean(axis=0)) @ np.linalg.inv(np.linalg.cholesky(np.cov(betas.T)).T)
    people = small.template + np.einsum("ncb,pb->pnc", small.shapedirs[:, :, :2], betas)
    space = learn_shape_space(people, small.faces, mirror, n_betas=2)
    assert abs(space.template - small.template).max() < 1e-12
    assert abs(space.shapedirs - small.shapedirs[:, :, :2]).max() < 1e-4
    assert space.explained.sum() == pytest.approx(1)
    assert abs(space.betas(people) - betas).max() < 1e-3


@pytest.mark.thorough
def test_joint_regressor_is_found_again(small) -> None:  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(0)
    betas = rng.normal(size=(80, 10))
    people = small.template + np.einsum("ncb,pb->pnc", small.shapedirs, betas)
    points = np.stack([small.J_regressor @ person for person in people])
    rows = regress(people, points, JOINT_NAMES, small.mirror, radius=0.25)
    assert rows.min() >= 0
    assert rows.sum(axis=1) == pytest.approx(1)
    assert np.array_equal(rows[MIRRORED_JOINTS][:, small.mirror], rows)
    assert regression_errors(rows, people, points).max() < 2e-4
