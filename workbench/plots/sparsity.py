"""Where a Jacobian is not zero: which residuals depend on which unknowns."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap

from workbench.arrays import Index, Mask
from workbench.diagnostics import Diagnosis
from workbench.plots.labels import apart, plain, shortened
from workbench.plots.palette import BLUE, FAINT

LINES = 720  # that the drawing has, top to bottom
MOST_LABELLED = 200  # columns: of more, joints are too narrow for their names
THINNEST = 0.04  # of the height: what a term gets at least, so that it can be read


def plot_sparsity(diagnosis: Diagnosis, *, ax: Axes) -> Axes:
    """The pattern (m, n): a row per residual, grouped by term, a column per free number, by block.

    Where several rows share a line, the line shows every column that any of them reads.
    """
    m, n = diagnosis.shape
    terms = term_names(diagnosis)
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
    _label_joints(ax, diagnosis)
    ax.spines[:].set_visible(True)
    ax.set(xlabel="free numbers, by block (columns)", ylabel="whitened residuals, by term (rows)")
    ax.set_title(
        f"{m:,} × {n:,}, {diagnosis.nonzeros:,} nonzeros ({diagnosis.density:.1%})", loc="left"
    )
    return ax


def caption_sparsity(diagnosis: Diagnosis) -> str:
    """What `plot_sparsity` shows."""
    m, n = diagnosis.shape
    sizes = np.diff(diagnosis.row_edges)
    text = (
        f"An entry is blue where one of the {m:,} residuals depends on one of the {n:,} free "
        f"numbers by structure: {diagnosis.density:.1%} of the entries."
    )
    if (sizes > np.array(lines(sizes))).any():
        text += " Several rows share a line, which is blue where any of them is."
    if (sizes < THINNEST * m).any():
        text += " Small terms are drawn taller than to scale."
    return text


def term_names(diagnosis: Diagnosis) -> list[str]:
    """The residuals, from the top down."""
    return list(dict.fromkeys(term.residual for term in diagnosis.terms))


def lines(sizes: Sequence[int] | Index) -> list[int]:
    """How many lines of the drawing each term gets: to scale, but never too thin to see."""
    share = np.maximum(
        np.asarray(sizes, dtype=float), min(THINNEST, 0.5 / max(len(sizes), 1)) * np.sum(sizes)
    )
    share = share / max(share.sum(), 1.0)
    return [max(1, round(LINES * float(s))) for s in share]


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
    kept = apart(middles, np.diff(edges).tolist(), 0.035 * float(edges[-1]))
    labels = [plain(f"{shortened(names[i], 24)}: {sizes[i]:,}") for i in kept]
    ax.set_yticks([middles[i] for i in kept], labels)
    ax.tick_params(axis="y", length=0)


def _label_joints(ax: Axes, diagnosis: Diagnosis) -> None:
    """Above the columns of a pose, the joint to which each three belong."""
    free = diagnosis.free
    if not 0 < free.size <= MOST_LABELLED:
        return
    names: list[str] = []
    middles: list[float] = []
    for tree in diagnosis.problem.trees:
        turned = tree.turned(free)
        names += [tree.names[k] for k in turned]
        middles += [place.start + 1.5 for place in turned.values()]
        for place in list(turned.values())[1:]:
            ax.axvline(place.start, color=FAINT, linewidth=0.3, alpha=0.5)
    if names:
        above = ax.secondary_xaxis("top")
        above.set_xticks(middles, [plain(shortened(name, 16)) for name in names], rotation=90)
        above.tick_params(axis="x", length=0, labelsize=6)
        above.spines[:].set_visible(False)


def _label_columns(ax: Axes, names: Sequence[str], edges: Index) -> None:
    middles = [(a + b) / 2 for a, b in pairwise(edges.tolist())]
    sizes = np.diff(edges)
    kept = apart(middles, sizes.tolist(), 0.03 * float(edges[-1]))
    labels = [f"{shortened(names[i], 24)}\n{sizes[i]:,}" for i in kept]
    widths = [  # at 75 letters to the axis
        (2 + max(map(len, label.split("\n")))) / 75 * float(edges[-1]) for label in labels
    ]
    spaces = [middles[j] - middles[i] for i, j in pairwise(kept)]
    tight = any(s < (a + b) / 2 for s, (a, b) in zip(spaces, pairwise(widths), strict=True))
    if tight and len(kept) <= 6:  # every other label two lines lower
        labels = [label if k % 2 == 0 else "\n\n" + label for k, label in enumerate(labels)]
    elif tight:
        labels = [label.replace("\n", ": ") for label in labels]
    ax.set_xticks([middles[i] for i in kept], [plain(label) for label in labels])
    if tight and len(kept) > 6:
        for label in ax.get_xticklabels():
            label.set(rotation=35, ha="right", rotation_mode="anchor")
    ax.tick_params(axis="x", length=0)
