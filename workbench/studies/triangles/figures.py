"""Figures of the triangle study: what shape directions explain, and errors on posed bodies."""

from collections.abc import Callable, Mapping
from itertools import product

import numpy as np
from matplotlib.axes import Axes

from workbench.arrays import Array, Index
from workbench.plots.body import Figurine, line_up_coloured
from workbench.plots.palette import BLUE, FAINT, GREEN, VERMILLION
from workbench.studies.triangles.explained_variance import ExplainedVariance
from workbench.studies.triangles.measures import HeldOutFits
from workbench.studies.triangles.study import ShapeDirections

LEVELS = (0.9, 0.95, 0.99)
ROUND = (0, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
COLOURS = {"vertices": BLUE, "triangles": VERMILLION}


def plot_explained(shapes: ShapeDirections, *, ax: Axes) -> Axes:
    """Share of the variance against the number of shape directions, from 1, logarithmic."""
    for level in LEVELS:
        ax.axhline(100 * level, color=FAINT, linewidth=0.7, alpha=0.6)
    _curves(ax, 1, shapes, lambda explained: 100 * explained.share)
    own, label = 100 * shapes.gradients[1:], "gradients themselves, training"
    ax.plot(np.arange(1, len(own) + 1), own, ":", color=GREEN, label=label)
    ax.set_xscale("log")
    _counts(ax, 1, len(own))
    ax.set_ylim(top=100.5)
    ax.set(xlabel="shape directions", ylabel="share of the variance explained (%)")
    ax.legend(loc="lower right")
    return ax


def caption_explained(shapes: ShapeDirections) -> str:
    """The caption of `plot_explained`."""
    v, t = (shapes.training[name].share for name in COLOURS)
    k = 1 + int(np.argmax(shapes.leads))
    return (
        "The grey lines are at 90, 95 and 99 %. Of the training people one direction of vertices "
        f"explains {v[1]:.1%}, and one of triangles {t[1]:.1%}. The difference is largest at k = "
        f"{k}, {v[k]:.1%} and {t[k]:.1%}; at no k do triangles explain more, as the theorem of "
        "Eckart and Young says. The dotted line is the variance of the gradients themselves, in "
        "which every small wrinkle counts as much as stature."
    )


def plot_rms(shapes: ShapeDirections, *, ax: Axes) -> Axes:
    """The rms distance that shape directions leave, of training and held-out people."""
    _curves(ax, 0, shapes, lambda explained: 1e3 * explained.rms[:-1])
    ax.set_xscale("symlog", linthresh=1)
    _counts(ax, 0, len(shapes.leads) - 1)
    ax.set(yscale="log", ylim=(0.1, None))
    shown = [mm for mm in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50) if mm <= ax.get_ylim()[1]]
    ax.set_yticks(shown, [f"{mm:g}" for mm in shown])
    ax.minorticks_off()
    ax.set(xlabel="shape directions", ylabel="rms distance left (mm)")
    ax.legend(loc="lower left")
    return ax


def _curves(
    ax: Axes, first: int, shapes: ShapeDirections, of: Callable[[ExplainedVariance], Array]
) -> None:
    """A curve for each kind of directions and each group of people, from `first` directions on."""
    groups = {"training": (shapes.training, "-"), "held out": (shapes.held_out, "--")}
    for (name, colour), (who, (group, line)) in product(COLOURS.items(), groups.items()):
        y = of(group[name])[first:]
        x = first + np.arange(len(y))
        ax.plot(x, y, line, color=colour, label=f"{name}, {who}")


def _counts(ax: Axes, low: int, high: int) -> None:
    shown = [k for k in ROUND if low <= k <= high]
    ax.set_xticks(shown, [str(k) for k in shown])
    ax.set_xlim(low, high)
    ax.minorticks_off()


def caption_rms(shapes: ShapeDirections, k: int) -> str:
    """The caption of `plot_rms`, with the numbers at k."""
    v, t = (1e3 * shapes.held_out[name].rms[k] for name in COLOURS)
    return (
        f"Everybody at rest, with their centroids laid together. {k} directions leave an error of "
        f"{v:.2f} mm on held-out people with vertices, and of {t:.2f} mm with triangles; for "
        "held-out people no theorem says which is less."
    )


def largest_shown(fits: Mapping[str, HeldOutFits]) -> float:
    """Where the colours of `plot_errors` end, mm: 99 % of all distances are smaller."""
    distances = np.concatenate([1e3 * h.errors.distances for h in fits.values()])
    return float(np.percentile(distances, 99))


def plot_errors(fits: HeldOutFits, faces: Index, largest: float, *, ax: Axes) -> Axes:
    """A model in several poses, coloured by its distance to the truth from 0 to `largest` mm."""
    measured = [
        (Figurine(f"{away.mean():.1f} mm", V - V.min(axis=0)), away)
        for V, away in zip(fits.fits.surfaces, 1e3 * fits.errors.distances, strict=True)
    ]
    label = "distance to the synthetic truth (mm)"
    return line_up_coloured(measured, faces, largest, label, ax=ax)


def caption_errors(model: str, fits: HeldOutFits) -> str:
    """The caption of `plot_errors`."""
    errors = fits.errors
    return (
        f"{model} in {len(errors.distances)} difficult poses, on none of which it was trained. The "
        f"number below each is its mean distance. Over all of them the mean is "
        f"{1e3 * errors.mean:.1f} mm, the rms {1e3 * errors.rms:.1f} mm, the largest distance "
        f"{1e3 * errors.largest:.0f} mm."
    )
