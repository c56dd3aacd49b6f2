"""What lecture 13 takes from its material: pose in shape directions, and costs of training."""

from math import nan

import numpy as np
import pytest

from workbench.lectures.material.pose_in_shape import aligned, pose_share
from workbench.lectures.material.training_costs import caption_costs, plot_costs
from workbench.plots.style import house_style, png, sheet
from workbench.synthetic.made_up import draw_registrations, jointed_tube, random_smpl
from workbench.training.execution import LogEntry
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


ZERO = dict.fromkeys(("E_D", "E_Y", "E_J", "E_P", "E_W"), 0.0)
LOG = (
    LogEntry("surfaces", ZERO | {"E_D": 100.0}, ZERO | {"E_D": 10.0, "E_P": 2.0}, {}, 1.0),
    LogEntry("poses", ZERO | {"E_D": 10.0, "E_P": 2.0}, ZERO | {"E_D": 5.0, "E_P": 2.0}, {}, 1.0),
)


def test_costs_are_drawn_block_by_block() -> None:
    with house_style():
        figure, (ax,) = sheet(5, 4)
        plot_costs(LOG, ax=ax)
        total = ax.get_lines()[-1].get_ydata()
        assert png(figure).startswith(b"\x89PNG")
    np.testing.assert_array_equal(np.asarray(total), [100, 12, 7])
    assert [line.get_label() for line in ax.get_lines()] == ["E_D", "E_P", "all"]
    assert "from 100 to 7" in caption_costs(LOG)
    assert "falls in every block" in caption_costs(LOG)
    rising = (LOG[0], LogEntry("poses", LOG[0].after, ZERO | {"E_D": 20.0}, {}, 1.0))
    assert "falls in 1 of 2 blocks" in caption_costs(rising)
