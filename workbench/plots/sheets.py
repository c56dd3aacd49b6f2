"""Whole figures whose size, legend or scale depends on what is drawn in them."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import islice

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from workbench.arrays import Array, Index
from workbench.bodies.capsules import PosedCapsules
from workbench.diagnostics import Diagnosis
from workbench.plots.body import plot_body, plot_shape_gallery
from workbench.plots.capsules import plot_capsules
from workbench.plots.convergence import ITERATIONS, SECONDS, plot_convergence
from workbench.plots.direction import plot_direction
from workbench.plots.distances import plot_distances
from workbench.plots.figure import drawn, house_style, side_by_side
from workbench.plots.labels import plain
from workbench.plots.posterior import (
    plot_beside_laplace,
    plot_corner,
    plot_spray,
    plot_spray_in_view,
    plot_traces,
)
from workbench.plots.singular_values import plot_singular_values, unseen
from workbench.plots.sparsity import plot_sparsity
from workbench.sampling import Posterior
from workbench.solvers import Solution


def convergence_sheet(solutions: Mapping[str, Solution]) -> Figure:
    """Convergence against iterations and against time, with one legend."""
    plots = [partial(plot_convergence, solutions, against=a) for a in (ITERATIONS, SECONDS)]
    return side_by_side(plots, 8.0, 3.7 + 0.2 * ((len(solutions) + 1) // 2), columns=2)


def sparsity_sheet(diagnosis: Diagnosis) -> Figure:
    """The sparsity pattern of the Jacobian."""
    return drawn(partial(plot_sparsity, diagnosis), 8.0, 5.4)


def singular_values_sheet(diagnosis: Diagnosis) -> Figure:
    """The singular values, as tall as the text beside them needs."""
    return drawn(
        partial(plot_singular_values, diagnosis),
        8.0,
        max(4.2, 0.9 + 0.185 * len(unseen(diagnosis))),
    )


def direction_sheet(moved: Mapping[str, Array], faces: Index) -> Figure:
    """A body moved along a direction of the unknowns."""
    return _to_scale(partial(plot_direction, moved, faces), 4.0)


def body_sheet(vertices: Array, faces: Index) -> Figure:
    """A body from the front and from the side."""
    return _to_scale(partial(plot_body, vertices, faces), 5.6)


def capsules_sheet(vertices: Array, faces: Index, posed: PosedCapsules) -> Figure:
    """A body with its capsules from the front and from the side."""
    return _to_scale(partial(plot_capsules, vertices, faces, posed), 5.6)


def shape_gallery_sheet(shapes: Mapping[str, Array], faces: Index) -> Figure:
    """Shapes in two rows on one scale."""
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
            ax.set(xlim=(middle - widest / 2, middle + widest / 2), ylim=(low, high))
        figure.set_figheight(sum(_height(ax, 7.2) for ax in axes))
    return figure


def distances_sheet(
    vertices: Array, distances: Array, faces: Index, truth: str = "truth"
) -> Figure:
    """A body from the front and the back, coloured by distances in mm."""
    plot = partial(plot_distances, vertices, distances, faces, truth=truth)
    return _to_scale(plot, 4.8, 6.2)


def corner_sheet(
    posterior: Posterior, entries: Sequence[int], truth: Array | None = None
) -> Figure:
    """Draws of pairs of entries; `truth` (k,) is marked if it is known."""
    with house_style():
        size = max(3.6, 1.25 * len(entries) + 1.0)
        figure = Figure(figsize=(size, size))
        plot_corner(posterior, entries, figure, truth)
    return figure


def traces_sheet(
    posterior: Posterior, entries: Sequence[int], truth: Array | None = None
) -> Figure:
    """Entries along the chain, one above the other; `truth` (k,) is marked if it is known."""
    with house_style():
        figure = Figure(figsize=(8.0, 0.5 + 1.1 * len(entries)), layout="constrained")
        axes = list(figure.subplots(len(entries), 1, squeeze=False, sharex=True)[:, 0])
        plot_traces(posterior, entries, axes, truth)
    return figure


def beside_laplace_sheet(
    posterior: Posterior, approximation: Posterior, truth: Array | None = None
) -> Figure:
    """Every entry beside Laplace's approximation; `truth` (k,) is marked if it is known."""
    return drawn(
        partial(plot_beside_laplace, posterior, approximation, truth),
        8.0,
        1.3 + 0.2 * posterior.size,
    )


def spray_sheet(bodies: Array, faces: Index, truth: Array | None = None) -> Figure:
    """Drawn bodies over each other from the front and the side, and the true one (N, 3) m."""
    return _to_scale(partial(plot_spray, bodies, faces, truth), 5.6)


def spray_in_view_sheet(
    pixels: Array,
    faces: Index,
    observed: Array,
    confidence: Array,
    title: str,
    truth: Array | None = None,
) -> Figure:
    """Drawn bodies over each other as a camera sees them, and the true one (N, 2) px."""
    plot = partial(plot_spray_in_view, pixels, faces, observed, confidence, truth)
    figure = drawn(plot, 4.8, 6.2)
    with house_style():
        figure.axes[0].set_title(plain(title), loc="left")
    return figure


def _to_scale(plot: Callable[..., object], height: float, width: float = 7.2) -> Figure:
    """A figure as high as axes of equal aspect need that have `width` inches across."""
    figure = drawn(plot, 8.0, height)
    with house_style():
        figure.set_figheight(_height(figure.axes[0], width))
    return figure


def _height(ax: Axes, width: float) -> float:
    """The height in inches of axes of equal aspect, labels included, `width` inches across."""
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    lines = max((label.get_text().count("\n") for label in ax.get_xticklabels()), default=0)
    return min(7.0, width * (top - bottom) / (right - left) + 0.7 + 0.15 * lines)
