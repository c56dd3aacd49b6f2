"""Figures of the study of the loop: errors by round, on its own images and on others."""

import numpy as np
from matplotlib.axes import Axes

from workbench.plots.palette import FAINT, LINES, MARKERS
from workbench.studies.fitting_loop.study import FAILED, SHIPPED, LoopStudy


def plot_rounds(s: LoopStudy, *, ax: Axes) -> Axes:
    """Mean errors against the number of rounds."""
    at = [one.number for one in s.rounds]
    ax.plot(at, [one.kept.mean for one in s.rounds], color=LINES[0], marker=MARKERS[0])
    ax.annotate("kept fits", (at[-1], s.rounds[-1].kept.mean), (4, 4), textcoords="offset points")
    for k, (what, name) in enumerate((("alone", "regressor alone"), ("begun", "fits it begins"))):
        means = [getattr(one, what).mean for one in s.rounds[1:]]
        ax.plot(at[1:], means, "--", color=LINES[k + 1], marker=MARKERS[k + 1], label=name)
    ax.plot([], [], color=LINES[0], marker=MARKERS[0], label="kept fits of the loop's images")
    for name, errors in s.others.items():
        ax.axhline(errors.mean, color=FAINT, linewidth=0.8)
        ax.annotate(name, (0, errors.mean), (0, 2), textcoords="offset points", fontsize=7)
    ax.set(xlabel="round", ylabel="mean error (mm)", ylim=(0, None), xticks=at)
    ax.legend(loc="lower right", title="dashed: held-out images")
    return ax


def caption_rounds(s: LoopStudy) -> str:
    """The caption of `plot_rounds`."""
    first, last = s.rounds[1], s.rounds[-1]
    assert first.begun is not None
    assert last.begun is not None
    return (
        "Mean distances of 12 landmarks of the limbs, the middles of the hips brought together. "
        "Thin lines are fits to the held-out images from other starts. Fits to held-out images "
        f"are {first.begun.mean:.0f} mm off after one round and {last.begun.mean:.0f} mm after "
        f"{last.number}; {s.others[SHIPPED].mean:.0f} mm where the shipped regressor begins them."
    )


def plot_each(s: LoopStudy, *, ax: Axes) -> Axes:
    """Every error of the kept fits, sorted, round by round."""
    for k, one in enumerate(s.rounds):
        each = np.sort(one.kept.each)
        share = (np.arange(len(each)) + 0.5) / len(each)
        color, line = LINES[k % len(LINES)], ("-", "--", "-.", ":")[k % 4]
        ax.plot(100 * share, each, line, color=color, label=f"round {one.number}")
    ax.axhline(FAILED, color=FAINT, linewidth=0.8)
    ax.set(xlabel="images (%)", ylabel="error of the kept fit (mm)", ylim=(0, None), xlim=(0, 100))
    ax.legend(loc="upper left")
    return ax


def caption_each(s: LoopStudy) -> str:
    """The caption of `plot_each`."""
    failed = ", ".join(str(one.kept.failed) for one in s.rounds)
    return (
        f"The errors of all {s.plan.images} kept fits in order, round by round. Above the thin "
        f"line, at 150 mm, are {failed} of them."
    )
