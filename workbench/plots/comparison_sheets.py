"""Figures of a comparison of solvers, on sheets of their own."""

from collections.abc import Callable, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from workbench.comparison import Comparison
from workbench.plots.accuracy import plot_accuracy
from workbench.plots.cost_traces import SECONDS, UNITS, plot_cost_traces
from workbench.plots.duels import plot_duels
from workbench.plots.figure import house_style, sheet
from workbench.plots.profiles import plot_data_profile, plot_performance_profile
from workbench.plots.verdicts import plot_basins, plot_verdicts
from workbench.plots.waterfall import plot_waterfall

WIDE = 8.0  # inches


def verdicts_sheet(comparison: Comparison) -> Figure:
    """A bar per solver."""
    return _bars(comparison, lambda ax: plot_verdicts(comparison, ax=ax))


def basins_sheet(comparison: Comparison, problem: str) -> Figure:
    """A bar per solver, for one problem."""
    return _bars(comparison, lambda ax: plot_basins(comparison, problem, ax=ax))


def performance_profile_sheet(comparison: Comparison, taus: Sequence[float]) -> Figure:
    """One axes for each target."""
    return _for_targets(comparison, taus, plot_performance_profile)


def data_profile_sheet(comparison: Comparison, taus: Sequence[float]) -> Figure:
    """One axes for each target."""
    return _for_targets(comparison, taus, plot_data_profile)


def _for_targets(
    comparison: Comparison, taus: Sequence[float], plot: Callable[..., Axes]
) -> Figure:
    with house_style():
        figure, axes = sheet(WIDE, 3.6 + _rows(comparison), len(taus))
        for ax, tau in zip(axes, taus, strict=True):
            plot(comparison, tau, ax=ax)
        _legend(figure, axes)
    return figure


def cost_traces_sheet(comparison: Comparison, problem: str) -> Figure:
    """Against effort and against time."""
    with house_style():
        figure, axes = sheet(WIDE, 3.6 + _rows(comparison), 2)
        for ax, against in zip(axes, (UNITS, SECONDS), strict=True):
            plot_cost_traces(comparison, problem, ax=ax, against=against)
        _legend(figure, axes)
    return figure


def waterfall_sheet(comparison: Comparison, problem: str) -> Figure:
    """The sorted ends."""
    with house_style():
        figure, axes = sheet(6.0, 3.6 + _rows(comparison), 1)
        plot_waterfall(comparison, problem, ax=axes[0])
        _legend(figure, axes)
    return figure


def duels_sheet(comparison: Comparison) -> Figure:
    """As large as there are solvers."""
    n = len(comparison.solvers)
    with house_style():
        figure, (ax,) = sheet(min(WIDE, 2.6 + 0.75 * n), min(7.5, 1.8 + 0.5 * n))
        plot_duels(comparison, ax=ax)
        ax.set_aspect("auto")
    return figure


def accuracy_sheet(comparison: Comparison) -> Figure:
    """A row per solver."""
    with house_style():
        figure, (ax,) = sheet(WIDE, 1.0 + 0.42 * len(comparison.solvers))
        plot_accuracy(comparison, ax=ax)
    return figure


def _bars(comparison: Comparison, plot: Callable[[Axes], object]) -> Figure:
    with house_style():
        figure, (ax,) = sheet(WIDE, 1.5 + 0.36 * len(comparison.solvers))
        plot(ax)
        figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _rows(comparison: Comparison) -> float:
    """Inches that the legend below takes."""
    return 0.2 * ((len(comparison.solvers) + 2) // 3)


def _legend(figure: Figure, axes: Sequence[Axes]) -> None:
    for ax in axes[1:]:
        ax.set_ylabel("")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
