"""A comparison of solvers: verdicts, profiles, and how the cost came down in every run."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from workbench.arrays import Array
from workbench.comparison import Comparison, TargetOutcome
from workbench.comparison.statistics import data_profile, performance_profile, ratios
from workbench.comparison.targets import tau_text
from workbench.diagnostics.words import counted
from workbench.plots.palette import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    solver_styles,
)
from workbench.plots.style import decades, plain, side_by_side

SHEET_WIDTH = 8.0  # inches
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
PROFILE_POINTS = 400  # of a profile
EQUAL_NOTE = "Where curves are equal, those below stand out on both sides."
LEAST_DRAWN = 1e-12  # of the way from the start to the lowest cost; smaller values are drawn there
EFFORT, SECONDS = 0, 1  # columns of `Comparison.trace`
ABSCISSAE = {  # the label of each, and the smallest number that is drawn
    EFFORT: ("effort (evaluations of the residual)", 0.8),
    SECONDS: ("measured time (s)", 1e-4),
}


def plot_verdicts(comparison: Comparison, *, ax: Axes) -> Axes:
    """A bar per solver, cut into what its runs came to."""
    counts = [comparison.outcome_counts(s) for s in comparison.solvers]
    parts = [
        (verdict.name.lower().replace("_", " "), colour, [c[verdict] for c in counts])
        for verdict, colour in COLOURS.items()
    ]
    rest = [sum(n for v, n in c.items() if v not in COLOURS) for c in counts]
    y, left = np.arange(len(counts))[::-1], np.zeros(len(counts))
    for label, colour, runs in [*parts, ("no answer", NO_ANSWER, rest)]:
        if not any(runs):
            continue
        bars = ax.barh(y, runs, left=left, color=colour, height=0.72, label=label, edgecolor="w")
        shown = [str(count or "") for count in runs]
        ax.bar_label(bars, shown, label_type="center", fontsize=8, color=INK)
        left += runs
    ax.set_yticks(y, [plain(s) for s in comparison.solvers])
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.grid(axis="x", color=FAINT, alpha=0.25, linewidth=0.6)
    ax.set(xlabel="runs", ylim=(-0.6, len(counts) - 0.4))
    return ax


def caption_verdicts(comparison: Comparison) -> str:
    """What `plot_verdicts` shows."""
    runs = counted(len(comparison.instances), "run")
    return (
        f"How the {runs} of each solver ended, judged by the problem's own cost and gradient at "
        "the returned point, never by what the solver reports. The longer the green bar, the "
        "better. False claims are of convergence at points that are not stationary; runs without "
        "an answer include those of solvers that refuse such a problem."
    )


def plot_performance_profile(comparison: Comparison, tau: float, *, ax: Axes) -> Axes:
    """rho_s(alpha): the share of starts on which s needs at most alpha times the least effort."""
    names, needed = _counted_solvers(comparison, tau)
    effort_ratios = ratios(needed)
    widest = float(np.max(effort_ratios[np.isfinite(effort_ratios)], initial=2.0))
    alphas = np.geomspace(1.0, 1.3 * widest, PROFILE_POINTS)
    _curves(comparison, names, alphas, performance_profile(needed, alphas), tau, ax)
    ax.set_xlabel("effort over the least of all (ratio α)")
    return ax


def plot_data_profile(comparison: Comparison, tau: float, *, ax: Axes) -> Axes:
    """d_s(kappa): the share of starts brought to the target within kappa simplex gradients."""
    names, needed = _counted_solvers(comparison, tau)
    unknowns = np.array([comparison.described[i.name].unknowns for i in comparison.comparable])
    effort = needed / (unknowns[:, None] + 1)
    finite = effort[np.isfinite(effort)]
    low = 0.7 * float(np.min(finite, initial=1.0))
    kappas = np.geomspace(max(low, 1e-3), 1.5 * float(np.max(finite, initial=2.0)), PROFILE_POINTS)
    _curves(comparison, names, kappas, data_profile(needed, unknowns, kappas), tau, ax)
    ax.set_xlabel("effort (simplex gradients κ)")
    return ax


def _counted_solvers(comparison: Comparison, tau: float) -> tuple[tuple[str, ...], Array]:
    """The solvers whose effort is known from every start, and their efforts (P, S)."""
    names = comparison.all_counted(tau)
    return names, comparison.needed(tau)[:, [comparison.solvers.index(s) for s in names]]


def _curves(
    comparison: Comparison, names: tuple[str, ...], x: Array, shares: Array, tau: float, ax: Axes
) -> None:
    for solver, style in solver_styles(comparison.solvers).items():
        if solver not in names:
            ax.plot([], [], linewidth=1.6, label=plain(f"{solver}: not counted"), **style.line)
    for k, solver in enumerate(names):
        # equal curves lie on each other: those below are wider, and show on both sides
        width = 1.4 + 3.0 * (1 - (k + 1) / len(names))
        style = solver_styles(comparison.solvers)[solver]
        y = shares[:, k]
        ax.step(x, y, where="post", linewidth=width, label=plain(solver), **style.line)
    ax.set(xscale="log", xlim=(x[0], x[-1]), ylim=(-0.03, 1.05), ylabel="share of the starts")
    decades(ax.xaxis, x[0], x[-1])
    ax.yaxis.set_major_formatter(PercentFormatter(1.0))
    ax.set_title(f"target τ = {tau_text(tau)}", loc="left")
    ax.grid(color=FAINT, alpha=0.25, linewidth=0.6)


def caption_performance_profile(comparison: Comparison) -> str:
    """What `plot_performance_profile` shows."""
    warning = (
        " With more than two solvers this figure must not be read as a ranking: the ratio is taken "
        "to the best of those present, and leaving one solver out can reverse the order of two "
        "others (Gould and Scott, ACM Trans. Math. Softw. 43, 2016). Compare two of them alone."
        if len(comparison.solvers) > 2
        else ""
    )
    return (
        "Performance profiles (Dolan and Moré 2002). At the left edge: the share of the "
        f"{len(comparison.comparable)} starts on which a solver needed the least effort of all. At "
        "the right edge: the share on which it met the target at all. Higher is better: a curve "
        "that starts high is of a cheap solver, one that ends high of a reliable one. Effort "
        f"is counted in evaluations of the residual, at fixed prices. {EQUAL_NOTE}" + warning
    )


def caption_data_profile(comparison: Comparison) -> str:
    """What `plot_data_profile` shows."""
    return (
        "Data profiles (Moré and Wild 2009): the share of the "
        f"{len(comparison.comparable)} starts that a solver has brought to the target once it has "
        "spent a given effort, in simplex gradients: n + 1 residuals for n unknowns. Read it at "
        "the effort that you can afford; no curve depends on the other solvers. Where a curve "
        f"stops rising below 100 %, the rest is never solved within the budget. {EQUAL_NOTE}"
    )


def plot_cost_traces(
    comparison: Comparison, problem: str, *, ax: Axes, against: int = EFFORT
) -> Axes:
    """(f - f*) / (f_0 - f*) of the best point so far: a line per run, a colour per solver.

    `against` is EFFORT or SECONDS.
    """
    instances = comparison.instances_of(problem)
    alpha = 0.9 if len(instances) == 1 else max(0.25, 0.8 / len(instances) ** 0.5)
    label, least = ABSCISSAE[against]
    longest = least * 10
    for solver, style in solver_styles(comparison.solvers).items():
        for instance in instances:
            trace = comparison.trace(instance, solver)
            if not len(trace):
                continue
            x = np.maximum(trace[:, against], least)
            longest = max(longest, float(np.max(x, where=np.isfinite(x), initial=0.0)))
            y = np.maximum(trace[:, 2], LEAST_DRAWN)
            ax.step(x, y, where="post", linewidth=1.3, alpha=alpha, **style.line)
            ax.plot(x[-1:], y[-1:], ".", color=style.color, alpha=alpha, markersize=5)
        ax.plot([], [], linewidth=1.6, label=plain(solver), **style.line)
    for tau in comparison.taus:
        ax.axhline(tau, color=FAINT, linewidth=0.7, linestyle=(0, (1, 3)))
    ax.set(yscale="log", ylim=(LEAST_DRAWN / 3, 5), ylabel="(f − f*) / (f₀ − f*)")
    decades(ax.yaxis, LEAST_DRAWN, 1.0)
    ax.grid(color=FAINT, alpha=0.2, linewidth=0.6)
    ax.set(xscale="log", xlim=(least, 1.5 * longest), xlabel=label)
    decades(ax.xaxis, least, 1.5 * longest)
    return ax


def caption_cost_traces(comparison: Comparison, problem: str) -> str:
    """What `plot_cost_traces` shows."""
    instances = comparison.instances_of(problem)
    runs = "one run of each solver" if len(instances) == 1 else f"{len(instances)} runs of each"
    return (
        f"{problem}: how far the best point so far was above the lowest known cost, as a share of "
        f"the difference between that and the cost at the start; {runs}, with a dot where a run "
        "ended. Dotted lines are the targets. Values below "
        f"{tau_text(LEAST_DRAWN)} are drawn there. A line that stays flat above the targets is in "
        "another basin, or stuck. Effort is counted at fixed prices; time is measured, and "
        "differs from machine to machine and from run to run."
    )


def verdicts_sheet(comparison: Comparison) -> Figure:
    """The verdicts on the runs, a bar per solver."""
    plot = partial(plot_verdicts, comparison)
    return side_by_side([plot], SHEET_WIDTH, 1.5 + 0.36 * len(comparison.solvers), columns=4)


def curves_sheet(comparison: Comparison, plots: Sequence[Callable[..., object]]) -> Figure:
    """Plots side by side, with room for a line of the legend for every three solvers."""
    legend_rows = (len(comparison.solvers) + 2) // 3
    return side_by_side(plots, SHEET_WIDTH, 3.6 + 0.2 * legend_rows, columns=3)


def cost_traces_sheet(comparison: Comparison, problem: str) -> Figure:
    """The cost of every run against effort and against time."""
    plot = partial(plot_cost_traces, comparison, problem)
    return curves_sheet(comparison, [partial(plot, against=column) for column in ABSCISSAE])
