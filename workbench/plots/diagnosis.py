"""What a diagnosis found: the Jacobian's sparsity and singular values, sigmas, and designs."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.ticker import MaxNLocator

from workbench.arrays import Index, Mask
from workbench.diagnostics import Diagnosis, MeasurementDesign
from workbench.fitting.refits import Profile
from workbench.plots.palette import BLUE, FAINT, GREEN, LINES, MARKERS, VERMILLION
from workbench.plots.style import decades, labels_apart, note_at, plain, shortened

PIXELS = 720  # of the drawing, top to bottom
THINNEST = 0.04  # of the height: what a term gets at least, so that it can be read


def plot_sparsity(diagnosis: Diagnosis, *, ax: Axes) -> Axes:
    """The pattern (m, n): a row per residual, grouped by term, a column per unknown, by block.

    Where several rows share a line, the line shows every column that any of them reads.
    """
    m, n = diagnosis.shape
    terms = list(dict.fromkeys(term.residual for term in diagnosis.terms))
    heights = lines(np.diff(diagnosis.row_edges))
    drawn = [
        squeezed(diagnosis.pattern[top:bottom], height)
        for (top, bottom), height in zip(pairwise(diagnosis.row_edges), heights, strict=True)
    ]
    image = np.vstack(drawn) if drawn else np.zeros((1, max(n, 1)), dtype=bool)
    two = ListedColormap(["white", BLUE])
    extent = (0, max(n, 1), len(image), 0)
    ax.imshow(image, two, aspect="auto", interpolation="nearest", vmin=0, vmax=1, extent=extent)
    rows = np.cumsum([0, *heights])
    columns = [0, *(part.stop for part in diagnosis.free.slices.values())]
    for edge in rows[1:-1]:
        ax.axhline(float(edge), color=FAINT, linewidth=0.8)
    for edge in columns[1:-1]:
        ax.axvline(edge, color=FAINT, linewidth=0.8)
    _label_rows(ax, terms, rows, np.diff(diagnosis.row_edges))
    _label_columns(ax, diagnosis.free.names, np.asarray(columns))
    ax.spines[:].set_visible(True)
    ax.set(xlabel="unknowns, by block (columns)", ylabel="whitened residuals, by term (rows)")
    ax.set_title(
        f"{m:,} × {n:,}, {diagnosis.nonzeros:,} nonzeros ({diagnosis.density:.1%})", loc="left"
    )
    return ax


def caption_sparsity(diagnosis: Diagnosis) -> str:
    """What `plot_sparsity` shows."""
    m, n = diagnosis.shape
    sizes = np.diff(diagnosis.row_edges)
    text = (
        f"An entry is blue where one of the {m:,} residuals depends on one of the {n:,} "
        f"unknowns by structure: {diagnosis.density:.1%} of the entries."
    )
    if (sizes > np.array(lines(sizes))).any():
        text += " Several rows share a line, which is blue where any of them is."
    if (sizes < THINNEST * m).any():
        text += " Small terms are drawn taller than to scale."
    return text


def lines(sizes: Sequence[int] | Index) -> list[int]:
    """How many lines of the drawing each term gets: to scale, but never too thin to see."""
    share = np.maximum(
        np.asarray(sizes, dtype=float), min(THINNEST, 0.5 / max(len(sizes), 1)) * np.sum(sizes)
    )
    share = share / max(share.sum(), 1.0)
    return [max(1, round(PIXELS * float(s))) for s in share]


def squeezed(pattern: Mask, height: int) -> Mask:
    """Rows (m, n) on `height` lines: any nonzero where rows share a line, else repeated."""
    m = len(pattern)
    if m == 0:
        return np.zeros((height, pattern.shape[1]), dtype=bool)
    starts = np.arange(height) * m // height
    if m <= height:
        return pattern[starts]
    return np.logical_or.reduceat(pattern, starts, axis=0)


def _label_rows(ax: Axes, names: Sequence[str], edges: Index, sizes: Index) -> None:
    middles = [(a + b) / 2 for a, b in pairwise(edges.tolist())]
    kept = labels_apart(middles, np.diff(edges).tolist(), 0.035 * float(edges[-1]))
    labels = [plain(f"{shortened(names[i], 24)}: {sizes[i]:,}") for i in kept]
    ax.set_yticks([middles[i] for i in kept], labels)
    ax.tick_params(axis="y", length=0)


def _label_columns(ax: Axes, names: Sequence[str], edges: Index) -> None:
    middles = [(a + b) / 2 for a, b in pairwise(edges.tolist())]
    sizes = np.diff(edges)
    kept = labels_apart(middles, sizes.tolist(), 0.03 * float(edges[-1]))
    labels = [f"{shortened(names[i], 24)}\n{sizes[i]:,}" for i in kept]
    ax.set_xticks([middles[i] for i in kept], [plain(label) for label in labels])
    if len(kept) > 4:
        for label in ax.get_xticklabels():
            label.set(rotation=35, ha="right", rotation_mode="anchor")
    ax.tick_params(axis="x", length=0)


FAR_ABOVE = 1e4  # times the tolerance: above it no singular value is near


def plot_singular_values(diagnosis: Diagnosis, *, ax: Axes) -> Axes:
    """Singular values, largest first, on a logarithmic axis; hollow below the tolerance."""
    s, n, rank = diagnosis.singular_values, diagnosis.shape[1], diagnosis.rank
    floor = _floor(diagnosis)
    # What constraints forbid comes first.
    index = np.arange(1, s.size + 1) + rank - diagnosis.reduced_rank
    seen = index <= rank
    drawn = np.maximum(s, floor)
    ax.plot(index[seen], drawn[seen], "o", color=BLUE, markersize=4, label="seen")
    hollow = index[~seen], drawn[~seen]
    ax.plot(*hollow, "o", color=VERMILLION, ms=5, mfc="none", label="below the tolerance")
    if diagnosis.tolerance > floor:
        ax.axhline(diagnosis.tolerance, color=VERMILLION, linewidth=1.0, linestyle="--")
        text = f"tolerance {diagnosis.tolerance:.1e}"
        note_at(ax, text, 0.02, diagnosis.tolerance, VERMILLION)
    top = 10 * max(float(s.max(initial=0.0)), 10 * floor)
    ax.set(yscale="log", xlim=(0.0, n + 1.0), ylim=(floor / 3, top))
    if rank < n:
        ax.axvline(rank + 0.5, color=FAINT, linewidth=1.0)
        ax.axvspan(rank + 0.5, n + 1.0, color=VERMILLION, alpha=0.07, linewidth=0)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.grid(color=FAINT, alpha=0.25, linewidth=0.6)
    ax.set(xlabel="index, largest first", ylabel="singular value (whitened residual per unit)")
    if rank == n:
        ax.set_title(f"rank {rank} of {n}, condition {diagnosis.condition:.3g}", loc="left")
        return ax
    ax.set_title(f"rank {rank} of {n}", loc="left")
    return ax


def caption_singular_values(diagnosis: Diagnosis) -> str:
    """What `plot_singular_values` shows."""
    s, n, rank = diagnosis.singular_values, diagnosis.shape[1], diagnosis.rank
    k = diagnosis.reduced_rank
    first = f"Constraints forbid {rank - k} of {n} directions. " if rank > k else ""
    if rank == n and s.size:
        every = n if rank == k else f"other {k}"
        return (
            f"{first}The residuals change along all {every} directions: the singular values fall "
            f"from {s[0]:.3g} to {s[-1]:.3g}, so that the condition number is "
            f"{diagnosis.condition:.3g}."
        )
    where = (
        f" The singular values fall from {s[k - 1]:.2g} (number {k}) to {s[k]:.2g} "
        f"(number {k + 1})."
        if 0 < k < s.size
        else ""
    )
    return (
        f"{first}The residuals change along {k} of {n} directions; along the other {n - rank} the "
        f"unknowns can change without changing any residual.{where} The table below names "
        "these directions."
    )


def _floor(diagnosis: Diagnosis) -> float:
    """Where the axis ends, and values that are zero, or nearly, are drawn."""
    s, tolerance = diagnosis.singular_values, diagnosis.tolerance
    above = s[s > 0]
    if not above.size:
        return 1e-1
    least = float(above.min())
    if diagnosis.rank == diagnosis.shape[1] and least > FAR_ABOVE * tolerance:
        return least / 10  # a tolerance so far below would leave the drawing empty
    return max(min(least, tolerance), 1e-4 * tolerance) / 3


def plot_sigmas(diagnosis: Diagnosis, *, ax: Axes) -> Axes:
    """Posterior standard deviation of every entry, block by block, and its prior's as a dash."""
    known = diagnosis.identifiability
    for i, block in enumerate(diagnosis.free.blocks):
        part = diagnosis.free.slices[block.name]
        x = np.arange(part.start, part.stop)
        sigma, prior = known.sigma[part], known.prior_sigma[part]
        seen = np.isfinite(sigma) & (sigma > 0)  # one that a bound fixes has none to draw
        colour, marker = LINES[i % len(LINES)], MARKERS[i % len(MARKERS)]
        # A block of which nothing is known is shown by the strips alone.
        label = f"{block.name} ({block.unit})" if seen.any() else None
        ax.plot(x[seen], sigma[seen], marker, color=colour, markersize=4, label=label)
        finite = np.isfinite(prior)
        ax.plot(x[finite], prior[finite], "_", color=colour, markersize=7)
        ax.axvline(part.stop - 0.5, color=FAINT, linewidth=0.6, alpha=0.5)
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
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
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
    sentences = [
        "How well each unknown is determined: its standard deviation in Laplace's approximation. "
        "Lower is better."
    ]
    if diagnosis.priors:
        sentences.append(
            "Dashes are the standard deviations of the priors alone; where a mark lies on its "
            "dash, the data say nothing about the unknown."
        )
    if blind:
        entries = "1 entry takes" if blind == 1 else f"{blind} entries take"
        sentences.append(
            f"{entries} part in directions that change no residual: their standard deviation is "
            "infinite and cannot be drawn; the shaded strips show which entries these are."
        )
    return " ".join(sentences)


