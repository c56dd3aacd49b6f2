"""Draws of a posterior: corner, traces, intervals, and bodies over each other."""

import warnings
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from workbench.arrays import Array
from workbench.environment import optional_library
from workbench.plots.palette import BLUE, FAINT, INK, LINES, VERMILLION
from workbench.plots.style import figure_of, house_style, plain
from workbench.sampling import Posterior

MOST_ENTRIES = 6  # entries in a corner: more cannot be read
MOST_DRAWS = 5000  # draws
BESIDE_CORNER = 0.95  # inches for names and numbers, left of a corner and below it


def widest(posterior: Posterior, most: int = MOST_ENTRIES) -> list[int]:
    """The numbers of at most `most` entries to show: those whose chains mix most slowly."""
    slowest = np.argsort(-posterior.mixing.times, kind="stable")
    return sorted(int(i) for i in slowest[:most])


def corner_sheet(
    posterior: Posterior, entries: Sequence[int], truth: Array | None = None
) -> Figure:
    """Each pair of entries as a cloud with contours, each entry as a histogram (corner.py).

    Contours hold 12, 39, 68 and 86 %: 1/2, 1, 3/2 and 2 sigma of a Gaussian in two dimensions.
    `truth` (k,) is marked if it is known.
    """
    chosen = list(entries)
    flat = posterior.flat[:: max(1, len(posterior.flat) // MOST_DRAWS)][:, chosen]
    entries_of = [posterior.labels[i].replace("[", "\n[") for i in chosen]
    units = [posterior.units[i] for i in chosen]
    labels = [plain(f"{entry}\n({unit})") for entry, unit in zip(entries_of, units, strict=True)]
    size = max(3.6, 1.25 * len(chosen) + 1.0)  # inches
    with house_style():
        figure = Figure(figsize=(size, size))
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
        beside = BESIDE_CORNER / size
        figure.subplots_adjust(left=beside, bottom=beside, right=0.99, top=0.99)
    return figure


def _corner() -> Any:
    """corner.py; it imports ArviZ, which announces its next version at every import."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"\s*ArviZ is undergoing", FutureWarning)
        return optional_library("corner", "a figure of each pair of entries of a posterior").corner


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


MADE_OF = " The data are synthetic, and the values that they were made of are marked"


def caption_corner(posterior: Posterior, shown: int, synthetic: bool = False) -> str:
    """What `corner_sheet` shows."""
    some = f"{shown} of {posterior.size} entries" if shown < posterior.size else "every entry"
    return (
        f"The draws of {some}, in pairs. In a round cloud two entries are known "
        "independently; in a long one only a combination of them is. Contours hold 12, 39, 68 "
        "and 86 % of the draws." + (f"{MADE_OF}: red lines." if synthetic else "")
    )


def caption_traces(posterior: Posterior, synthetic: bool = False) -> str:
    """What `traces_sheet` shows."""
    return (
        f"The median of each ensemble and the range of nine tenths of its walkers, after "
        f"{posterior.mixing.discarded} discarded steps. Chains that have mixed look like noise "
        "around one level, the same for all ensembles."
        + (f"{MADE_OF}: a dashed black line." if synthetic else "")
    )


def caption_beside_laplace(remarks: Sequence[str], synthetic: bool = False) -> str:
    """What `plot_beside_laplace` shows."""
    agree = sum(remark == "agrees" for remark in remarks)
    return (
        f"Laplace's approximation agrees with the draws in {agree} of {len(remarks)} entries. "
        "Where a bar sticks out of the grey band, or is not in its middle, the posterior is curved "
        "or has several modes." + (f"{MADE_OF}: red crosses." if synthetic else "")
    )


def traces_sheet(
    posterior: Posterior, entries: Sequence[int], truth: Array | None = None
) -> Figure:
    """Each entry along the chain: the middle of each ensemble, and the span of its walkers.

    `truth` (k,) is what synthetic data were made of: a dashed line.
    """
    first, thin = posterior.mixing.discarded, posterior.mixing.thin
    with house_style():
        figure = Figure(figsize=(8.0, 0.5 + 1.1 * len(entries)), layout="constrained")
        axes = list(figure.subplots(len(entries), 1, squeeze=False, sharex=True)[:, 0])
        for i, ax in zip(entries, axes, strict=True):
            for e, draws in enumerate(posterior.draws[..., i]):
                step = first + thin * np.arange(1, len(draws) + 1)
                colour = LINES[e % len(LINES)]
                low, high = np.quantile(draws, [0.05, 0.95], axis=1)
                ax.fill_between(step, low, high, color=colour, alpha=0.12, linewidth=0)
                ax.plot(step, np.median(draws, axis=1), color=colour, linewidth=0.9)
            if truth is not None:  # in no ensemble's colour
                ax.axhline(truth[i], color=INK, linestyle="--", linewidth=1.2)
            name = posterior.labels[i].replace("[", "\n[")  # two lines: one would be clipped
            ax.set_ylabel(plain(f"{name} ({posterior.units[i]})"), fontsize=8)
            ax.grid(axis="y", color=FAINT, alpha=0.25, linewidth=0.6)
        axes[-1].set_xlabel("step of each walker")
    return figure


def beside_laplace_sheet(
    posterior: Posterior, approximation: Posterior, truth: Array | None = None
) -> Figure:
    """Every entry beside Laplace's approximation; `truth` (k,) is marked if it is known."""
    return figure_of(
        partial(plot_beside_laplace, posterior, approximation, truth),
        8.0,
        1.3 + 0.2 * posterior.size,
    )
