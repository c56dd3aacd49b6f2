"""Draws of a posterior: corner, traces, intervals, and bodies over each other."""

import warnings
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from scipy.ndimage import binary_closing

from workbench.arrays import Array, Index, Mask
from workbench.environment import optional_library
from workbench.plots.body import Look, front, side
from workbench.plots.palette import BLUE, FAINT, INK, LINES, VERMILLION
from workbench.plots.style import drawn, house_style, plain, to_scale
from workbench.sampling import Posterior

MOST = 6  # entries in a corner: more cannot be read
SHOWN = 5000  # draws
BESIDE_CORNER = 0.95  # inches for names and numbers, left of a corner and below it


def widest(posterior: Posterior, approximation: Posterior | None, most: int = MOST) -> list[int]:
    """The numbers of at most `most` entries to show: all, if there are no more than that.

    Otherwise these are the entries whose chains mix most slowly, and those whose mean or standard
    deviation differs most from the approximation's, such as that of Laplace.
    """
    if posterior.size <= most:
        return list(range(posterior.size))
    interest = posterior.mixing.times / posterior.mixing.times.max()
    if approximation is not None:
        interest = interest + np.abs(np.log(posterior.sd / approximation.sd))
        interest = interest + np.abs(posterior.mean - approximation.mean) / approximation.sd
    return sorted(int(i) for i in np.argsort(-interest)[:most])


