"""What became of the runs of every solver, and in which basins they ended."""

from collections import Counter

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from workbench.comparison import Comparison, TargetOutcome
from workbench.plots.labels import plain
from workbench.plots.palette import BLUE, FAINT, GREEN, INK, ORANGE, PURPLE, SKY, VERMILLION

COLOURS = {
    TargetOutcome.REACHED: GREEN,
    TargetOutcome.ALONE: BLUE,
    TargetOutcome.OTHER_BASIN: SKY,
    TargetOutcome.STALLED: ORANGE,
    TargetOutcome.OUT_OF_BUDGET: PURPLE,
    TargetOutcome.FALSE_CLAIM: VERMILLION,
}
NO_ANSWER = "#c9cdd3"
SHOWN_BASINS = 5


def plot_verdicts(comparison: Comparison, *, ax: Axes) -> Axes:
    """A bar per solver, cut into what its runs came to."""
    solvers = comparison.solvers
    y = np.arange(len(solvers))[::-1]
    left = np.zeros(len(solvers))
    counts = [comparison.counted(s) for s in solvers]
    for verdict, colour in COLOURS.items():
        width = np.array([c[verdict] for c in counts], dtype=float)
        label = verdict.name.lower().replace("_", " ")
        left = _bars(ax, y, width, left, colour, label)
    rest = np.array([sum(n for v, n in c.items() if v not in COLOURS) for c in counts], dtype=float)
    _bars(ax, y, rest, left, NO_ANSWER, "no answer")
    return _dressed(ax, y, solvers)


def caption_verdicts(comparison: Comparison) -> str:
    """What `plot_verdicts` shows; a colour is explained where it is there."""
    came = Counter[TargetOutcome]()
    for solver in comparison.solvers:
        came.update(comparison.counted(solver))
    text = (
        f"How the {len(comparison.instances)} runs of each solver ended, judged by the problem's "
        "own cost and gradient at the returned point, never by what the solver reports."
    )
    if came[TargetOutcome.REACHED]:
        text += " The longer the green bar, the better."
    if came[TargetOutcome.OTHER_BASIN]:
        text += " Light blue runs converged in another basin."
    if came[TargetOutcome.FALSE_CLAIM]:
        text += " Vermillion runs claim convergence where the cost still slopes."
    else:
        text += " No run claims convergence where the cost still slopes."
    if came[TargetOutcome.ALONE]:
        text += " Blue is the only end on a problem whose lowest cost is unknown: low or high."
    if any(n for verdict, n in came.items() if verdict not in COLOURS):
        text += " Grey runs gave no answer, or refused a problem that the solver is not made for."
    return text


def plot_basins(comparison: Comparison, problem: str, *, ax: Axes) -> Axes:
    """A bar per solver, cut into the basins that its ends on one problem lead to."""
    solvers = comparison.solvers
    y = np.arange(len(solvers))[::-1]
    names = [i.name for i in comparison.of(problem)]
    where = [[comparison.basins.get((name, s)) for name in names] for s in solvers]
    left = np.zeros(len(solvers))
    colours = (GREEN, SKY, BLUE, ORANGE, PURPLE)
    most = max((b for row in where for b in row if b is not None), default=0)
    for basin in range(min(most + 1, SHOWN_BASINS)):
        width = np.array([sum(b == basin for b in row) for row in where], dtype=float)
        label = f"basin {basin + 1}" + (", the lowest" if basin == 0 else "")
        left = _bars(ax, y, width, left, colours[basin], label)
    more = [sum(b is not None and b >= SHOWN_BASINS for b in row) for row in where]
    if any(more):
        left = _bars(ax, y, np.array(more, dtype=float), left, VERMILLION, "higher ones")
    none = np.array([sum(b is None for b in row) for row in where], dtype=float)
    if none.any():
        _bars(ax, y, none, left, NO_ANSWER, "no end")
    return _dressed(ax, y, solvers)


def caption_basins(comparison: Comparison, problem: str) -> str:
    """What `plot_basins` shows."""
    own = len({id(comparison.end_analysis(i.name)) for i in comparison.of(problem)})
    each = " Every start has data, and therefore basins, of its own." if own > 1 else ""
    return (
        f"{problem}: the basin that each end leads to, by Levenberg-Marquardt from there, the "
        "lowest first. Two ends are in one basin if the residuals cannot tell them apart, whatever "
        f"their values are.{each}"
    )


def _bars(
    ax: Axes, y: np.ndarray, width: np.ndarray, left: np.ndarray, colour: str, label: str
) -> np.ndarray:
    if width.any():
        ax.barh(y, width, left=left, color=colour, height=0.72, label=label, edgecolor="white")
        for at, w, x in zip(y, width, left, strict=True):
            if w:
                ax.text(x + w / 2, at, f"{w:.0f}", ha="center", va="center", fontsize=8, color=INK)
    return np.asarray(left + width)


def _dressed(ax: Axes, y: np.ndarray, solvers: tuple[str, ...]) -> Axes:
    ax.set_yticks(y, [plain(s) for s in solvers])
    ax.set_xlabel("runs")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.grid(axis="x", color=FAINT, alpha=0.25, linewidth=0.6)
    ax.set_ylim(-0.6, len(solvers) - 0.4)
    return ax
