"""Predictors of blend shapes: what they leave, what they cost, and where they stop being right."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from workbench.plots.lettering import plain
from workbench.plots.palette import BLUE, DASHES, FAINT, INK, LINES, MARKERS, VERMILLION
from workbench.training.blend_shapes.contest import LINEAR, Result
from workbench.training.blend_shapes.studies import FACTORS, TURNS, OfPrice, OfSize

Array = NDArray[np.float64]
ROUND = [d * 10.0**e for e in range(-2, 3) for d in (1, 2, 5)]  # ticks, mm or ms


def plot_predictors(results: Sequence[Result], *, ax: Axes) -> Axes:
    """Mean distances as bars, the largest as dots, best at the top, on a logarithmic scale."""
    rows = np.arange(len(results))[::-1]
    colours = [VERMILLION if r.name == LINEAR else BLUE for r in results]
    ax.barh(rows, [r.mean for r in results], color=colours, height=0.65)
    ax.plot([r.largest for r in results], rows, "o", color=INK, markersize=4)
    for row, result in zip(rows, results, strict=True):
        ax.annotate(f"{result.mean:.2f}", (result.mean, row), xytext=(4, 0), va="center",
                    textcoords="offset points", fontsize=8.5)  # fmt: skip
    ax.set_xscale("log")
    ax.set_yticks(rows, [plain(r.name) for r in results])
    ax.set_xlabel("distance to the teacher's vertices (mm): mean (bar), largest (dot)")
    ax.grid(axis="x", color=FAINT, alpha=0.3, linewidth=0.6)
    return ax


def caption_predictors(results: Sequence[Result], test: str, n_test: int) -> str:
    """What `plot_predictors` shows."""
    best, linear = results[0], next(r for r in results if r.name == LINEAR)
    text = (
        f"Posed distance on {n_test} {test.split(':')[0]}, logarithmic. Linear blending alone "
        f"(red) leaves {linear.mean:.2f} mm on average; {best.name} is the best with "
        f"{best.mean:.2f} mm."
    )
    boneless = [r.mean for r in results if r.name.endswith("no bones")]
    if boneless:
        text += (
            f" Functions of theta that know no bones leave {min(boneless):.1f} mm at the least and "
            f"{max(boneless):.1f} mm at the most."
        )
    return text


def plot_by_size(rows: Sequence[OfSize], *, ax: Axes) -> Axes:
    """Error and time of interpolation against the number of examples."""
    n = [row.n for row in rows]
    for kind, colour, marker in (("gaussians", BLUE, "o"), ("shares", VERMILLION, "s")):
        name = {"gaussians": "exact RBF", "shares": "normalised kernel"}[kind]
        ax.plot(n, [getattr(r, kind) for r in rows], color=colour, marker=marker,
                label=f"{name}: mean distance (mm)")  # fmt: skip
        ax.plot(n, [getattr(r, f"{kind}_ms") for r in rows], color=colour, marker=marker,
                linestyle="--", alpha=0.7, label=f"{name}: time for one pose (ms)")  # fmt: skip
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xticks(n, [str(x) for x in n])
    low, high = ax.get_ylim()
    shown = [y for y in ROUND if low <= y <= high]
    ax.set_yticks(shown, [f"{y:g}" for y in shown])
    ax.minorticks_off()
    ax.set_xlabel("examples kept")
    ax.set_ylabel("mm, or ms")
    ax.legend()
    return ax


def caption_by_size(rows: Sequence[OfSize]) -> str:
    """What `plot_by_size` shows."""
    few, many = rows[0], rows[-1]
    return (
        f"Scattered data, the first problem: accuracy is bought with examples, and each of them "
        f"is stored and asked at every pose. From {few.n} to {many.n} examples the exact RBF goes "
        f"from {few.gaussians:.2f} to {many.gaussians:.2f} mm and from {few.gaussians_ms:.2g} to "
        f"{many.gaussians_ms:.2g} ms a pose; the normalised kernel from {few.shares:.2f} to "
        f"{many.shares:.2f} mm."
    )


def plot_by_reach(found: Mapping[str, Array], *, ax: Axes) -> Axes:
    """How large blend shapes become when poses are exaggerated."""
    for i, (name, sizes) in enumerate(found.items()):
        ax.plot(FACTORS, sizes, color=LINES[i], linestyle=DASHES[i % 4], label=plain(name))
    ax.axvspan(0, 1, color=FAINT, alpha=0.15, linewidth=0)
    ax.set_xlabel("factor on theta (1: a pose as drawn)")
    ax.set_ylabel("rms length of the blend shapes (mm)")
    ax.set_xlim(FACTORS[0], FACTORS[-1])
    ax.set_ylim(bottom=0)
    ax.legend()
    return ax


def caption_by_reach(found: Mapping[str, Array]) -> str:
    """What `plot_by_reach` shows."""
    theta, elements = found["LBS + theta"], found["LBS + rotation elements (SMPL)"]
    exact = found["LBS + exact RBF of examples"]
    return (
        f"Scattered data, the second problem: beyond the examples. Poses are multiplied by up to "
        f"{FACTORS[-1]:g}; grey is where there were examples. At the end shapes linear in theta "
        f"are {theta[-1]:.1f} mm long, as a straight line has it; those of rotation elements, "
        f"which are bounded, {elements[-1]:.1f} mm; those of the exact RBF {exact[-1]:.1f} mm, at "
        f"most {exact.max():.1f} mm on the way: its kernels vanish far from all examples. The "
        "normalised kernel repeats its nearest example."
    )


def plot_by_turn(found: Mapping[str, Array], *, ax: Axes) -> Axes:
    """The lecture's neck: blend shapes while it turns twice round."""
    for i, (name, sizes) in enumerate(found.items()):
        ax.plot(np.degrees(TURNS), sizes, color=LINES[i], linestyle=DASHES[i % 4],
                label=plain(name))  # fmt: skip
    for turn in (360, 720):
        ax.axvline(turn, color=FAINT, linewidth=0.8)
    ax.set_xticks(range(0, 721, 90))
    ax.set_xlim(0, 720)
    ax.set_ylim(0, 1.3 * max(float(sizes.max()) for sizes in found.values()))
    ax.set_xlabel("turn of the neck about the vertical (degrees)")
    ax.set_ylabel("rms length of the blend shapes (mm)")
    ax.legend(loc="upper left")
    return ax