AXIS_HEIGHT = 2.5  # of the rise at the ends of the interval: the height of the axes


def plot_profile_likelihood(profile: Profile, *, ax: Axes) -> Axes:
    """The rise of the cost against the entry, beside Laplace's parabola, with the interval."""
    rises = profile.costs - profile.costs.min()
    ax.axhspan(0, profile.rise, color=GREEN, alpha=0.08, linewidth=0)
    ax.axhline(profile.rise, color=FAINT, linewidth=0.8)
    ax.plot(profile.at, rises, "o-", color=BLUE, markersize=4, label="profile")
    if np.isfinite(profile.sd):
        x = np.linspace(profile.at[0], profile.at[-1], 200)
        parabola = ((x - profile.best) / profile.sd) ** 2 / 2
        ax.plot(x, parabola, "--", color=VERMILLION, label="Laplace")
    for end in profile.interval:
        if np.isfinite(end):
            ax.plot([end, end], [0, profile.rise], color=BLUE, linewidth=0.9)
    unit = "" if profile.unit == "1" else f" ({profile.unit})"
    ax.set(
        xlabel=f"{profile.entry}{unit}",
        ylabel="rise of the lowest cost",
        ylim=(0, AXIS_HEIGHT * profile.rise),
    )
    ax.legend(loc="upper center")
    return ax


