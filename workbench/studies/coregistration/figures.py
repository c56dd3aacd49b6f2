"""Figures of the coregistration study: errors and their ratios by set, and a scan in colours."""

import numpy as np
from matplotlib.axes import Axes

from workbench.fitting.setup import distances
from workbench.plots.body import Figurine, line_up_coloured
from workbench.plots.palette import FAINT, LINES, MARKERS
from workbench.studies.coregistration.study import CONTROL, TOGETHER, Example, TogetherStudy


def plot_hidden(s: TogetherStudy, *, ax: Axes) -> Axes:
    """The error of hidden vertices against the number of scans, apart and together."""
    for k, holes in enumerate(s.plan.holes):
        for method, line in ((CONTROL, "--"), (TOGETHER, "-")):
            each = [cell.mean(method, "hidden") for cell in s.row(holes)]
            ax.plot(
                range(len(each)),
                each,
                line,
                color=LINES[k],
                marker=MARKERS[k],
                label=f"{holes} holes" if method == TOGETHER else None,
            )
    _numbers_of_scans(s, ax)
    ax.set(ylabel="mean error of hidden vertices (mm)", ylim=(0, None))
    ax.legend(loc="lower left")
    return ax


def caption_hidden(s: TogetherStudy) -> str:
    """The caption of `plot_hidden`."""
    first, last = s.row(s.plan.holes[-1])[0], s.row(s.plan.holes[-1])[-1]
    return (
        "Dashed: each scan by itself, in as many rounds as coregistration has. Solid: together. "
        f"With {first.holes} holes in each scan, hidden vertices are "
        f"{first.mean(CONTROL, 'hidden'):.1f} mm off apart and "
        f"{first.mean(TOGETHER, 'hidden'):.1f} mm together in {first.scans} scans, "
        f"{last.mean(CONTROL, 'hidden'):.1f} and {last.mean(TOGETHER, 'hidden'):.1f} mm in "
        f"{last.scans}."
    )


def plot_shares(s: TogetherStudy, *, ax: Axes) -> Axes:
    """The error of hidden vertices together, over that apart, with intervals over people."""
    ax.axhline(1, color=FAINT, linewidth=0.8)
    for k, holes in enumerate(s.plan.holes):
        middle, low, high = np.array([cell.share("hidden") for cell in s.row(holes)]).T
        at = np.arange(len(middle)) + 0.08 * (k - (len(s.plan.holes) - 1) / 2)
        away = np.stack([middle - low, high - middle])
        ax.errorbar(
            at, middle, away, color=LINES[k], marker=MARKERS[k], capsize=3, label=f"{holes} holes"
        )
    _numbers_of_scans(s, ax)
    ax.set(ylabel="error of hidden vertices, together / apart")
    ax.legend(loc="lower left")
    return ax


def caption_shares(s: TogetherStudy) -> str:
    """The caption of `plot_shares`."""
    better = sum(cell.share("hidden")[2] < 1 for cell in s.cells)
    return (
        "Below 1, registering together is better. Bars are 90 % intervals over "
        f"{s.plan.people} people, by drawing people with replacement. In {better} of "
        f"{len(s.cells)} sets the whole interval is below 1."
    )


def plot_example(example: Example, *, ax: Axes) -> Axes:
    """One scan's registration, apart and together, coloured by its error."""
    away = {m: distances(V, example.truth) for m, V in example.found.items()}
    shown = [
        (Figurine(f"{method}: {away[method].mean():.1f} mm", V - V.min(axis=0)), away[method])
        for method, V in example.found.items()
    ]
    end = float(np.percentile(np.concatenate(list(away.values())), 99))
    return line_up_coloured(shown, example.faces, end, "distance to the truth (mm)", ax=ax)


def caption_example(example: Example) -> str:
    """The caption of `plot_example`."""
    return (
        f"Scan {example.row} of the largest set with the most holes, on which hidden vertices "
        "gained most. The number below each is its mean distance over all vertices. This is the "
        "best case and not a typical one; the table has the means."
    )


def _numbers_of_scans(s: TogetherStudy, ax: Axes) -> None:
    ax.set_xticks(range(len(s.plan.scans)), [str(n) for n in s.plan.scans])
    ax.set_xlim(-0.3, len(s.plan.scans) - 0.7)
    ax.set_xlabel(f"number of scans, of {s.plan.people} people")
