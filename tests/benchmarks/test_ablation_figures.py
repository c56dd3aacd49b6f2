"""The figures of training draw what they are given."""

import numpy as np

from benchmarks.ablations.figures import (
    caption_pose_in_shape,
    caption_turn_errors,
    plot_pose_in_shape,
    plot_turn_errors,
)
from benchmarks.ablations.study import Ablated
from workbench.lectures.material.training_costs import caption_costs, plot_costs
from workbench.plots.figure import house_style, png, sheet
from workbench.training.progress import LogEntry

ZERO = dict.fromkeys(("E_D", "E_Y", "E_J", "E_P", "E_W"), 0.0)
LOG = (
    LogEntry("surfaces", ZERO | {"E_D": 100.0}, ZERO | {"E_D": 10.0, "E_P": 2.0}, {}, 1.0),
    LogEntry("poses", ZERO | {"E_D": 10.0, "E_P": 2.0}, ZERO | {"E_D": 5.0, "E_P": 2.0}, {}, 1.0),
)
RESULTS = (
    Ablated("all terms", 1e-3, 2e-3, 1e-3, 1e-3, (0.01, 0.02, 0.0)),
    Ablated("not pose-normalised", 1e-3, 2e-3, 1e-3, 1e-3, (0.9, 0.5, 0.3)),
)
ERRORS = {"edges": np.full((4, 3), 0.1), "vertices": np.full((4, 3), 0.2)}


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


def test_every_term_of_the_log_is_drawn() -> None:
    before, after = ({**ZERO, "E_D": cost, "E_T": cost / 4} for cost in (100.0, 10.0))
    with house_style():
        _, (ax,) = sheet(5, 4)
        plot_costs((LogEntry("surfaces", before, after, {}, 1.0),), ax=ax)
    drawn = {line.get_label(): list(line.get_ydata()) for line in ax.get_lines()}
    assert drawn == {"E_D": [100, 10], "E_T": [25, 2.5], "all": [125, 12.5]}


def test_shares_and_errors_are_drawn_in_their_units() -> None:
    with house_style():
        figure, axes = sheet(8, 4, 2)
        plot_pose_in_shape(RESULTS, ax=axes[0])
        plot_turn_errors(ERRORS, ax=axes[1])
        assert png(figure).startswith(b"\x89PNG")
    heights = [bar.get_height() for bar in axes[0].patches]
    np.testing.assert_allclose(heights, [1, 2, 0, 90, 50, 30])
    line = axes[1].get_lines()[0]
    np.testing.assert_allclose(np.asarray(line.get_xdata()), np.degrees(0.1))
    assert "4 made-up people" in caption_turn_errors(ERRORS)
    assert "with not pose-normalised: 90%" in caption_pose_in_shape(RESULTS)
    assert "with all terms: 2%" in caption_pose_in_shape(RESULTS[:1])