def caption_profile_likelihood(profile: Profile) -> str:
    """What `plot_profile_likelihood` shows."""
    return (
        "Every point is a fit of all other unknowns. Where the lowest cost has risen by "
        f"{profile.rise:.2f}, the interval ends: {profile}."
    )


MOST_RANKED = 30  # candidates, of which the last is the worst
LONGEST_LABEL = 34


def plot_measurement_ranking(design: MeasurementDesign, *, ax: Axes) -> Axes:
    """The criterion after each candidate by itself, and before, as a line."""
    shown = list(design.ranking)
    if len(shown) > MOST_RANKED:
        shown = [*shown[: MOST_RANKED - 1], shown[-1]]
    y, sd = np.arange(len(shown))[::-1], np.array([candidate.sd for candidate in shown])
    known = np.isfinite(sd)
    chosen = np.array([candidate.name in design.chosen for candidate in shown], dtype=bool)
    for rows, colour, marker, label in (
        (known & ~chosen, BLUE, "o", "not chosen"),
        (known & chosen, VERMILLION, "D", "chosen"),
    ):
        ax.plot(sd[rows], y[rows], marker, color=colour, markersize=5, label=label)
    sds = np.array([design.before.sd, *sd])
    sds = sds[np.isfinite(sds) & (sds > 0)]
    low, high = (float(sds.min() / 1.15), float(sds.max() * 1.15)) if sds.size else (0.1, 1.0)
    for i in np.flatnonzero(~known):
        ax.text(high, y[i], "undetermined", ha="right", va="center", color=VERMILLION, fontsize=8)
    if np.isfinite(design.before.sd):
        ax.axvline(design.before.sd, color=FAINT, linestyle="--", linewidth=1.0, label="before")
    ax.set_yticks(y, [plain(shortened(candidate.name, LONGEST_LABEL)) for candidate in shown])
    ax.set_ylim(-0.7, len(shown) - 0.3)
    ax.set(xscale="log", xlim=(low, high))
    decades(ax.xaxis, low, high)
    ax.set_xlabel(f"expected standard deviation ({plain(design.unit)})")
    ax.grid(axis="x", color=FAINT, alpha=0.25, linewidth=0.6)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, 1.0 + 1.1 / len(shown)), ncols=3)
    return ax


def caption_measurement_ranking(design: MeasurementDesign) -> str:
    """What `plot_measurement_ranking` shows."""
    more = ""
    if len(design.ranking) > MOST_RANKED:
        best = f"The best {MOST_RANKED - 1} of {len(design.ranking)} candidates"
        more = f" {best} are shown, and the worst."
    return (
        f"What would be known after each candidate by itself, by {design.criterion}. Left is "
        f"better; the dashed line is what is known before.{more}"
    )
