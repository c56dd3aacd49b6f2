"""What is known of each unknown, and how much of it comes from the data."""

import numpy as np
from matplotlib.axes import Axes

from workbench.diagnostics import Diagnosis
from workbench.plots.palette import BLUE, FAINT, LINES, MARKERS, VERMILLION

BIGGEST = 1e3  # sigmas above are drawn at the edge: the direction is not seen


def plot_sigmas(diagnosis: Diagnosis, *, ax: Axes) -> Axes:
    """Posterior standard deviation of every entry, block by block, and its prior's as a dash."""
    known = diagnosis.identifiability
    for i, block in enumerate(diagnosis.free.blocks):
        at = diagnosis.free.slices[block.name]
        x = np.arange(at.start, at.stop)
        sigma, prior = known.sigma[at], known.prior_sigma[at]
        seen = sigma < BIGGEST
        colour = LINES[i % len(LINES)]
        ax.plot(
            x[seen], sigma[seen], MARKERS[i % len(MARKERS)], color=colour, markersize=4,
            linestyle="none", label=f"{block.name} ({block.unit})",
        )  # fmt: skip
        finite = np.isfinite(prior)
        ax.plot(x[finite], prior[finite], "_", color=colour, markersize=7, linestyle="none")
        ax.axvline(at.stop - 0.5, color=FAINT, linewidth=0.6, alpha=0.5)
    blind = np.flatnonzero(known.sigma >= BIGGEST)
    if blind.size:
        ax.plot(
            blind, np.full(blind.size, BIGGEST), "^", color=VERMILLION, markersize=5,
            markerfacecolor="none", linestyle="none", label="not seen",
        )  # fmt: skip
    ax.set_yscale("log")
    ax.set_xlabel("entry, in the order of the table below")
    ax.set_ylabel("standard deviation (the entry's unit)")
    ax.grid(axis="y", color=FAINT, alpha=0.25, linewidth=0.6)
    ax.legend(loc="upper right", ncols=2)
    ax.margins(x=0.01)
    low, high = ax.get_ylim()
    ax.set_ylim(low, high * 30)
    return ax


def caption_sigmas(diagnosis: Diagnosis) -> str:
    """What `plot_sigmas` shows."""
    known = diagnosis.identifiability
    blind = int(np.sum(~np.isfinite(known.sigma)))
    said = [
        "How well each unknown is known: its standard deviation in Laplace's approximation, the "
        "lower the better."
    ]
    if diagnosis.priors:
        said.append("Dashes are what the priors alone say; a mark on its dash learnt nothing.")
    if blind:
        said.append(f"{blind} entries take part in directions that nobody sees: hollow triangles.")
    return " ".join(said)


def plot_data_share(diagnosis: Diagnosis, *, ax: Axes) -> Axes:
    """For every direction, best known first, the share of its information that the data bring."""
    share = np.sort(diagnosis.identifiability.data_share)[::-1]
    x = np.arange(1, share.size + 1)
    ax.fill_between(x, share, step="mid", color=BLUE, alpha=0.25, linewidth=0)
    ax.step(x, share, where="mid", color=BLUE)
    ax.axhline(0.5, color=VERMILLION, linewidth=1.0, linestyle="--")
    ax.annotate(
        "half from the data", (1.0, 0.5), xycoords=("axes fraction", "data"), xytext=(-4, 4),
        textcoords="offset points", ha="right", color=VERMILLION, fontsize=9,
    )  # fmt: skip
    ax.set_ylim(0, 1.04)
    ax.set_xlim(0.5, share.size + 0.5)
    ax.set_xlabel("direction, those that the data know best first")
    ax.set_ylabel("share from the data (0 to 1)")
    ax.set_title(
        f"the data decide {share.sum():.1f} of {diagnosis.shape[1]} directions", loc="left"
    )
    return ax


def caption_data_share(diagnosis: Diagnosis) -> str:
    """What `plot_data_share` shows."""
    known = diagnosis.identifiability
    return (
        f"How much of what is known comes from the data, and how much from "
        f"{' and '.join(diagnosis.priors)}. {known.better_from_data} directions are better known "
        f"from the data; the area under the curve, {known.effective:.1f}, is the number of "
        "effective degrees of freedom."
    )
