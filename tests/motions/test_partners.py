"""A motion is played on a body only if most of its joints have a partner there."""

from dataclasses import replace

import numpy as np
import pytest

from workbench import load_body
from workbench.errors import BadArgument
from workbench.motions.motion import Motion

BODY_JOINTS = load_body("small").joint_names


def motion(names: tuple[str, ...]) -> Motion:
    rng = np.random.default_rng(0)
    pose = 0.1 * rng.normal(size=(3, len(names), 3))
    return Motion(pose, np.zeros((3, 3)), 30.0, names, np.zeros(10))


def test_motion_with_few_known_joints_is_refused() -> None:
    names = tuple(name if k < 2 else f"bone{k}" for k, name in enumerate(BODY_JOINTS))
    with pytest.raises(BadArgument, match=r"2 have a partner.*rename the joints"):
        motion(names).named(load_body("small"))


def test_motion_of_a_part_is_played_and_the_rest_is_noted() -> None:
    part = BODY_JOINTS[:14]
    played = motion(part).named(load_body("small"))
    assert played.joint_names == BODY_JOINTS
    np.testing.assert_array_equal(played.pose[:, :14], motion(part).pose)
    assert any("stay at rest" in note for note in played.notes)
    again = replace(played).named(load_body("small"))
    np.testing.assert_array_equal(again.pose, played.pose)
