"""How much of people's shape the first directions explain."""

import numpy as np
from matplotlib.axes import Axes

from workbench.arrays import Array
from workbench.plots.palette import BLUE, FAINT, VERMILLION


def plot_left_over(left: Array, *, ax: Axes) -> Axes:
    """`left` (B + 1, P) m: what remains of P people without the first 0 ... B directions."""
    b = np.arange(len(left))
    ax.plot(b, 1e3 * left, color=FAINT, linewidth=0.9)
    ax.plot(b, 1e3 * left.mean(axis=1), color=VERMILLION, marker="o", label="mean of these people")
    ax.set(xlabel="shape directions used", ylabel="rms distance left (mm)", xlim=(0, b[-1]))
    ax.set_ylim(bottom=0)
    ax.legend()
    return ax


def caption_left_over(left: Array) -> str:
    """What `plot_left_over` shows."""
    mean = 1e3 * left.mean(axis=1)
    return (
        f"{left.shape[1]} held-out people at rest: the mean person is {mean[0]:.1f} mm off, one "
        f"direction leaves {mean[1]:.1f} mm, and {len(mean) - 1} leave {mean[-1]:.1f} mm. Thin "
        "lines are single people."
    )


def plot_variances(shares: Array, *, ax: Axes) -> Axes:
    """Bars of each direction's share of the variance of all, and their running sum, (B,)."""
    k = np.arange(1, len(shares) + 1)
    ax.bar(k, 100 * shares, color=BLUE, width=0.7, label="of one direction")
    ax.plot(k, 100 * np.cumsum(shares), color=VERMILLION, marker="o", label="of all up to it")
    ax.set_xticks(k)
    ax.set(xlabel="shape direction", ylabel="share of the population's variance (%)", ylim=(0, 103))
    ax.legend(loc="center right")
    return ax


def caption_variances(shares: Array) -> str:
    """What `plot_variances` shows."""
    return (
        f"Variance explained: the first direction {shares[0]:.0%}, the first two "
        f"{shares[:2].sum():.0%}, all {len(shares)} {shares.sum():.1%}. The population was made by "
        "a program; people vary in more ways."
    )
