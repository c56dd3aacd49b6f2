"""What lecture 13 takes from its material: pose in shape directions, and costs of training."""

from math import nan

import numpy as np
import pytest

from workbench.lectures.material.pose_in_shape import aligned, pose_share
from workbench.synthetic.made_up import draw_registrations, jointed_tube, random_smpl
from workbench.training.registrations import InMemory


def test_pose_share_of_what_is_known() -> None:
    rng = np.random.default_rng(0)
    poses = rng.standard_normal((200, 3, 3))
    own = rng.standard_normal(200)
    pose_made = np.zeros((200, 4, 3))
    pose_made[:, 0, 0] = 3 * poses[:, 1, 2]
    pose_made[:, 1, 1] = 2 * own
    pose_made[:, 2, 2] = 1.0 * (poses[:, 2, 0] + rng.standard_normal(200))
    first, second, third = pose_share(pose_made, poses)
    assert first == pytest.approx(1, abs=0.02)
    assert second == pytest.approx(0, abs=0.1)
    assert third == pytest.approx(0.5, abs=0.12)
    assert all(np.isnan(share) for share in pose_share(pose_made[:5], poses[:5]))
    assert nan not in (first, second, third)


def test_aligned_meshes_lie_on_the_first() -> None:
    body = random_smpl(jointed_tube(7, 5), 2, seed=3, shape=0.005)
    data, _ = draw_registrations(body, 1, 3, seed=1, turn=0.01)
    moved = InMemory(data.vertices + np.arange(3)[:, None, None], data.subject)
    found = aligned(moved)
    assert np.abs(found - found[0]).max() < 0.02
