"""Figures of registrations: maps of basins, and the joint cost."""

import numpy as np

from workbench.lectures.material.basins import caption_basins, plot_basins
from workbench.plots import png, sheet
from workbench.plots.scans import plot_joint_cost
from workbench.registration import BasinMap, Stopped
from workbench.registration.basins import grid
from workbench.training.execution import LogEntry


def made_up(*axes: str, within: float = 60.0) -> BasinMap:
    """Starts up to an angle end at the truth, the others half a turn away."""
    angles = grid(axes, 30.0)
    found = np.abs(angles).max(axis=1) <= within
    S = len(angles)
    ends = np.where(found, 0.1, 180.0), np.where(found, 1e-4, 0.4)
    return BasinMap(axes, angles, *ends, np.full(S, 9), (Stopped.SETTLED,) * S)


def test_basins_fill_starts_that_end_at_the_truth() -> None:
    figure, (ax,) = sheet(6, 4)
    assert plot_basins([made_up("y"), made_up("z", within=30)], ax=ax) is ax
    assert png(figure).startswith(b"\x89PNG")
    line, filled, empty, *others = ax.get_lines()
    assert line.get_xdata().tolist() == list(range(-150, 181, 30))
    assert filled.get_xdata().tolist() == [-60, -30, 0, 30, 60]
    assert set(empty.get_ydata()) == {180.0}
    assert empty.get_markerfacecolor() == "white"
    assert others[1].get_xdata().tolist() == [-30, 0, 30]
    legend = ax.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["about y", "about z"]
    assert "degrees" in ax.get_xlabel()
    assert "degrees" in ax.get_ylabel()


def test_caption_says_how_far_a_basin_reaches() -> None:
    nowhere = made_up("z", within=-1)
    said = caption_basins([made_up("y"), nowhere])
    assert "truth for angles up to 60 degrees about y; for no range of angles about z." in said
    assert "within 20 mm on average" in said


def test_joint_cost_draws_more_terms_than_there_are_marks() -> None:
    costs = {f"E_{k}": 1.0 + k for k in range(12)}
    _, (ax,) = sheet(4, 3)
    plot_joint_cost([LogEntry("model", costs, {name: 0.5 for name in costs}, {}, 0.0)], ax=ax)
    assert len(ax.get_lines()) == 13
    assert ax.get_lines()[0].get_ydata().tolist() == [78.0, 6.0]
