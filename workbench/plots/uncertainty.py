"""The standard deviation of each unknown, and how much information comes from the data."""

import numpy as np
from matplotlib.axes import Axes

from workbench.arrays import Index
from workbench.diagnostics import Diagnosis
from workbench.errors import BadArgument
from workbench.plots.labels import note_at
from workbench.plots.palette import BLUE, FAINT, LINES, MARKERS, VERMILLION


def plot_sigmas(diagnosis: Diagnosis, *, ax: Axes) -> Axes:
    """Posterior standard deviation of every entry, block by block, and its prior's as a dash."""
    known = diagnosis.identifiability
    for i, block in enumerate(diagnosis.free.blocks):
        at = diagnosis.free.slices[block.name]
        x = np.arange(at.start, at.stop)
        sigma, prior = known.sigma[at], known.prior_sigma[at]
        seen = np.isfinite(sigma) & (sigma > 0)  # one that a bound fixes has none to draw
        colour, marker = LINES[i % len(LINES)], MARKERS[i % len(MARKERS)]
        # Of a block of which nothing is known only the strips tell.
        label = f"{block.name} ({block.unit})" if seen.any() else None
        ax.plot(x[seen], sigma[seen], marker, color=colour, markersize=4, label=label)
        finite = np.isfinite(prior)
        ax.plot(x[finite], prior[finite], "_", color=colour, markersize=7)
        ax.axvline(at.stop - 0.5, color=FAINT, linewidth=0.6, alpha=0.5)
    blind = np.flatnonzero(~np.isfinite(known.sigma))
    for i, (first, last) in enumerate(_runs(blind)):  # no number is known, so none is drawn
        label = None if i else "unknown: no finite standard deviation"
        ax.axvspan(first - 0.5, last + 0.5, color=VERMILLION, alpha=0.13, linewidth=0, label=label)
    numbers = np.concatenate([known.sigma, known.prior_sigma])
    if not (np.isfinite(numbers) & (numbers > 0)).any():  # nothing to put on an axis of numbers
        ax.set_yticks([])
        ax.set_xlim(-0.5, blind.size - 0.5)
    else:
        drawn = numbers[np.isfinite(numbers) & (numbers > 0)]
        ax.set_ylim(drawn.min() / 2, drawn.max() * 60)  # room for the legend
        ax.set_yscale("log")
    ax.set_xlabel("entry, in the order of the table below")
    ax.set_ylabel("standard deviation (the entry's unit)")
    ax.grid(axis="y", color=FAINT, alpha=0.25, linewidth=0.6)
    ax.legend(loc="upper right", ncols=2)
    ax.margins(x=0.01)
    return ax


def _runs(entries: Index) -> list[tuple[int, int]]:
    """The first and last entry of each run of consecutive entries."""
    if not entries.size:
        return []
    parts = np.split(entries, np.flatnonzero(np.diff(entries) > 1) + 1)
    return [(int(part[0]), int(part[-1])) for part in parts]


def caption_sigmas(diagnosis: Diagnosis) -> str:
    """What `plot_sigmas` shows."""
    known = diagnosis.identifiability
    blind = int(np.sum(~np.isfinite(known.sigma)))
    said = [
        "How well each unknown is determined: its standard deviation in Laplace's approximation. "
        "Lower is better."
    ]
    if diagnosis.priors:
        said.append(
            "Dashes are the standard deviations of the priors alone; where a mark lies on its "
            "dash, the data say nothing about the unknown."
        )
    if blind:
        entries = "1 entry takes" if blind == 1 else f"{blind} entries take"
        said.append(
            f"{entries} part in directions that change no residual: their standard deviation is "
            "infinite and cannot be drawn; the shaded strips show which entries these are."
        )
    return " ".join(said)


def plot_data_share(diagnosis: Diagnosis, *, ax: Axes) -> Axes:
    """The share of its information that comes from the data, for every direction, largest first.

    Raises BadArgument for a sparse Jacobian, which is factorized without singular values.
    """
    known = diagnosis.identifiability
    if known.data_share is None:
        raise BadArgument(
            "the shares of single directions take singular values, which are not computed of a "
            f"sparse Jacobian; the data decide {known.effective:.1f} of {diagnosis.shape[1]} "
            "directions"
        )
    share = np.sort(known.data_share)[::-1]
    x = np.arange(1, share.size + 1)
    ax.fill_between(x, share, step="mid", color=BLUE, alpha=0.25, linewidth=0)
    ax.step(x, share, where="mid", color=BLUE)
    ax.axhline(0.5, color=VERMILLION, linewidth=1.0, linestyle="--")
    note_at(ax, "half from the data", 0.99, 0.5, VERMILLION)
    ax.set(ylim=(0, 1.04), xlim=(0.5, share.size + 0.5))
    ax.set(xlabel="direction, those that the data know best first")
    ax.set(ylabel="share from the data (0 to 1)")
    ax.set_title(
        f"the data decide {share.sum():.1f} of {diagnosis.shape[1]} directions", loc="left"
    )
    return ax


def caption_data_share(diagnosis: Diagnosis) -> str:
    """What `plot_data_share` shows."""
    known = diagnosis.identifiability
    return (
        f"How much of the information on each direction comes from the data; the rest comes from "
        f"{' and '.join(diagnosis.priors)}. The data know {known.better_from_data} directions "
        f"better than the priors do; the area under the curve, {known.effective:.1f}, is the "
        "effective number of degrees of freedom."
    )
