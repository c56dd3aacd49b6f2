"""Basin maps, drawn."""

import numpy as np
import pytest

from workbench.errors import BadArgument
from workbench.plots import (
    caption_basin_grid,
    caption_basins,
    plot_basin_grid,
    plot_basins,
    png,
    sheet,
)
from workbench.registration import BasinMap, Stopped
from workbench.registration.basins import grid


def made_up(*axes: str, within: float = 60.0) -> BasinMap:
    """Starts up to an angle end at the truth, the others half a turn away."""
    angles = grid(axes, 30.0)
    found = np.abs(angles).max(axis=1) <= within
    S = len(angles)
    ends = np.where(found, 0.1, 180.0), np.where(found, 1e-4, 0.4)
    return BasinMap(axes, angles, *ends, np.full(S, 9), (Stopped.SETTLED,) * S)


def test_starts_at_the_truth_are_filled_and_the_others_empty() -> None:
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


def test_the_caption_says_how_far_the_basin_reaches() -> None:
    nowhere = made_up("z", within=-1)
    said = caption_basins([made_up("y"), nowhere])
    assert "truth for angles up to 60 degrees about y; for no range of angles about z." in said
    assert "within 20 mm on average" in said


def test_two_axes_are_a_table_of_colours() -> None:
    one = made_up("x", "z")
    figure, (ax,) = sheet(6, 5)
    plot_basin_grid(one, ax=ax)
    assert png(figure).startswith(b"\x89PNG")
    colours = np.asarray(ax.collections[0].get_array()).reshape(12, 12)  # z upwards, x across
    assert colours[4, 4] == 0.1
    assert colours[11, 4] == colours[4, 11] == 180
    assert len(ax.get_lines()[0].get_xdata()) == 144 - 25
    assert ax.get_xlabel() == "start turned about x (degrees)"
    assert "25 of 144 starts did." in caption_basin_grid(one)
    assert "about x and then about z" in caption_basin_grid(one)


def test_a_map_of_other_axes_is_told() -> None:
    _, (ax,) = sheet(4, 3)
    for maps in ([], [made_up("x", "y")]):
        with pytest.raises(BadArgument, match="maps of one axis"):
            plot_basins(maps, ax=ax)
        with pytest.raises(BadArgument, match="maps of one axis"):
            caption_basins(maps)
    with pytest.raises(BadArgument, match="a map of two axes, not of 1"):
        plot_basin_grid(made_up("x"), ax=ax)
