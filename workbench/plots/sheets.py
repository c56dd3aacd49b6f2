"""Each plot on a sheet of its own, in the size and style in which reports show it."""

from collections.abc import Mapping, Sequence
from itertools import islice

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from workbench.diagnostics import Diagnosis
from workbench.experiments.experiment import Outcome
from workbench.plots.body import plot_body, plot_shape_gallery
from workbench.plots.convergence import ITERATIONS, SECONDS, plot_convergence
from workbench.plots.direction import plot_direction
from workbench.plots.distances import plot_distances
from workbench.plots.figure import house_style, sheet
from workbench.plots.knowledge import plot_data_share, plot_sigmas
from workbench.plots.lettering import plain
from workbench.plots.overlay import plot_overlay
from workbench.plots.posterior import (
    plot_beside_laplace,
    plot_corner,
    plot_spray,
    plot_spray_in_view,
    plot_traces,
)
from workbench.plots.singular_values import plot_singular_values, unseen
from workbench.plots.sparsity import plot_sparsity
from workbench.plots.taylor import plot_taylor
from workbench.sampling import Posterior
from workbench.solvers import Solution

Array = NDArray[np.float64]


def overlay_sheet(outcome: Outcome, view: int) -> Figure:
    """One camera's view."""
    with house_style():
        figure, (ax,) = sheet(4.8, 6.2)
        plot_overlay(outcome, view, ax=ax)
    return figure


