"""Profiles: which share of the starts each solver brings to a target within how much effort."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import PercentFormatter

from workbench.arrays import Array
from workbench.comparison import Comparison
from workbench.comparison.profiles import data_profile, performance_profile, ratios
from workbench.comparison.targets import named
from workbench.plots.palette import FAINT, solver_styles
from workbench.plots.style import decades, plain

POINTS = 400
EQUAL = "Where curves are equal, those below stand out on both sides."


def plot_performance_profile(comparison: Comparison, tau: float, *, ax: Axes) -> Axes:
    """rho_s(alpha): the share of starts on which s needs at most alpha times the least effort."""
    names, needed = _known(comparison, tau)
    found = ratios(needed)
    widest = float(np.max(found[np.isfinite(found)], initial=2.0))
    alphas = np.geomspace(1.0, 1.3 * widest, POINTS)
    _curves(comparison, names, alphas, performance_profile(needed, alphas), tau, ax)
    ax.set_xlabel("effort over the least of all (ratio α)")
    return ax


def plot_data_profile(comparison: Comparison, tau: float, *, ax: Axes) -> Axes:
    """d_s(kappa): the share of starts brought to the target within kappa simplex gradients."""
    names, needed = _known(comparison, tau)
    unknowns = np.array([comparison.described[i.name].unknowns for i in comparison.comparable])
    effort = needed / (unknowns[:, None] + 1)
    finite = effort[np.isfinite(effort)]
    low = 0.7 * float(np.min(finite, initial=1.0))
    kappas = np.geomspace(max(low, 1e-3), 1.5 * float(np.max(finite, initial=2.0)), POINTS)
    _curves(comparison, names, kappas, data_profile(needed, unknowns, kappas), tau, ax)
    ax.set_xlabel("effort (simplex gradients κ)")
    return ax


def _known(comparison: Comparison, tau: float) -> tuple[tuple[str, ...], Array]:
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
    ax.set_title(f"target τ = {named(tau)}", loc="left")
    ax.grid(color=FAINT, alpha=0.25, linewidth=0.6)


def caption_performance_profile(comparison: Comparison) -> str:
    """What `plot_performance_profile` shows."""
    warning = (
        " With more than two solvers this figure must not be read as a ranking: the ratio is taken "
        "to the best of those present, and leaving one solver out can reverse the order of two "
        "others (Gould and Scott, ACM Trans. Math. Softw. 43, 2016). The table of pairs compares "
        "two solvers at a time."
        if len(comparison.solvers) > 2
        else ""
    )
    return (
        "Performance profiles (Dolan and Moré 2002). At the left edge: the share of the "
        f"{len(comparison.comparable)} starts on which a solver needed the least effort of all. At "
        "the right edge: the share on which it met the target at all. Higher is better: a curve "
        "that starts high is of a cheap solver, one that ends high of a reliable one. Effort "
        f"is counted in evaluations of the residual, at fixed prices. {EQUAL}" + warning
    )


def caption_data_profile(comparison: Comparison) -> str:
    """What `plot_data_profile` shows."""
    return (
        "Data profiles (Moré and Wild 2009): the share of the "
        f"{len(comparison.comparable)} starts that a solver has brought to the target once it has "
        "spent a given effort, in simplex gradients: n + 1 residuals for n unknowns. Read it at "
        "the effort that you can afford; no curve depends on the other solvers. Where a curve "
        f"stops rising below 100 %, the rest is never solved within the budget. {EQUAL}"
    )
