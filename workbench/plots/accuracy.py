"""The number of correct digits that each solver attained, where the answer is known."""

import numpy as np
from matplotlib.axes import Axes

from workbench.comparison import Comparison
from workbench.fitting.setup import CERTIFIED_DIGITS
from workbench.plots.palette import FAINT, INK, solver_styles
from workbench.plots.style import plain

ENOUGH = 4  # digits, for a fit to count as right


def plot_accuracy(comparison: Comparison, *, ax: Axes) -> Axes:
    """A mark per run with a known answer: digits that agree, of the worst parameter."""
    rng = np.random.default_rng(0)
    y = np.arange(len(comparison.solvers))[::-1]
    for k, (solver, style) in enumerate(solver_styles(comparison.solvers).items()):
        digits = comparison.digits(solver)
        at = y[k] + 0.28 * rng.uniform(-1, 1, digits.size)
        ax.plot(digits, at, style.marker, color=style.color, markersize=4, alpha=0.7)
        if digits.size:
            ax.plot([digits.mean()] * 2, [y[k] - 0.38, y[k] + 0.38], color=INK, linewidth=1.6)
    ax.axvline(ENOUGH, color=FAINT, linewidth=1.0, linestyle="--")
    ax.set_yticks(y, [plain(s) for s in comparison.solvers])
    ax.set(xlim=(-0.3, CERTIFIED_DIGITS + 0.3), ylim=(-0.6, len(comparison.solvers) - 0.4))
    ax.set_xlabel("digits that agree with the known answer (log relative error)")
    ax.grid(axis="x", color=FAINT, alpha=0.25, linewidth=0.6)
    return ax


def caption_accuracy(comparison: Comparison) -> str:
    """What `plot_accuracy` shows."""
    return (
        "The accuracy of each run on problems whose answer is known beforehand: the number of "
        f"correct digits of the worst parameter, at most {CERTIFIED_DIGITS}, and 0 for a run "
        "without an answer. A bar marks the mean of a solver. Right of the dashed line, at "
        f"{ENOUGH} digits, a fit counts as correct."
    )
