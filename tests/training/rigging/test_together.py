"""Steps in bones and weights at once: they are not worse, and end where alternation creeps."""

import numpy as np

from tests.training.rigging.made_motion import driven
from workbench.training.rigging.bones import Bones
from workbench.training.rigging.decomposition import alternated, least_rms
from workbench.training.rigging.rig import rig
from workbench.training.rigging.together import refined_at_once, together
from workbench.training.rigging.words import notes_of

GIVEN = driven(12, seed=3)


def disturbed() -> Bones:
    """The true bones of the meshes, with weights that are mixed with those of neighbours."""
    found = rig(GIVEN.meshes, GIVEN.body.faces, rest=GIVEN.body.template)
    body, T = found.body, len(GIVEN.meshes)
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


def test_steps_at_once_end_at_rounding_where_alternation_is_far_from_it() -> None:
    rest, bones = GIVEN.body.template, disturbed()
    crept = alternated(bones, rest, GIVEN.meshes).rms(rest, GIVEN.meshes)
    stepped = together(bones, rest, GIVEN.meshes)
    assert crept > 1e-4  # m
    assert stepped.rms(rest, GIVEN.meshes) < 1e-8
    np.testing.assert_allclose(stepped.weights.sum(axis=1), 1, atol=1e-12)
    assert (refined_at_once(bones, rest, GIVEN.meshes).weights > 0).sum(axis=1).max() <= 4


def test_what_bones_in_joints_must_leave_is_a_lower_bound() -> None:
    assert least_rms(GIVEN.meshes, 6) < 1e-7
    found = rig(GIVEN.meshes, GIVEN.body.faces, rest=GIVEN.body.template, bones=3)
    assert 1e-3 < least_rms(GIVEN.meshes, 3) < found.rms


def test_a_body_that_leaves_more_than_bones_must_is_said_not_to_be_certain() -> None:
    (said, _) = notes_of((), ("root", "bone_1"), 0, rms=5e-4, least=1e-5)
    assert "leaves 0.5 mm of the meshes" in said
    assert "they are not certain" in said
    assert len(notes_of((), ("root", "bone_1"), 0, rms=1.5e-5, least=1e-5)) == 1
