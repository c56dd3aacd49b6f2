"""Who needs less than whom, in pairs, from the same starts."""

import numpy as np
from matplotlib.axes import Axes

from workbench.comparison import Comparison
from workbench.comparison.comparison import MAIN
from workbench.comparison.pairs import duels
from workbench.comparison.statistics import FEWEST, LEVEL
from workbench.comparison.targets import named
from workbench.plots.lettering import plain
from workbench.plots.palette import INK


def plot_duels(comparison: Comparison, tau: float = MAIN, *, ax: Axes) -> Axes:
    """Row against column: of the starts that one of the two decided, how many the row won; below,
    the p-value of the sign test on problems, corrected for all pairs.
    """
    names, pairs = comparison.solvers, duels(comparison, tau)
    n = len(names)
    shares = np.full((n, n), np.nan)
    for i, a in enumerate(names):
        for j, b in enumerate(names):
            if i == j:
                continue
            duel = pairs[a, b]
            decided = duel.first + duel.second
            shares[i, j] = duel.first / decided if decided else np.nan
            ax.text(
                j, i, f"{duel.first}:{duel.second}\n{_p(duel.corrected)}", ha="center",
                va="center", fontsize=8, color=INK, fontweight="bold" if duel.decided else "normal",
            )  # fmt: skip
    ax.imshow(shares, cmap="PuOr_r", vmin=-0.35, vmax=1.35)
    ax.set_xticks(range(n), [plain(s) for s in names], rotation=35, ha="right")
    ax.set_yticks(range(n), [plain(s) for s in names])
    ax.set_xlabel("against")
    ax.tick_params(length=0)
    for spine in ax.spines.values():
        spine.set_visible(False)
    return ax


def caption_duels(comparison: Comparison, tau: float = MAIN) -> str:
    """What `plot_duels` shows."""
    n = len(comparison.compared)
    return (
        f"Pairs of solvers from the same starts, at the target {named(tau)}: from how many starts "
        "the one in the row needed less effort than the one in the column, and the other way "
        "round. A target that only one of them met is a win, within 1 % is a tie, and what both "
        "failed counts for nobody; an effort that was not counted only wins where the other one "
        "failed. Below, the p-value of the exact "
        f"two-sided sign test on {n} problem{'' if n == 1 else 's'}, each going to whoever won "
        "more of its starts, corrected for the number of pairs (Holm). Bold: beyond chance at "
        f"the level of {LEVEL:.0%} for all pairs together; this takes {FEWEST} decided problems "
        "at least."
    )


def _p(value: float) -> str:
    return f"p {value:.2g}" if value < 1 else "p 1"