def convergence_sheet(solutions: Mapping[str, Solution]) -> Figure:
    """Against iterations and against time, with one legend."""
    with house_style():
        figure, axes = sheet(8.0, 3.7 + 0.2 * ((len(solutions) + 1) // 2), 2)
        for ax, against in zip(axes, (ITERATIONS, SECONDS), strict=True):
            plot_convergence(solutions, ax=ax, against=against)
            legend = ax.get_legend()
            if legend is not None:
                legend.remove()
        axes[1].set_ylabel("")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return figure


def sparsity_sheet(diagnosis: Diagnosis) -> Figure:
    """The Jacobian's pattern."""
    with house_style():
        figure, (ax,) = sheet(8.0, 5.4)
        plot_sparsity(diagnosis, ax=ax)
    return figure


def singular_values_sheet(diagnosis: Diagnosis) -> Figure:
    """The spectrum, as tall as the words beside it need."""
    with house_style():
        figure, (ax,) = sheet(8.0, max(4.2, 0.9 + 0.185 * len(unseen(diagnosis))))
        plot_singular_values(diagnosis, ax=ax)
    return figure


def sigmas_sheet(diagnosis: Diagnosis) -> Figure:
    """How well each unknown is known."""
    with house_style():
        figure, (ax,) = sheet(8.0, 4.4)
        plot_sigmas(diagnosis, ax=ax)
    return figure


def data_share_sheet(diagnosis: Diagnosis) -> Figure:
    """Data against priors."""
    with house_style():
        figure, (ax,) = sheet(8.0, 3.4)
        plot_data_share(diagnosis, ax=ax)
    return figure


def taylor_sheet(diagnosis: Diagnosis) -> Figure:
    """The order of the linear model's error."""
    with house_style():
        figure, (ax,) = sheet(6.0, 3.8)
        plot_taylor(diagnosis, ax=ax)
    return figure


def direction_sheet(moved: Mapping[str, Array], faces: NDArray[np.int64]) -> Figure:
    """A body moved along a direction."""
    with house_style():
        figure, (ax,) = sheet(8.0, 4.0)
        plot_direction(moved, faces, ax=ax)
        figure.set_figheight(_height(ax, 7.2))
    return figure


def body_sheet(vertices: Array, faces: NDArray[np.int64]) -> Figure:
    """Front and side."""
    with house_style():
        figure, (ax,) = sheet(8.0, 5.6)
        plot_body(vertices, faces, ax=ax)
        figure.set_figheight(_height(ax, 7.2))
    return figure


def shape_gallery_sheet(shapes: Mapping[str, Array], faces: NDArray[np.int64]) -> Figure:
    """The shapes in two rows on one scale: the first half above the second."""
    half = (len(shapes) + 1) // 2
    rows = [dict(islice(shapes.items(), half)), dict(islice(shapes.items(), half, None))]
    rows = [row for row in rows if row]
    with house_style():
        figure = Figure(figsize=(8.0, 5.8), layout="constrained")
        axes = list(figure.subplots(len(rows), 1, squeeze=False)[:, 0])
        for ax, row in zip(axes, rows, strict=True):
            plot_shape_gallery(row, faces, ax=ax)
            ax.set_xlabel("")
        widest = max(ax.get_xlim()[1] - ax.get_xlim()[0] for ax in axes)
        low, high = (pick(ax.get_ylim()[i] for ax in axes) for i, pick in ((0, min), (1, max)))
        for ax in axes:  # one scale for both
            middle = sum(ax.get_xlim()) / 2
            ax.set_xlim(middle - widest / 2, middle + widest / 2)
            ax.set_ylim(low, high)
        figure.set_figheight(sum(_height(ax, 7.2) for ax in axes))
    return figure


def distances_sheet(
    vertices: Array, distances: Array, faces: NDArray[np.int64], truth: str = "truth"
) -> Figure:
    """Front and back, with the scale in mm."""
    with house_style():
        figure, (ax,) = sheet(8.0, 4.8)
        plot_distances(vertices, distances, faces, ax=ax, truth=truth)
        figure.set_figheight(_height(ax, 6.2))
    return figure


def corner_sheet(
    posterior: Posterior, entries: Sequence[int], truth: Array | None = None
) -> Figure:
    """Entries in pairs, and the truth (k,) of synthetic data."""
    with house_style():
        size = max(3.6, 1.25 * len(entries) + 0.6)
        figure = Figure(figsize=(size, size))
        plot_corner(posterior, entries, figure, truth)
    return figure


def traces_sheet(
    posterior: Posterior, entries: Sequence[int], truth: Array | None = None
) -> Figure:
    """Entries along the chain, one above the other, and the truth (k,) of synthetic data."""
    with house_style():
        figure = Figure(figsize=(8.0, 0.5 + 1.1 * len(entries)), layout="constrained")
        axes = list(figure.subplots(len(entries), 1, squeeze=False, sharex=True)[:, 0])
        plot_traces(posterior, entries, axes, truth)
    return figure


def beside_laplace_sheet(
    posterior: Posterior, approximation: Posterior, truth: Array | None = None
) -> Figure:
    """Every entry against Laplace's approximation, and the truth (k,) of synthetic data."""
    with house_style():
        figure, (ax,) = sheet(8.0, 1.3 + 0.2 * posterior.size)
        plot_beside_laplace(posterior, approximation, truth, ax=ax)
    return figure


def spray_sheet(bodies: Array, faces: NDArray[np.int64], truth: Array | None = None) -> Figure:
    """Bodies over each other from the front and from the side, and a true one (N, 3) m."""
    with house_style():
        figure, (ax,) = sheet(8.0, 5.6)
        plot_spray(bodies, faces, truth, ax=ax)
        figure.set_figheight(_height(ax, 7.2))
    return figure


def spray_in_view_sheet(
    pixels: Array,
    faces: NDArray[np.int64],
    observed: Array,
    confidence: Array,
    title: str,
    truth: Array | None = None,
) -> Figure:
    """The same as a camera sees them; the true body's pixels are (N, 2)."""
    with house_style():
        figure, (ax,) = sheet(4.8, 6.2)
        plot_spray_in_view(pixels, faces, observed, confidence, truth, ax=ax)
        ax.set_title(plain(title), loc="left")
    return figure


def _height(ax: Axes, width: float) -> float:
    """Inches that axes of equal aspect need, `width` inches being free across, labels included."""
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    lines = max((label.get_text().count("\n") for label in ax.get_xticklabels()), default=0)
    return min(7.0, width * (top - bottom) / (right - left) + 0.7 + 0.15 * lines)
