"""How the lowest cost rises as one entry is held away from its best value."""

import numpy as np
from matplotlib.axes import Axes

from workbench.fitting.refits import Profile
from workbench.plots.palette import BLUE, FAINT, GREEN, VERMILLION

SHOWN = 2.5  # of the rise at the ends of the interval: the height of the axes


def plot_profile_likelihood(profile: Profile, *, ax: Axes) -> Axes:
    """The rise of the cost against the entry, beside Laplace's parabola, with the interval."""
    rises = profile.costs - profile.costs.min()
    ax.axhspan(0, profile.rise, color=GREEN, alpha=0.08, linewidth=0)
    ax.axhline(profile.rise, color=FAINT, linewidth=0.8)
    ax.plot(profile.at, rises, "o-", color=BLUE, markersize=4, label="profile")
    if np.isfinite(profile.sd):
        x = np.linspace(profile.at[0], profile.at[-1], 200)
        parabola = ((x - profile.best) / profile.sd) ** 2 / 2
        ax.plot(x, parabola, "--", color=VERMILLION, label="Laplace")
    for end in profile.interval:
        if np.isfinite(end):
            ax.plot([end, end], [0, profile.rise], color=BLUE, linewidth=0.9)
    unit = "" if profile.unit == "1" else f" ({profile.unit})"
    ax.set(
        xlabel=f"{profile.entry}{unit}",
        ylabel="rise of the lowest cost",
        ylim=(0, SHOWN * profile.rise),
    )
    ax.legend(loc="upper center")
    return ax


def caption_profile_likelihood(profile: Profile) -> str:
    """What `plot_profile_likelihood` shows."""
    return (
        "Every point is a fit of all other unknowns. Where the lowest cost has risen by "
        f"{profile.rise:.2f}, the interval ends: {profile}."
    )