def caption_by_turn(found: Mapping[str, Array]) -> str:
    """What `plot_by_turn` shows."""
    middle = len(TURNS) // 2
    said = "; ".join(
        f"{name} {sizes[0]:.1f}, {sizes[middle]:.1f} and {sizes[-1]:.1f} mm"
        for name, sizes in found.items()
    )
    return (
        "The neck turns twice round, and is where it was after 360 and after 720 degrees. Blend "
        f"shapes at 0, 360 and 720 degrees: {said}. A function of rotations has the same length "
        "at all three, a quaternion, which changes its sign with every turn, at 0 and 720."
    )


def plot_by_price(rows: Sequence[OfPrice], what: str, *, ax: Axes) -> Axes:
    """Error against what a price has left: `what` is a share."""
    left = [100 * row.left for row in rows]
    ax.plot(left, [r.lesson for r in rows], color=BLUE, marker=MARKERS[0],
            label="in the lesson, at rest (rms)")  # fmt: skip
    ax.plot(left, [r.test for r in rows], color=VERMILLION, marker=MARKERS[1], linestyle="--",
            label="in the test, posed (mean)")  # fmt: skip
    ax.set_xscale("log")
    ax.minorticks_off()
    ax.set_xticks(left, [f"{x:.2g}" for x in left])
    ax.set_xlabel(plain(what))
    ax.set_ylabel("distance (mm)")
    ax.set_ylim(bottom=0)
    ax.legend()
    return ax


def caption_by_distance(rows: Sequence[OfPrice]) -> str:
    """What `plot_by_price` shows of MANO's price."""
    first, last = rows[0], rows[-1]
    least = min(rows, key=lambda row: row.test)
    return (
        f"The price on distance from {first.price:g} to {last.price:g} per square metre, right to "
        f"left: the share of blend shapes far from their joint goes from {first.left:.0%} to "
        f"{last.left:.1%} and the error in the lesson from {first.lesson:.2f} to "
        f"{last.lesson:.2f} mm. In unseen poses the least error is "
        f"{least.test:.2f} mm, at a share of {least.left:.0%}."
    )


def caption_by_sparsity(rows: Sequence[OfPrice]) -> str:
    """What `plot_by_price` shows of the group lasso."""
    first, last = rows[0], rows[-1]
    return (
        f"Quaternion features with fewer and fewer numbers that are not zero, {first.left:.0%} "
        f"down to {last.left:.1%}: in the lesson the error goes from {first.lesson:.2f} to "
        f"{last.lesson:.2f} mm, in unseen poses from {first.test:.2f} to {last.test:.2f} mm."
    )
