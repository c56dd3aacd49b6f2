"""What each term of training did."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes

from benchmarks.ablations.study import Ablated
from workbench.arrays import Array
from workbench.plots.palette import DASHES, FAINT, LINES


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
