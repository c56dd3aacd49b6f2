"""Where limbs bend and twist: a quantity by angle, for several ways of skinning."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from workbench.arrays import Array
from workbench.plots.palette import DASHES, FAINT, INK, LINES
from workbench.plots.style import plain


def plot_by_angle(
    angles: Array,
    found: Mapping[str, Array],
    quantity: str,
    *,
    ax: Axes,
    law: tuple[str, Array] | None = None,
    at_rest: float = 1.0,
) -> Axes:
    """Curves over angles (A,) rad, and what theory says, where there is one, as dots.

    A thin line marks the quantity `at_rest`.
    """
    degrees = np.degrees(angles)
    for i, (name, values) in enumerate(found.items()):
        ax.plot(degrees, values, color=LINES[i], linestyle=DASHES[i % 4], label=plain(name))
    if law is not None:
        ax.plot(degrees, law[1], ".", color=INK, markersize=4, label=plain(law[0]))
    ax.axhline(at_rest, color=FAINT, linewidth=0.7)
    ax.set(xlabel="angle (degrees)", ylabel=plain(quantity), xlim=(degrees[0], degrees[-1]))
    ax.legend()
    return ax


def caption_by_angle(angles: Array, found: Mapping[str, Array], quantity: str) -> str:
    """What `plot_by_angle` shows, at the last angle."""
    said = ", ".join(f"{name} {values[-1]:.3g}" for name, values in found.items())
    return f"{quantity[0].upper()}{quantity[1:]}; at {np.degrees(angles[-1]):.0f} degrees: {said}."
