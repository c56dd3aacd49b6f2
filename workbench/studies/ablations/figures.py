"""How a training went, and what each of its terms did."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes

from workbench.arrays import Array
from workbench.plots.palette import DASHES, FAINT, LINES, MARKERS
from workbench.studies.ablations.study import Ablated
from workbench.training.progress import LogEntry

TERMS = ("E_D", "E_Y", "E_J", "E_P", "E_W")
NOTHING = 1e-6  # of the last cost: a term below is rounding, and not drawn


def plot_costs(log: Sequence[LogEntry], *, ax: Axes) -> Axes:
    """The cost after every block, the whole and by term."""
    at = np.arange(len(log) + 1)
    least = NOTHING * sum(log[-1].after.values())
    for i, term in enumerate(TERMS):
        costs = [log[0].before[term], *(entry.after[term] for entry in log)]
        if max(costs) > least:
            shown = np.where(np.array(costs) > least, costs, np.nan)
            ax.plot(at, shown, color=LINES[i + 1], marker=MARKERS[i + 1], markersize=4, label=term)
    total = [sum(log[0].before.values()), *(sum(entry.after.values()) for entry in log)]
    ax.plot(at, total, color=LINES[0], marker=MARKERS[0], markersize=5, linewidth=2, label="all")
    ax.set_yscale("log")
    ax.set_xticks(at, ["start", *(entry.block for entry in log)], rotation=60, ha="right")
    ax.set_ylabel("cost (half a sum of squares in sigmas)")
    ax.grid(axis="y", color=FAINT, alpha=0.25, linewidth=0.6)
    ax.legend(ncols=2)
    return ax


def caption_costs(log: Sequence[LogEntry]) -> str:
    """The caption of `plot_costs`."""
    totals = [sum(log[0].before.values()), *(sum(entry.after.values()) for entry in log)]
    fell = sum(b < a for a, b in pairwise(totals))
    where = "every block" if fell == len(log) else f"{fell} of {len(log)} blocks"
    return (
        f"The cost falls in {where}, and goes from {totals[0]:.4g} to {totals[-1]:.4g}. Single "
        "terms may rise where others fall by more: templates may leave symmetry for the data."
    )


def plot_pose_in_shape(results: Sequence[Ablated], *, ax: Axes) -> Axes:
    """The share of the first shape coordinates that a linear function of pose explains."""
    width = 0.8 / max(len(results), 1)
    for i, result in enumerate(results):
        at = np.arange(len(result.pose_in_shape)) + (i - (len(results) - 1) / 2) * width
        ax.bar(
            at,
            100 * np.array(result.pose_in_shape),
            width,
            color=LINES[i],
            label=result.name,
            hatch=("", "//", "..", "xx")[i % 4],
            edgecolor="white",
            linewidth=0.5,
        )
    count = max((len(r.pose_in_shape) for r in results), default=0)
    ax.set_xticks(np.arange(count), [f"direction {k + 1}" for k in range(count)])
    ax.set_ylabel("variance that pose explains (%)")
    ax.axhline(0, color=FAINT, linewidth=0.6)
    ax.legend()
    return ax


def caption_pose_in_shape(results: Sequence[Ablated]) -> str:
    """The caption of `plot_pose_in_shape`."""
    most = max(results, key=lambda result: max(result.pose_in_shape, default=0.0))
    return (
        "Shape directions should not depend on pose; without pose normalisation they can describe "
        f"how people stood. Pose explains most of one of them with {most.name}: "
        f"{max(most.pose_in_shape, default=0.0):.0%}. (R^2 of a principal coordinate on the pose's "
        "numbers, less what as many random numbers would explain; it can be a little below zero.)"
    )


def plot_turn_errors(errors: Mapping[str, Array], *, ax: Axes) -> Axes:
    """The share of joints whose rotation has a smaller error, against the error."""
    for i, (name, found) in enumerate(errors.items()):
        degrees = np.sort(np.degrees(found[:, 1:]).ravel())
        share = 100 * np.arange(1, len(degrees) + 1) / len(degrees)
        ax.plot(degrees, share, color=LINES[i], linestyle=DASHES[i], linewidth=1.8, label=name)
    ax.set_xscale("log")
    ax.set_xlabel("error of a joint's rotation (degrees)")
    ax.set_ylabel("joints with a smaller error (%)")
    ax.set_ylim(0, 100)
    ax.grid(color=FAINT, alpha=0.25, linewidth=0.6)
    ax.legend(title="fitted to")
    return ax


def caption_turn_errors(errors: Mapping[str, Array]) -> str:
    """The caption of `plot_turn_errors`."""
    means = {name: np.degrees(found[:, 1:].mean()) for name, found in errors.items()}
    means_in_words = ", ".join(f"{mean:.1f} degrees by {name}" for name, mean in means.items())
    people = len(next(iter(errors.values())))
    return (
        f"The poses of {people} made-up people were fitted with the mean template. The mean error "
        f"is {means_in_words}. Edges hardly depend on how long a limb is; a fit to vertices bends "
        "the body until it reaches them."
    )