def plot_corner(
    posterior: Posterior, entries: Sequence[int], figure: Figure, truth: Array | None = None
) -> Figure:
    """Each pair of entries as a cloud with contours, each entry as a histogram (corner.py).

    Contours hold 12, 39, 68 and 86 %: 1/2, 1, 3/2 and 2 sigma of a Gaussian in two dimensions.
    """
    chosen = list(entries)
    flat = posterior.flat[:: max(1, len(posterior.flat) // SHOWN)][:, chosen]
    entries_of = [posterior.labels[i].replace("[", "\n[") for i in chosen]
    units = [posterior.units[i] for i in chosen]
    labels = [plain(f"{entry}\n({unit})") for entry, unit in zip(entries_of, units, strict=True)]
    _corner()(
        flat,
        fig=figure,
        labels=labels,
        color=BLUE,
        truth_color=VERMILLION,
        truths=None if truth is None else list(truth[chosen]),
        max_n_ticks=3,
        labelpad=0.1,
        label_kwargs={"fontsize": 8},
        plot_datapoints=True,
        hist_kwargs={"linewidth": 1.2},
    )
    for ax in figure.axes:
        ax.tick_params(labelsize=7)
    width, height = figure.get_size_inches()
    left, bottom = BESIDE_CORNER / width, BESIDE_CORNER / height
    figure.subplots_adjust(left=left, bottom=bottom, right=0.99, top=0.99)
    return figure


def _corner() -> Any:
    """corner.py; it imports ArviZ, which announces its next version at every import."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"\s*ArviZ is undergoing", FutureWarning)
        return optional_library("corner", "a figure of each pair of entries of a posterior").corner


def plot_traces(
    posterior: Posterior, entries: Sequence[int], axes: Sequence[Axes], truth: Array | None = None
) -> None:
    """Each entry along the chain: the middle of each ensemble, and the span of its walkers.

    `truth` (k,) is what synthetic data were made of: a dashed line.
    """
    first, thin = posterior.mixing.discarded, posterior.mixing.thin
    for i, ax in zip(entries, axes, strict=True):
        for e, draws in enumerate(posterior.draws[..., i]):
            step = first + thin * np.arange(1, len(draws) + 1)
            colour = LINES[e % len(LINES)]
            low, high = np.quantile(draws, [0.05, 0.95], axis=1)
            ax.fill_between(step, low, high, color=colour, alpha=0.12, linewidth=0)
            ax.plot(step, np.median(draws, axis=1), color=colour, linewidth=0.9)
        if truth is not None:
            ax.axhline(truth[i], color=INK, linestyle="--", linewidth=1.2)  # no ensemble's colour
        name = posterior.labels[i].replace("[", "\n[")  # two lines: one would be clipped
        ax.set_ylabel(plain(f"{name} ({posterior.units[i]})"), fontsize=8)
        ax.grid(axis="y", color=FAINT, alpha=0.25, linewidth=0.6)
    axes[-1].set_xlabel("step of each walker")


def plot_beside_laplace(
    posterior: Posterior, approximation: Posterior, truth: Array | None = None, *, ax: Axes
) -> Axes:
    """The interval of 90 % of each entry's draws, in Laplace's standard deviations.

    `truth` (k,) are the values from which synthetic data were made; they are drawn as crosses.
    """
    z = (posterior.flat - approximation.mean) / approximation.sd
    low, middle, high = np.quantile(z, [0.05, 0.5, 0.95], axis=0)
    place = np.arange(posterior.size)
    ax.axvspan(-1.645, 1.645, color=FAINT, alpha=0.2, linewidth=0, label="Laplace, 90 %")
    ax.hlines(place, low, high, color=BLUE, linewidth=2.0, label="draws, 90 %")
    ax.plot(middle, place, "o", color=INK, markersize=3.5, label="draws, median")
    if truth is not None:
        where = (truth - approximation.mean) / approximation.sd
        ax.plot(where, place, "x", color=VERMILLION, markersize=6, label="truth (synthetic)")
    ax.set_yticks(place, [plain(label) for label in posterior.labels], fontsize=8)
    ax.set_ylim(posterior.size - 0.4, -0.6)  # the first entry on top
    ax.set_xlabel("distance from Laplace's mean (its standard deviations)")
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=4, borderaxespad=0)
    return ax


def plot_spray(
    bodies: Array,
    faces: Index,
    truth: Array | None = None,
    *,
    ax: Axes,
    looks: Sequence[Look] = (front, side),
) -> Axes:
    """How many of M drawn bodies (M, N, 3) m cover each place, seen from the front and the side.

    `truth` (N, 3) m is the body from which synthetic data were made; it is drawn as an outline.
    """
    at, placed = 0.0, []
    everybody = bodies if truth is None else np.concatenate([bodies, truth[None]])
    for look in looks:
        seen = np.stack([look(one) for one in everybody])[..., :2]
        left, right = float(seen[..., 0].min()), float(seen[..., 0].max())
        placed.append(seen + [at - left, 0.0])
        at += right - left + 0.15
    everything = np.concatenate(placed)
    low = everything.min(axis=(0, 1)) - 0.05
    high = everything.max(axis=(0, 1)) + 0.05
    for seen in placed:
        own = [seen.min(axis=(0, 1)) - 0.05, seen.max(axis=(0, 1)) + 0.05]
        draw_silhouettes(seen[: len(bodies)], faces, *own, ax=ax)
        if truth is not None:
            draw_outline(seen[-1], faces, *own, ax=ax)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", ylabel="y (m)")
    ax.set_xlabel("from the front, and from the right: the same scale across as up")
    return ax


def plot_spray_in_view(
    pixels: Array,
    faces: Index,
    observed: Array,
    confidence: Array,
    truth: Array | None = None,
    *,
    ax: Axes,
) -> Axes:
    """Draws (M, N, 2) px as one camera sees them, and the keypoints that it saw.

    `truth` (N, 2) px is the body that synthetic data were made of: an outline.
    """
    seen = observed[confidence > 0]
    shown = np.vstack([pixels.reshape(-1, 2), seen])
    low, high = np.quantile(shown[np.isfinite(shown).all(axis=1)], [0.001, 0.999], axis=0)
    low, high = low - 0.08 * (high - low), high + 0.08 * (high - low)
    draw_silhouettes(pixels, faces, low, high, ax=ax)
    if truth is not None:
        draw_outline(truth, faces, low, high, ax=ax)
    ax.plot(*seen.T, "o", color=VERMILLION, markersize=5, markerfacecolor="none", label="observed")
    ax.set(xlim=(low[0], high[0]), ylim=(high[1], low[1]), aspect="equal")  # v down
    ax.set(xlabel="u (px)", ylabel="v (px)")
    ax.legend(loc="lower right", bbox_to_anchor=(1, 1))
    return ax


MADE_OF = " The data are synthetic, and the values that they were made of are marked"


def caption_corner(posterior: Posterior, shown: int, synthetic: bool = False) -> str:
    """What `plot_corner` shows."""
    some = f"{shown} of {posterior.size} entries" if shown < posterior.size else "every entry"
    return (
        f"The draws of {some}, in pairs. In a round cloud two entries are known "
        "independently; in a long one only a combination of them is. Contours hold 12, 39, 68 "
        "and 86 % of the draws." + (f"{MADE_OF}: red lines." if synthetic else "")
    )


def caption_traces(posterior: Posterior, synthetic: bool = False) -> str:
    """What `plot_traces` shows."""
    return (
        f"The median of each ensemble and the range of nine tenths of its walkers, after "
        f"{posterior.mixing.discarded} discarded steps. Chains that have mixed look like noise "
        "around one level, the same for all ensembles."
        + (f"{MADE_OF}: a dashed black line." if synthetic else "")
    )


def caption_beside_laplace(said: Sequence[str], synthetic: bool = False) -> str:
    """What `plot_beside_laplace` shows."""
    agree = sum(one == "agrees" for one in said)
    return (
        f"Laplace's approximation agrees with the draws in {agree} of {len(said)} entries. Where a "
        "bar sticks out of the grey band, or is not in its middle, the posterior is curved or has "
        "several modes." + (f"{MADE_OF}: red crosses." if synthetic else "")
    )


def caption_spray(count: int, where: str, synthetic: bool = False, held: bool = False) -> str:
    """What `plot_spray` and `plot_spray_in_view` show; `held` if some unknowns are held fixed."""
    return (
        f"{count} bodies drawn from the posterior, {where}: white pixels are covered by none, "
        "full blue by all. Where the outline is blurred, data and priors do not determine the "
        "body."
        + (" Unknowns that are held fixed are the same in all of them." if held else "")
        + (f"{MADE_OF}: the red outline of that body." if synthetic else "")
    )


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
    return to_scale(partial(plot_spray, bodies, faces, truth), 5.6)


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


FINE = 420  # dots along the longer side
DENSEST = 24  # points along a face's side
SHADES = LinearSegmentedColormap.from_list("covered", ["#ffffff", BLUE])


def silhouette(flat: Array, faces: Index, low: Array, dot: float, shape: tuple[int, int]) -> Mask:
    """The pixels (rows, columns) that a drawn mesh covers, `low` being the lower left corner.

    `flat` (N, 2) holds the drawn vertices, and `dot` is the size of a pixel in their unit. Every
    face is sampled at points one pixel apart; gaps of one pixel are closed.
    """
    corners = ((flat - low) / dot)[faces]  # (F, 3, 2): column, row
    corners = corners[np.isfinite(corners).all(axis=(1, 2))]
    longest = np.ptp(corners, axis=1).max(initial=0.0)
    n = int(np.clip(np.ceil(longest), 2, DENSEST))
    i, j = np.divmod(np.arange((n + 1) ** 2), n + 1)
    weights = np.column_stack([i, j, n - i - j])[i + j <= n] / n
    places = np.floor(np.einsum("pc,fcd->fpd", weights, corners)).reshape(-1, 2)
    inside = ((places >= 0) & (places < [shape[1], shape[0]])).all(axis=1)
    column, row = places[inside].astype(np.int64).T
    covered = np.zeros(shape, dtype=bool)
    covered[row, column] = True
    return np.asarray(binary_closing(np.pad(covered, 2), np.ones((3, 3), dtype=bool))[2:-2, 2:-2])


def draw_silhouettes(flats: Array, faces: Index, low: Array, high: Array, *, ax: Axes) -> None:
    """The share of drawn meshes (M, N, 2) that covers each pixel: white for none, blue for all."""
    dot, columns, rows = _grid(low, high)
    share = np.zeros((rows, columns))
    for flat in flats:
        share += silhouette(flat, faces, low, dot, (rows, columns))
    ends = low + dot * np.array([columns, rows])
    ax.imshow(
        share / len(flats),
        cmap=SHADES,
        vmin=0,
        vmax=1,
        origin="lower",
        interpolation="nearest",
        extent=(low[0], ends[0], low[1], ends[1]),
        zorder=0.5,
    )


def draw_outline(flat: Array, faces: Index, low: Array, high: Array, *, ax: Axes) -> None:
    """The outline of one drawn mesh (N, 2)."""
    dot, columns, rows = _grid(low, high)
    covered = silhouette(flat, faces, low, dot, (rows, columns))
    if covered.any() and not covered.all():
        across, up = (low[i] + dot * (np.arange(n) + 0.5) for i, n in enumerate((columns, rows)))
        ax.contour(
            across,
            up,
            covered.astype(float),
            levels=[0.5],
            colors=VERMILLION,
            linewidths=1.0,
            zorder=0.6,
        )


def _grid(low: Array, high: Array) -> tuple[float, int, int]:
    """The size of a pixel, and how many columns and rows of them there are."""
    dot = float((high - low).max()) / FINE
    columns, rows = (int(n) for n in np.ceil((high - low) / dot))
    return dot, columns, rows
