"""Rigging finds the body that moved the meshes, and says what their motion leaves open."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.training.rigging.made_motion import compared, driven
from workbench.errors import BadArgument
from workbench.training.rigging.bones import Bones, refined_at_once, together
from workbench.training.rigging.decomposition import alternated, least_rms
from workbench.training.rigging.rig import pose_rms, rig


def test_tube_is_rigged_and_explains_held_out_meshes() -> None:
    given = driven(24, seed=1)
    parts: list[str] = []
    found = rig(
        given.meshes,
        given.body.faces,
        rest=given.body.template,
        report=lambda what, done, of: parts.append(what),
    )
    agreement = compared(found.body, given.body)
    assert agreement.edges == 5
    assert agreement.weights < 1e-6
    assert agreement.joints < 1e-6
    assert found.rms < 1e-8
    assert pose_rms(found.body, driven(3, seed=9).meshes) < 1e-8
    assert {"bones, turn 1", "skeleton"} <= set(parts)
    assert len(found.notes) == 1
    assert "the joint of root" in found.notes[0]
    motion = found.motion(30.0)
    again = found.body.vertices(motion.pose[4], trans=motion.trans[4])
    np.testing.assert_allclose(again, given.meshes[4], atol=1e-8)


@pytest.mark.thorough
def test_rig_does_not_depend_on_place_and_facing() -> None:
    given = driven(24, seed=1)
    R = Rotation.random(24, random_state=0).as_matrix()
    away = 3 * np.random.default_rng(1).standard_normal((24, 1, 3))
    placed = given.meshes @ R.swapaxes(1, 2) + away
    first, found = (
        rig(meshes, given.body.faces, rest=given.body.template) for meshes in (given.meshes, placed)
    )
    assert found.body.parents == first.body.parents
    np.testing.assert_allclose(found.body.weights, first.body.weights, atol=1e-8)
    np.testing.assert_allclose(found.body.joints()[1:], first.body.joints()[1:], atol=1e-8)
    np.testing.assert_allclose(found.motion(30.0).vertices(found.body), placed, atol=1e-8)


@pytest.mark.thorough
def test_rest_pose_is_found() -> None:
    """From a mesh in another pose: in no bent mesh is the skin where linear blending has it."""
    given = driven(24, seed=1)
    bent = given.body.vertices(0.15 * np.random.default_rng(4).standard_normal((6, 3)))
    found = rig(given.meshes, given.body.faces, rest=bent)
    assert found.rms < 1e-8
    assert found.body.n_joints == 6
    assert np.abs(found.body.template - bent).max() > 0.005  # m
    assert pose_rms(found.body, driven(3, seed=9).meshes) < 1e-8


@pytest.mark.thorough
def test_hinges_are_named() -> None:
    allowed = np.ones((6, 3))
    allowed[3] = [0, 0, 1]
    given = driven(24, seed=1, allowed=allowed)
    found = rig(given.meshes, given.body.faces, rest=given.body.template)
    assert found.rms < 1e-8
    assert compared(found.body, given.body).edges == 5
    (hinge,) = (note for note in found.notes if "one axis" in note)
    assert "may slide along (0.00, 0.00, 1.00) by any distance" in hinge


@pytest.mark.thorough
def test_too_few_meshes_do_not_tell_their_noise() -> None:
    given = driven(6, seed=1)
    noise = 0.001 * np.random.default_rng(0).standard_normal(given.meshes.shape)
    found = rig(given.meshes + noise, given.body.faces, rest=given.body.template)
    assert "how much noise the meshes have cannot be told" in found.notes[-1]


@pytest.mark.thorough
def test_noise_asks_for_no_further_bones() -> None:
    given = driven(24, seed=1)
    noise = 0.001 * np.random.default_rng(0).standard_normal(given.meshes.shape)
    found = rig(given.meshes + noise, given.body.faces, rest=given.body.template)
    agreement = compared(found.body, given.body)
    assert found.body.n_joints == 6
    assert agreement.edges == 5
    assert agreement.joints < 0.003  # m
    assert 0.8 < found.rms / (0.001 * np.sqrt(3)) < 1


def test_one_bone_is_a_body_without_a_tree() -> None:
    given = driven(6, seed=1, allowed=np.eye(6)[:, :1] * np.ones((6, 3)))
    found = rig(given.meshes, given.body.faces, rest=given.body.template)
    assert found.body.parents == (-1,)
    assert found.rms < 1e-8
    noise = 0.001 * np.random.default_rng(0).standard_normal(given.meshes.shape)
    noisy = rig(given.meshes + noise, given.body.faces, rest=given.body.template)
    assert noisy.body.parents == (-1,)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"meshes": np.zeros((1, 66, 3))}, "two frames and four vertices"),
        ({"rest": np.zeros((5, 3))}, "one of the same topology"),
        ({"meshes": np.full((3, 66, 3), np.nan)}, "not finite"),
        ({"bones": 0}, "1 to 16 bones"),
        ({"tolerance": 0.0}, "above 0"),
    ],
)
def test_impossible_rigs_are_refused(wrong: dict[str, object], said: str) -> None:
    body = driven(2, seed=0)
    arguments = {"meshes": body.meshes, "rest": body.body.template} | wrong
    meshes = arguments.pop("meshes")
    with pytest.raises(BadArgument, match=said):
        rig(meshes, body.body.faces, **arguments)  # type: ignore[arg-type]


TWELVE = driven(12, seed=3)


def disturbed() -> Bones:
    """The true bones of the meshes, with weights that are mixed with those of neighbours."""
    found = rig(TWELVE.meshes, TWELVE.body.faces, rest=TWELVE.body.template)
    body, T = found.body, len(TWELVE.meshes)
    poses = zip(found.poses, found.trans, strict=True)
    R, t = np.zeros((T, 6, 3, 3)), np.zeros((T, 6, 3))
    for i, (pose, trans) in enumerate(poses):
        world = body.vertices(pose, trans=trans)
        for k in range(6):
            own = body.weights[:, k] ** 2
            middle, end = own @ body.template / own.sum(), own @ world / own.sum()
            U, _, Vh = np.linalg.svd((world - end).T @ (own[:, None] * (body.template - middle)))
            R[i, k] = U @ np.diag([1, 1, np.linalg.det(U @ Vh)]) @ Vh
            t[i, k] = end - R[i, k] @ middle
    return Bones(R, t, body.weights)


@pytest.mark.thorough
def test_joint_steps_reach_rounding_where_alternation_creeps() -> None:
    rest, bones = TWELVE.body.template, disturbed()
    crept = alternated(bones, rest, TWELVE.meshes).rms(rest, TWELVE.meshes)
    stepped = together(bones, rest, TWELVE.meshes)
    assert crept > 1e-4  # m
    assert stepped.rms(rest, TWELVE.meshes) < 1e-8
    np.testing.assert_allclose(stepped.weights.sum(axis=1), 1, atol=1e-12)
    assert (refined_at_once(bones, rest, TWELVE.meshes).weights > 0).sum(axis=1).max() <= 4


@pytest.mark.thorough
def test_least_rms_is_a_lower_bound() -> None:
    assert least_rms(TWELVE.meshes, 6) < 1e-7
    found = rig(TWELVE.meshes, TWELVE.body.faces, rest=TWELVE.body.template, bones=3)
    assert 1e-3 < least_rms(TWELVE.meshes, 3) < found.rms
