"""Wins of each solver over each other one, from the same starts."""

import numpy as np
from matplotlib.axes import Axes

from workbench.comparison import Comparison
from workbench.comparison.comparison import MAIN
from workbench.comparison.pairs import duels
from workbench.comparison.statistics import FEWEST, LEVEL
from workbench.comparison.targets import named
from workbench.diagnostics.words import counted
from workbench.plots.palette import INK
from workbench.plots.style import plain


def plot_pairwise_wins(comparison: Comparison, tau: float = MAIN, *, ax: Axes) -> Axes:
    """From how many starts the solver of a row won against that of a column, and lost.

    Below these numbers is the p-value of the sign test on problems, corrected for all pairs.
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
            said = f"{duel.first}:{duel.second}\np {min(duel.corrected, 1):.2g}"
            weight = "bold" if duel.decided else "normal"
            ax.text(j, i, said, ha="center", va="center", size=8, color=INK, weight=weight)
    ax.imshow(shares, cmap="PuOr_r", vmin=-0.35, vmax=1.35)
    ax.set_xticks(range(n), [plain(s) for s in names], rotation=35, ha="right")
    ax.set_yticks(range(n), [plain(s) for s in names])
    ax.set_xlabel("against")
    ax.tick_params(length=0)
    for spine in ax.spines.values():
        spine.set_visible(False)
    return ax


def caption_pairwise_wins(comparison: Comparison, tau: float = MAIN) -> str:
    """What `plot_pairwise_wins` shows."""
    problems = counted(len(comparison.compared), "problem")
    return (
        f"Pairs of solvers from the same starts, at the target {named(tau)}: the number of starts "
        "from which the solver of the row needed less effort than that of the column, and the "
        "number from which it needed more. If only one of them met the target, it wins; efforts "
        "within 1 % are a tie; a start from which both failed counts for neither. A solver whose "
        "effort was not counted wins only where the other one failed. Below is the p-value of "
        f"the exact two-sided sign test on {problems}, each of which goes "
        "to the solver that won more of its starts, corrected for the number of pairs (Holm). "
        f"Bold pairs differ significantly at the level of {LEVEL:.0%} for all pairs together, "
        f"which takes at least {FEWEST} decided problems."
    )
