"""Figures of a comparison: what they draw is what the numbers say."""

from functools import partial

import numpy as np
import pytest
from matplotlib.axes import Axes

from tests.comparison.made_up import comparison
from tests.tiers import few
from workbench.comparison import Comparison
from workbench.plots.comparison import (
    EFFORT,
    LEAST_DRAWN,
    caption_cost_traces,
    caption_data_profile,
    caption_performance_profile,
    cost_traces_sheet,
    curves_sheet,
    plot_cost_traces,
    plot_data_profile,
    plot_performance_profile,
    verdicts_sheet,
)
from workbench.plots.style import sheet

RUNS = {
    ("p", "good"): [50.0, 9.0, 0.0],
    ("p", "$x$ 左"): [100.0, 10.0, 4.0],
    ("p", "bad"): [],
    ("q", "good"): [90.0, 0.0],
    ("q", "$x$ 左"): [0.0],
    ("q", "bad"): [],
}


@pytest.fixture
def found() -> Comparison:
    return comparison(RUNS, basins={("p", "$x$ 左"): 1})


@pytest.fixture
def ax() -> Axes:
    return sheet(4, 3)[1][0]


def test_performance_profile_ends_at_the_rate_of_success(found: Comparison, ax: Axes) -> None:
    plot_performance_profile(found, 1e-3, ax=ax)
    ends = [float(np.asarray(line.get_ydata())[-1]) for line in ax.get_lines()]
    np.testing.assert_array_equal(ends, [1.0, 0.5, 0.0])  # and none is shifted off 0 or 100 %
    assert "must not be read as a ranking" in caption_performance_profile(found)
    two = comparison({k: v for k, v in RUNS.items() if k[1] != "bad"})
    assert "ranking" not in caption_performance_profile(two)


def test_data_profile_rises_where_a_target_is_met(found: Comparison, ax: Axes) -> None:
    plot_data_profile(found, 1e-3, ax=ax)
    x, y = (np.asarray(d, dtype=float) for d in ax.get_lines()[0].get_data())
    assert y[x < 0.99].max() < 0.05  # 2 and 3 residuals over n + 1 = 2
    assert y[(x > 1.01) & (x < 1.49)] == pytest.approx(0.5, abs=0.01)
    assert "n + 1 residuals" in caption_data_profile(found)


def test_cost_traces_begin_at_the_first_point_and_never_rise(found: Comparison, ax: Axes) -> None:
    plot_cost_traces(found, "p", ax=ax, against=EFFORT)
    y = np.asarray(ax.get_lines()[0].get_ydata(), dtype=float)
    assert y[0] == pytest.approx(0.5)
    assert y[-1] == LEAST_DRAWN
    assert (np.diff(y) <= 0).all()
    assert "one run of each solver" in caption_cost_traces(found, "p")


WHATEVER = {
    "all": RUNS,
    "alone": {("p", "alone"): [3.0]},
    "none": {("p", "a"): [], ("p", "b"): []},
    "many": {("p", f"solver {k}"): [float(k)] for k in range(20)},
    "not finite": {("p", "a"): [np.nan, np.inf], ("p", "b"): [1.0]},
}


@pytest.mark.parametrize("name", few(WHATEVER, 0))
def test_sheets_are_drawn_of_whatever_runs_there_are(name: str) -> None:
    found = comparison(WHATEVER[name])
    profiles = [
        partial(plot, found, tau)
        for plot in (plot_performance_profile, plot_data_profile)
        for tau in found.taus[:2]
    ]
    for figure in (
        verdicts_sheet(found),
        curves_sheet(found, profiles),
        cost_traces_sheet(found, "p"),
    ):
        figure.draw_without_rendering()
