"""Whether a derivative is right: the linear model's error must shrink like the step squared."""

import numpy as np
from matplotlib.axes import Axes

from workbench.diagnostics import Diagnosis
from workbench.plots.palette import BLUE, FAINT


def plot_taylor(diagnosis: Diagnosis, *, ax: Axes) -> Axes:
    """|r(x + h d) - r(x) - h J d| against h on two logarithmic axes, with a slope of two."""
    check = diagnosis.derivatives
    h, error = check.steps, check.taylor
    drawn = np.isfinite(error) & (error > 0)
    ax.loglog(h[drawn], error[drawn], "o-", color=BLUE, markersize=4, label="this Jacobian")
    if drawn.any():
        for slope, line, verdict in ((2, "--", "right"), (1, ":", "wrong")):
            y = error[drawn][0] * (h / h[drawn][0]) ** slope
            ax.loglog(h, y, color=FAINT, linestyle=line, label=f"slope {slope}: {verdict}")
    ax.set(xlabel="step h (units of the unknowns)", ylabel="error of the linear model (sigmas)")
    ax.grid(color=FAINT, alpha=0.25, linewidth=0.6)
    ax.legend(loc="upper left")
    return ax


def caption_taylor(diagnosis: Diagnosis) -> str:
    """What `plot_taylor` shows."""
    check = diagnosis.derivatives
    slope = check.slope
    if slope is None:
        return "The residual is linear, or too nearly so for its second order to be seen."
    verdict = "as it must" if slope > 1.5 else "but should shrink like h^2: a derivative is wrong"
    h, error = check.steps, check.taylor
    largest, least = np.argmax(h), np.argmin(h)
    expected = error[largest] * (h[least] / h[largest]) ** slope
    rounded = " At the smallest steps rounding dominates." if error[least] > 2 * expected else ""
    return (
        f"The error of the linear model for a step of length h in a random direction shrinks like "
        f"h^{slope:.2f}, {verdict}.{rounded}"
    )
