"""Figures of the study of predictors: their errors, what they cost, and where they go wrong."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes

from workbench.arrays import Array
from workbench.plots.palette import BLUE, DASHES, FAINT, INK, LINES, VERMILLION
from workbench.plots.style import plain
from workbench.studies.blend_shapes.predictors import INTERPOLATION, LINEAR, Result
from workbench.studies.blend_shapes.questions import FACTORS, TURNS, ByExamples, ByPenalty

LENGTH = "rms length of the blend shapes (mm)"
ROUND = [d * 10.0**e for e in range(-2, 3) for d in (1, 2, 5)]  # ticks, mm or ms


def plot_predictors(results: Sequence[Result], *, ax: Axes) -> Axes:
    """Mean distances as bars, the largest as dots, best at the top, on a logarithmic scale."""
    rows = np.arange(len(results))[::-1]
    colours = [VERMILLION if r.name == LINEAR else BLUE for r in results]
    means = [r.accuracy.mean for r in results]
    bars = ax.barh(rows, means, color=colours, height=0.65)
    ax.plot([r.accuracy.largest for r in results], rows, "o", color=INK, markersize=4)
    ax.bar_label(bars, fmt="%.2f", padding=4, fontsize=8.5)
    ax.set_xscale("log")
    ax.set_yticks(rows, [plain(r.name) for r in results])
    ax.set_xlabel("distance to the teacher's vertices (mm): mean (bar), largest (dot)")
    ax.grid(axis="x", color=FAINT, alpha=0.3, linewidth=0.6)
    return ax


def caption_predictors(results: Sequence[Result], test: str, n_test: int) -> str:
    """The caption of `plot_predictors`."""
    best, linear = results[0], next(r for r in results if r.name == LINEAR)
    text = (
        f"The distance of posed vertices on {n_test} {test.split(':')[0]}, on a logarithmic scale. "
        f"Linear blending alone (red) is {linear.accuracy.mean:.2f} mm off on average; {best.name} "
        f"is the best with {best.accuracy.mean:.2f} mm."
    )
    boneless = [r.accuracy.mean for r in results if r.name.endswith("no bones")]
    if boneless:
        text += (
            f" Functions of theta without bones are between {min(boneless):.1f} mm and "
            f"{max(boneless):.1f} mm off."
        )
    return text


def plot_by_examples(rows: Sequence[ByExamples], *, ax: Axes) -> Axes:
    """Error and time of interpolation against the number of examples."""
    n = [row.n for row in rows]
    for name, found, colour, marker in (
        ("exact RBF", [row.exact for row in rows], BLUE, "o"),
        ("normalised kernel", [row.normalised for row in rows], VERMILLION, "s"),
    ):
        label, times = f"{name}: mean distance (mm)", [each.milliseconds for each in found]
        ax.plot(n, [each.mean for each in found], color=colour, marker=marker, label=label)
        label = f"{name}: time for one pose (ms)"
        ax.plot(n, times, "--", color=colour, marker=marker, alpha=0.7, label=label)
    ax.set(xscale="log", yscale="log")
    ax.set_xticks(n, [str(x) for x in n])
    low, high = ax.get_ylim()
    shown = [y for y in ROUND if low <= y <= high]
    ax.set_yticks(shown, [f"{y:g}" for y in shown])
    ax.minorticks_off()
    ax.set(xlabel="examples", ylabel="mm, or ms")
    ax.legend()
    return ax


def caption_by_examples(rows: Sequence[ByExamples]) -> str:
    """The caption of `plot_by_examples`."""
    few, many = rows[0], rows[-1]
    return (
        "The first problem of scattered data interpolation: accuracy has to be bought with "
        "examples, each of which is stored and evaluated at every pose. From "
        f"{few.n} to {many.n} examples the exact RBF goes from {few.exact.mean:.2f} to "
        f"{many.exact.mean:.2f} mm and from {few.exact.milliseconds:.2g} to "
        f"{many.exact.milliseconds:.2g} ms for a pose; the normalised kernel goes from "
        f"{few.normalised.mean:.2f} to {many.normalised.mean:.2f} mm."
    )


def plot_by_factor(found: Mapping[str, Array], *, ax: Axes) -> Axes:
    """How long blend shapes become when poses are exaggerated."""
    for i, (name, sizes) in enumerate(found.items()):
        ax.plot(FACTORS, sizes, color=LINES[i], linestyle=DASHES[i % 4], label=plain(name))
    ax.axvspan(0, 1, color=FAINT, alpha=0.15, linewidth=0)
    ax.set(xlim=(FACTORS[0], FACTORS[-1]), ylim=(0, None))
    ax.set(xlabel="factor on theta (1: the pose as drawn)", ylabel=LENGTH)
    ax.legend()
    return ax


def caption_by_factor(found: Mapping[str, Array]) -> str:
    """The caption of `plot_by_factor`."""
    theta, elements = found["LBS + theta"], found["LBS + rotation elements (SMPL)"]
    exact = found[f"{INTERPOLATION} of examples"]
    return (
        "The second problem of scattered data interpolation: poses far from all examples. Poses "
        f"are multiplied by up to {FACTORS[-1]:g}; the grey range is that of the examples. At the "
        f"end, blend shapes linear in theta are {theta[-1]:.1f} mm long, because they grow along a "
        f"straight line; those linear in rotation elements, which are bounded, {elements[-1]:.1f} "
        f"mm; those of the exact RBF {exact[-1]:.1f} mm, and at most {exact.max():.1f} mm on the "
        "way, because its kernels vanish far from all examples. The normalised kernel repeats its "
        "nearest example."
    )


def plot_by_angle(found: Mapping[str, Array], *, ax: Axes) -> Axes:
    """How long blend shapes are while the neck turns twice around."""
    for i, (name, sizes) in enumerate(found.items()):
        ax.plot(np.degrees(TURNS), sizes, DASHES[i % 4], color=LINES[i], label=plain(name))
    for turn in (360, 720):
        ax.axvline(turn, color=FAINT, linewidth=0.8)
    ax.set_xticks(range(0, 721, 90))
    ax.set(xlim=(0, 720), ylim=(0, 1.3 * max(float(sizes.max()) for sizes in found.values())))
    ax.set(xlabel="turn of the neck about the vertical (degrees)", ylabel=LENGTH)
    ax.legend(loc="upper left")
    return ax


def caption_by_angle(found: Mapping[str, Array]) -> str:
    """The caption of `plot_by_angle`."""
    middle = len(TURNS) // 2
    said = "; ".join(
        f"{name} {sizes[0]:.1f}, {sizes[middle]:.1f} and {sizes[-1]:.1f} mm"
        for name, sizes in found.items()
    )
    return (
        "The neck turns twice around, and its pose is the same after 360 and after 720 degrees. "
        f"The rms length of blend shapes at 0, 360 and 720 degrees: {said}. With a function of "
        "rotations it is the same at all three; with a quaternion, which changes its sign with "
        "every full turn, at 0 and 720 only."
    )


def plot_by_penalty(rows: Sequence[ByPenalty], what: str, *, ax: Axes) -> Axes:
    """Errors against the share that a penalty leaves, whose name is `what`."""
    shares = [100 * row.share for row in rows]
    training, test = [r.training_rms for r in rows], [r.test_mean for r in rows]
    ax.plot(shares, training, "o-", color=BLUE, label="training poses, at rest (rms)")
    ax.plot(shares, test, "s--", color=VERMILLION, label="test poses, posed (mean)")
    ax.set_xscale("log")
    ax.minorticks_off()
    ax.set_xticks(shares, [f"{x:.2g}" for x in shares])
    ax.set(xlabel=plain(what), ylabel="distance (mm)", ylim=(0, None))
    ax.legend()
    return ax


def caption_by_distance_penalty(rows: Sequence[ByPenalty]) -> str:
    """The caption of `plot_by_penalty` for MANO's penalty."""
    first, last = rows[0], rows[-1]
    least = min(rows, key=lambda row: row.test_mean)
    return (
        f"The penalty on distance goes from {first.penalty:g} to {last.penalty:g} per square metre "
        "from right to left. The share of blend shapes far from their joint goes from "
        f"{first.share:.0%} to {last.share:.1%}, and the training error from "
        f"{first.training_rms:.2f} to {last.training_rms:.2f} mm. The least test error is "
        f"{least.test_mean:.2f} mm, at a share of {least.share:.0%}."
    )


def caption_by_group_penalty(rows: Sequence[ByPenalty]) -> str:
    """The caption of `plot_by_penalty` for the group lasso."""
    first, last = rows[0], rows[-1]
    return (
        "Quaternion features with fewer and fewer numbers that are not zero, from "
        f"{first.share:.0%} down to {last.share:.1%}: the training error goes from "
        f"{first.training_rms:.2f} to {last.training_rms:.2f} mm, the test error from "
        f"{first.test_mean:.2f} to {last.test_mean:.2f} mm."
    )
