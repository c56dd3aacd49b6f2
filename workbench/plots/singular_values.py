"""The singular values of a Jacobian: which directions the residuals notice, and how well."""

from collections import Counter

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from workbench.diagnostics import Diagnosis, Direction
from workbench.diagnostics.words import counted
from workbench.plots.labels import note_at, plain, shortened
from workbench.plots.palette import BLUE, FAINT, VERMILLION

MOST = 26  # lines of text beside the spectrum
WIDEST = 44  # letters in one
FAR = 1e4  # times the tolerance: above it no singular value is near


def plot_singular_values(diagnosis: Diagnosis, *, ax: Axes) -> Axes:
    """Singular values, largest first, on a logarithmic axis; hollow below the tolerance.

    The directions of the hollow ones are named beside them.
    """
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
    ax.text(
        1.03,
        1.0,
        "\n".join(plain(line) for line in unseen(diagnosis)),
        transform=ax.transAxes,
        va="top",
        fontsize=9,
        linespacing=1.35,
    )
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
        f"free numbers can change without changing any residual.{where} The table below names "
        "these directions."
    )


def unseen(diagnosis: Diagnosis) -> list[str]:
    """The null directions in a few short lines."""
    if diagnosis.rank == diagnosis.shape[1]:
        return ["every direction changes a residual", f"condition {diagnosis.condition:.3g}"]
    found = diagnosis.null_directions
    text = [f"{counted(len(found), 'null direction')}", *_entries(found)]
    alone = [d.joints[0] for d in found if d.kind == "twist" and len(d.joints) == 1]
    pairs = [" / ".join(d.joints) for d in found if d.kind == "twist" and len(d.joints) > 1]
    text += _group(alone, "of one joint alone") + _group(pairs, "undone at the child")
    named = ("twist", "entry", "joint", "mixed")
    others = [d.name for d in found if d.kind not in named]  # gauges, shifts, blocks
    text += [name.partition(", undone by ")[0] for name in others]
    longer = [d.name for d in found if d.kind in ("joint", "mixed")]
    text += longer if len(longer) < 4 else [f"{len(longer)} combinations of more: see the table"]
    if len(text) > MOST:
        text = [*text[: MOST - 1], f"… {len(text) - MOST + 1} lines more: see the table"]
    return [shortened(line, WIDEST) for line in text]


def _entries(found: tuple[Direction, ...]) -> list[str]:
    entries = [d.name for d in found if d.kind == "entry"]
    if len(entries) <= 3:
        return entries
    blocks = Counter(name.partition("[")[0] for name in entries)
    return [f"{count} single entries of {block}" for block, count in blocks.items()]


def _group(names: list[str], kind: str) -> list[str]:
    if not names:
        return []
    counted = f"{len(names)} {'turn' if len(names) == 1 else 'turns'} {kind}:"
    return [counted, *(f"   {name}" for name in names)]


def _floor(diagnosis: Diagnosis) -> float:
    """Where the axis ends, and values that are zero, or nearly, are drawn."""
    s, tolerance = diagnosis.singular_values, diagnosis.tolerance
    above = s[s > 0]
    if not above.size:
        return 1e-1
    least = float(above.min())
    if diagnosis.rank == diagnosis.shape[1] and least > FAR * tolerance:
        return least / 10  # a tolerance so far below would leave the drawing empty
    return max(min(least, tolerance), 1e-4 * tolerance) / 3
