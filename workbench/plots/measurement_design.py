"""What to measure next: every candidate by itself, and the chosen ones one after the other."""

import numpy as np
from matplotlib.axes import Axes

from workbench.diagnostics import MeasurementDesign
from workbench.plots.labels import decades, plain, shortened
from workbench.plots.palette import BLUE, FAINT, VERMILLION

MOST = 30  # candidates, of which the last is the worst
LETTERS = 34


def plot_measurement_ranking(found: MeasurementDesign, *, ax: Axes) -> Axes:
    """The criterion after each candidate by itself, and before, as a line."""
    shown = (
        [*found.ranking]
        if len(found.ranking) <= MOST
        else [*found.ranking[: MOST - 1], found.ranking[-1]]
    )
    y = np.arange(len(shown))[::-1]
    known = [bool(np.isfinite(one.sd)) for one in shown]
    for chosen, colour, marker in ((False, BLUE, "o"), (True, VERMILLION, "D")):
        at = [i for i, one in enumerate(shown) if known[i] and (one.name in found.chosen) == chosen]
        label = "chosen" if chosen else "not chosen"
        ax.plot([shown[i].sd for i in at], y[at], marker, color=colour, markersize=5, label=label)
    low, high = _range(found, [one.sd for one in shown])
    for i in np.flatnonzero(~np.array(known)):
        ax.text(high, y[i], "undetermined", ha="right", va="center", color=VERMILLION, fontsize=8)
    if np.isfinite(found.before.sd):
        ax.axvline(found.before.sd, color=FAINT, linestyle="--", linewidth=1.0, label="before")
    ax.set_yticks(y, [plain(shortened(one.name, LETTERS)) for one in shown])
    ax.set_ylim(-0.7, len(shown) - 0.3)
    _logarithmic(found, ax, low, high)
    ax.grid(axis="x", color=FAINT, alpha=0.25, linewidth=0.6)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, 1.0 + 1.1 / len(shown)), ncols=3)
    return ax


def plot_measurement_choice(found: MeasurementDesign, *, ax: Axes) -> Axes:
    """The criterion after the first chosen candidate, the first two, and so on."""
    scores = (found.before, *found.steps)
    names = ("before", *(f"+ {name}" for name in found.chosen))
    known = [i for i, score in enumerate(scores) if np.isfinite(score.sd)]
    y = np.arange(len(scores))[::-1]
    ax.plot([scores[i].sd for i in known], y[known], "D-", color=VERMILLION, markersize=5)
    low, high = _range(found, [score.sd for score in scores])
    ax.set_yticks(y, [plain(shortened(name, LETTERS)) for name in names])
    ax.set_ylim(-0.7, len(scores) - 0.3)
    _logarithmic(found, ax, low, high)
    ax.grid(axis="x", color=FAINT, alpha=0.25, linewidth=0.6)
    return ax


def _range(found: MeasurementDesign, sds: list[float]) -> tuple[float, float]:
    all_of = np.array([found.before.sd, *sds])
    all_of = all_of[np.isfinite(all_of) & (all_of > 0)]
    if not all_of.size:
        return 0.1, 1.0
    return float(all_of.min() / 1.15), float(all_of.max() * 1.15)


def _logarithmic(found: MeasurementDesign, ax: Axes, low: float, high: float) -> None:
    ax.set_xscale("log")
    ax.set_xlim(low, high)
    decades(ax.xaxis, low, high)
    ax.set_xlabel(f"expected standard deviation ({plain(found.unit)})")


def caption_measurement_ranking(found: MeasurementDesign) -> str:
    """What `plot_measurement_ranking` shows."""
    more = ""
    if len(found.ranking) > MOST:
        more = f" The best {MOST - 1} of {len(found.ranking)} candidates are shown, and the worst."
    return (
        f"What would be known after each candidate by itself, by {found.criterion}. Left is "
        f"better; the dashed line is what is known before.{more}"
    )


def caption_measurement_choice(found: MeasurementDesign) -> str:
    """What `plot_measurement_choice` shows."""
    return "What is known after the first of the chosen candidates, the first two, and so on."
