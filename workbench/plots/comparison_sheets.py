"""Figures of a comparison of solvers, in the size and style in which its report shows them."""

from collections.abc import Callable, Sequence
from functools import partial

from matplotlib.figure import Figure

from workbench.comparison import Comparison
from workbench.plots.accuracy import plot_accuracy
from workbench.plots.cost_traces import SECONDS, UNITS, plot_cost_traces, plot_waterfall
from workbench.plots.pairwise_wins import plot_pairwise_wins
from workbench.plots.profiles import plot_data_profile, plot_performance_profile
from workbench.plots.style import drawn, side_by_side
from workbench.plots.verdicts import plot_basins, plot_verdicts

WIDE = 8.0  # inches
Plot = Callable[..., object]  # called with ax=


def verdicts_sheet(comparison: Comparison) -> Figure:
    """The verdicts on the runs, a bar per solver."""
    return _bars(comparison, partial(plot_verdicts, comparison))


def basins_sheet(comparison: Comparison, problem: str) -> Figure:
    """The basins in which runs on one problem ended, a bar per solver."""
    return _bars(comparison, partial(plot_basins, comparison, problem))


def performance_profile_sheet(comparison: Comparison, taus: Sequence[float]) -> Figure:
    """The performance profiles at several targets, side by side."""
    return _curves(comparison, [partial(plot_performance_profile, comparison, t) for t in taus])


def data_profile_sheet(comparison: Comparison, taus: Sequence[float]) -> Figure:
    """The data profiles at several targets, side by side."""
    return _curves(comparison, [partial(plot_data_profile, comparison, t) for t in taus])


def cost_traces_sheet(comparison: Comparison, problem: str) -> Figure:
    """The cost of every run against effort and against time."""
    plot = partial(plot_cost_traces, comparison, problem)
    return _curves(comparison, [partial(plot, against=column) for column in (UNITS, SECONDS)])


def waterfall_sheet(comparison: Comparison, problem: str) -> Figure:
    """The sorted ends of every solver's runs."""
    return _curves(comparison, [partial(plot_waterfall, comparison, problem)], 6.0)


def pairwise_wins_sheet(comparison: Comparison) -> Figure:
    """The wins of each solver over each other one; the sheet grows with their number."""
    n = len(comparison.solvers)
    plot = partial(plot_pairwise_wins, comparison)
    figure = drawn(plot, min(WIDE, 2.6 + 0.75 * n), min(7.5, 1.8 + 0.5 * n))
    figure.axes[0].set_aspect("auto")
    return figure


def accuracy_sheet(comparison: Comparison) -> Figure:
    """The digits that every solver attained, a row per solver."""
    return drawn(partial(plot_accuracy, comparison), WIDE, 1.0 + 0.42 * len(comparison.solvers))


def _bars(comparison: Comparison, plot: Plot) -> Figure:
    return side_by_side([plot], WIDE, 1.5 + 0.36 * len(comparison.solvers), columns=4)


def _curves(comparison: Comparison, plots: Sequence[Plot], width: float = WIDE) -> Figure:
    """Plots side by side, with room for a line of the legend for every three solvers."""
    return side_by_side(plots, width, 3.6 + 0.2 * ((len(comparison.solvers) + 2) // 3), columns=3)
