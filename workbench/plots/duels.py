"""Who needs less than whom, in pairs, from the same starts."""

import numpy as np
from matplotlib.axes import Axes

from workbench.comparison import Comparison
from workbench.comparison.comparison import MAIN
from workbench.comparison.targets import named
from workbench.plots.lettering import plain
from workbench.plots.palette import INK


def plot_duels(comparison: Comparison, tau: float = MAIN, *, ax: Axes) -> Axes:
    """Row against column: of the starts that one of the two decided, how many the row won."""
    names = comparison.solvers
    n = len(names)
    shares = np.full((n, n), np.nan)
    for i, a in enumerate(names):
        for j, b in enumerate(names):
            if i == j:
                continue
            duel = comparison.duel(a, b, tau)
            shares[i, j] = duel.share.value
            ax.text(
                j, i, f"{duel.first}:{duel.second}", ha="center", va="center", fontsize=8,
                color=INK, fontweight="bold" if duel.decided else "normal",
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
    return (
        f"Pairs of solvers from the same starts, at the target {named(tau)}: how often the one in "
        "the row needed less effort than the one in the column, and the other way round. A target "
        "that only one of them met is a win, within 1 % is a tie, and what both failed counts for "
        "nobody. Bold: beyond chance (95 %, Wilson). A pair does not depend on who else takes part."
    )
