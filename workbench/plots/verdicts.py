"""What became of the runs of every solver, and in which basins they ended."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from workbench.comparison import Comparison, TargetOutcome
from workbench.diagnostics.words import counted
from workbench.errors import joined
from workbench.plots.palette import BLUE, FAINT, GREEN, INK, ORANGE, PURPLE, SKY, VERMILLION
from workbench.plots.style import plain

VIOLET, BROWN, SAND = "#6a5acd", "#8c6d31", "#f0c987"  # seldom met: beside the palette's
COLOURS = {
    TargetOutcome.REACHED: GREEN,
    TargetOutcome.ALONE: BLUE,
    TargetOutcome.OTHER_BASIN: SKY,
    TargetOutcome.SADDLE: VIOLET,
    TargetOutcome.NO_FINITE_MINIMUM: BROWN,
    TargetOutcome.INSENSITIVE: SAND,
    TargetOutcome.STALLED: ORANGE,
    TargetOutcome.OUT_OF_BUDGET: PURPLE,
    TargetOutcome.FALSE_CLAIM: VERMILLION,
}
NO_ANSWER = "#c9cdd3"
BASINS = (GREEN, SKY, BLUE, ORANGE, PURPLE)
Part = tuple[str, str, list[int]]  # of the bars: its label, its colour, and a count per solver


def plot_verdicts(comparison: Comparison, *, ax: Axes) -> Axes:
    """A bar per solver, cut into what its runs came to."""
    counts = [comparison.counted(s) for s in comparison.solvers]
    parts: list[Part] = [
        (verdict.name.lower().replace("_", " "), colour, [c[verdict] for c in counts])
        for verdict, colour in COLOURS.items()
    ]
    rest = [sum(n for v, n in c.items() if v not in COLOURS) for c in counts]
    return _bars(comparison.solvers, [*parts, ("no answer", NO_ANSWER, rest)], ax)


def caption_verdicts(comparison: Comparison) -> str:
    """What `plot_verdicts` shows; a colour is explained where it is there."""
    came = Counter[TargetOutcome]()
    for solver in comparison.solvers:
        came.update(comparison.counted(solver))
    runs = counted(len(comparison.instances), "run")
    text = (
        f"How the {runs} of each solver ended, judged by the problem's "
        "own cost and gradient at the returned point, never by what the solver reports."
    )
    if came[TargetOutcome.REACHED]:
        text += " The longer the green bar, the better."
    if came[TargetOutcome.OTHER_BASIN]:
        text += " Light blue runs converged in another basin."
    no_minimum = {
        TargetOutcome.SADDLE: "at saddle points (violet)",
        TargetOutcome.NO_FINITE_MINIMUM: "where the cost falls for ever (brown)",
        TargetOutcome.INSENSITIVE: "where the residual is insensitive to unknowns (sand)",
    }
    if met := [where for verdict, where in no_minimum.items() if came[verdict]]:
        text += f" Some ended {joined(met)}."
    if came[TargetOutcome.FALSE_CLAIM]:
        text += " Vermillion runs claim convergence at points that are not stationary."
    else:
        text += " No run claims convergence at a point that is not stationary."
    if came[TargetOutcome.ALONE]:
        text += " Blue marks the only end on a problem: nothing says whether its cost is low."
    if any(n for verdict, n in came.items() if verdict not in COLOURS):
        text += " Grey runs gave no answer, or refused a problem that the solver is not made for."
    return text


def plot_basins(comparison: Comparison, problem: str, *, ax: Axes) -> Axes:
    """A bar per solver, cut into the basins that its ends on one problem lead to."""
    names = [i.name for i in comparison.of(problem)]
    where = [[comparison.basins.get((name, s)) for name in names] for s in comparison.solvers]
    parts: list[Part] = [
        (f"basin {k + 1}" + ("" if k else ", the lowest"), colour, [row.count(k) for row in where])
        for k, colour in enumerate(BASINS)
    ]
    more = [sum(b is not None and b >= len(BASINS) for b in row) for row in where]
    none = [row.count(None) for row in where]
    parts += [("higher ones", VERMILLION, more), ("no end", NO_ANSWER, none)]
    return _bars(comparison.solvers, parts, ax)


def caption_basins(comparison: Comparison, problem: str) -> str:
    """What `plot_basins` shows."""
    own = len({id(comparison.end_analysis(i.name)) for i in comparison.of(problem)})
    each = " Every start has data, and therefore basins, of its own." if own > 1 else ""
    return (
        f"{problem}: the basins to which the ends lead when Levenberg-Marquardt goes on from them; "
        "basin 1 is the lowest. Two ends are in one basin if the residuals cannot tell them apart, "
        f"whatever the unknowns are.{each}"
    )


def _bars(solvers: Sequence[str], parts: Sequence[Part], ax: Axes) -> Axes:
    """A bar per solver of parts side by side; a part that no solver has is left out."""
    y, left = np.arange(len(solvers))[::-1], np.zeros(len(solvers))
    for label, colour, counts in parts:
        if not any(counts):
            continue
        bars = ax.barh(y, counts, left=left, color=colour, height=0.72, label=label, edgecolor="w")
        shown = [str(count or "") for count in counts]
        ax.bar_label(bars, shown, label_type="center", fontsize=8, color=INK)
        left += counts
    ax.set_yticks(y, [plain(s) for s in solvers])
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.grid(axis="x", color=FAINT, alpha=0.25, linewidth=0.6)
    ax.set(xlabel="runs", ylim=(-0.6, len(solvers) - 0.4))
    return ax
