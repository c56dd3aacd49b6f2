"""Vertices against triangles: what their shape directions explain, and errors on posed bodies."""

from collections.abc import Mapping

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from workbench.plots.body import Figurine, line_up
from workbench.plots.palette import AMOUNT, BLUE, FAINT, GREEN, VERMILLION
from workbench.training.triangles.measures import Held
from workbench.training.triangles.study import Shapes

Array = NDArray[np.float64]
LEVELS = (0.9, 0.95, 0.99)
ROUND = (0, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
COLOURS = {"vertices": BLUE, "triangles": VERMILLION}


def plot_explained(shapes: Shapes, *, ax: Axes) -> Axes:
    """Share of the variance against the number of shape directions, from 1, logarithmic."""
    for level in LEVELS:
        ax.axhline(100 * level, color=FAINT, linewidth=0.7, alpha=0.6)
    for name, colour in COLOURS.items():
        for group, line, who in (
            (shapes.learned, "-", "learned from"), (shapes.strangers, "--", "strangers")
        ):  # fmt: skip
            share = 100 * group[name].share[1:]
            ax.plot(np.arange(1, len(share) + 1), share, line, color=colour,
                    label=f"{name}, {who}")  # fmt: skip
    own = 100 * shapes.gradients[1:]
    ax.plot(np.arange(1, len(own) + 1), own, ":", color=GREEN,
            label="gradients themselves, learned from")  # fmt: skip
    ax.set_xscale("log")
    _counts(ax, 1, len(own))
    ax.set_ylim(top=100.5)
    ax.set_xlabel("shape directions")
    ax.set_ylabel("share of the variance explained (%)")
    ax.legend(loc="lower right")
    return ax


def caption_explained(shapes: Shapes) -> str:
    """What `plot_explained` shows."""
    v, t = (shapes.learned[name].share for name in COLOURS)
    k = 1 + int(np.argmax(shapes.leads))
    return (
        f"Grey lines: 90, 95 and 99 %. Of the people learned from, one direction of vertices "
        f"explains {v[1]:.1%}, one of triangles {t[1]:.1%}; vertices lead most at k = {k}, "
        f"{v[k]:.1%} to {t[k]:.1%}, and lag at no k, as Eckart and Young say. Dotted: the variance "
        "of the gradients themselves, to which every small wrinkle counts as much as stature."
    )


def plot_left(shapes: Shapes, *, ax: Axes) -> Axes:
    """The rms distance that shape directions leave, of strangers and of those learned from."""
    for name, colour in COLOURS.items():
        for group, line, who in (
            (shapes.learned, "-", "learned from"), (shapes.strangers, "--", "strangers")
        ):  # fmt: skip
            rms = 1e3 * group[name].rms[:-1]
            ax.plot(np.arange(len(rms)), rms, line, color=colour, label=f"{name}, {who}")
    ax.set_xscale("symlog", linthresh=1)
    _counts(ax, 0, len(shapes.leads) - 1)
    ax.set_yscale("log")
    ax.set_ylim(bottom=0.1)
    shown = [mm for mm in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50) if mm <= ax.get_ylim()[1]]
    ax.set_yticks(shown, [f"{mm:g}" for mm in shown])
    ax.minorticks_off()
    ax.set_xlabel("shape directions")
    ax.set_ylabel("rms distance left (mm)")
    ax.legend(loc="lower left")
    return ax


def _counts(ax: Axes, low: int, high: int) -> None:
    shown = [k for k in ROUND if low <= k <= high]
    ax.set_xticks(shown, [str(k) for k in shown])
    ax.set_xlim(low, high)
    ax.minorticks_off()


def caption_left(shapes: Shapes, k: int) -> str:
    """What `plot_left` shows, said at k."""
    v, t = (1e3 * shapes.strangers[name].rms[k] for name in COLOURS)
    return (
        f"Everybody at rest, centroids laid together. {k} directions leave strangers {v:.2f} mm "
        f"with vertices and {t:.2f} mm with triangles; on strangers no theorem says who is better."
    )


def largest_shown(hard: Mapping[str, Held]) -> float:
    """Where the colours of `plot_errors` end: what 99 % of all distances are below, mm."""
    return float(np.percentile(np.concatenate([h.distances for h in hard.values()]), 99))


def plot_errors(held: Held, faces: NDArray[np.int64], largest: float, *, ax: Axes) -> Axes:
    """A model in several poses, coloured by its distance to the truth from 0 to `largest` mm."""
    scale = Normalize(0.0, largest)
    shown = [
        Figurine(f"{away.mean():.1f} mm", V - V.min(axis=0), colours=matplotlib.colormaps[AMOUNT](
            scale(away[faces].mean(axis=1)))[:, :3])
        for V, away in zip(held.fits.surfaces, held.distances, strict=True)
    ]  # fmt: skip
    line_up(shown, faces, ax=ax, contrast=0.25)
    figure = ax.get_figure()
    assert figure is not None
    bar = figure.colorbar(ScalarMappable(scale, AMOUNT), ax=ax, shrink=0.85, pad=0.02, extend="max")
    bar.set_label("distance to the synthetic truth (mm)")
    return ax


def caption_errors(model: str, held: Held) -> str:
    """What `plot_errors` shows."""
    return (
        f"{model} in {len(held.distances)} hard poses, none of them learned from; below each its "
        f"mean distance. Over all of them {held.mean:.1f} mm in the mean, {held.rms:.1f} mm "
        f"rms, {held.largest:.0f} mm at most."
    )
