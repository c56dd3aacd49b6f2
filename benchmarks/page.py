"""What was promised and what came out, and the figure of README.md."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from benchmarks import performance as fast
from benchmarks import performance_large as large
from benchmarks.candidates import COMPILED, DIFFERENCES, FLOOR, JAX, NUMPY, TORCH
from benchmarks.measuring import Timing, ratio, table
from workbench.plots import style
from workbench.plots.palette import BLUE, FAINT, GREEN, INK, PURPLE, SKY, VERMILLION

SIZE, LARGE = "6890", "100000"


@dataclass(frozen=True)
class Target:
    """A ratio of two times of one run, and its limit."""

    name: str
    measured: float
    limit: float
    at_most: bool = True  # else at least

    @property
    def holds(self) -> bool:
        """Whether the promise was kept."""
        within = self.measured <= self.limit
        return within if self.at_most else self.measured >= self.limit


def targets(found: Mapping[str, Any]) -> list[Target]:
    """Those that can be judged from the parts that were measured."""
    return [
        target for part, judge in JUDGES.items() if part in found for target in judge(found[part])
    ]


def table_of_targets(found: Mapping[str, Any]) -> str:
    """Target, measurement, and whether it holds."""
    rows = (
        (
            one.name,
            f"{'at most' if one.at_most else 'at least'} {one.limit:g}",
            f"{one.measured:.2f}",
            "holds" if one.holds else "**missed**",
        )
        for one in targets(found)
    )
    return table(("ratio of times", "target", "measured", ""), rows)


def _of_derivatives(found: Mapping[str, Any]) -> Iterator[Target]:
    seconds = found.get(SIZE, {}).get("seconds", {})
    if JAX in seconds.get("forward", {}):
        limits = {NUMPY: (1.5, 5, 5), COMPILED: (1.2, 15, 9)}
        for way, (forward, jacobian, step) in limits.items():
            if way not in seconds["forward"]:
                continue
            yield Target(f"{way}: forward / JAX", ratio(seconds["forward"], way, JAX), forward)
            faster = ratio(seconds["jacobian"], JAX, way)
            yield Target(f"{way}: JAX / Jacobian", faster, jacobian, False)
            if way == NUMPY and TORCH in seconds["jacobian"]:
                faster = ratio(seconds["jacobian"], TORCH, way)
                yield Target(f"{way}: torch / Jacobian", faster, 12, False)
            faster = ratio(seconds["step"], JAX, way)
            yield Target(f"{way}: JAX / Gauss-Newton step", faster, step, False)
    if fast.HANDS in found and "full" in found:
        for way, one in found[fast.HANDS]["seconds"]["jacobian"].items():
            if way in (NUMPY, COMPILED):
                plain = found["full"]["seconds"]["jacobian"][way]
                times = one["least"] / plain["least"]
                yield Target(f"{way}: Jacobian, 52 joints / 24", times, 2.2)


def _of_fits(found: Mapping[str, Any]) -> Iterator[Target]:
    one = found.get(SIZE, {})
    for way, limit in ((NUMPY, 1.5), (COMPILED, 1.1)):
        took = {
            label.partition(": ")[2]: seconds
            for label, seconds in one.get("seconds", {}).items()
            if label.startswith(f"{way}:")
        }
        if not took:
            continue
        yield Target(f"{way}: LM / its own parts", ratio(took, fast.LM, fast.ALONE), limit)
        if way == COMPILED:
            most = max(n["jacobian"] for n in one["evaluations"][f"{way}: {fast.LM}"])
            yield Target(f"{way}: linearizations of LM", float(most), 4)
        for scipy in (fast.SCIPY_LM, fast.SCIPY_TRF):
            yield Target(f"{way}: {scipy} / LM", ratio(took, scipy, fast.LM), 4, False)
        yield Target(f"{way}: IPOPT / LM", ratio(took, fast.IPOPT, fast.LM), 3)


def _of_scaling(found: Mapping[str, Any]) -> Iterator[Target]:
    for way, limits in {NUMPY: (2, 2, 1.5), COMPILED: (2, 2.6, 1.5)}.items():
        for kind, limit in zip(fast.KINDS, limits, strict=True):
            by_size = found["seconds"].get(kind, {}).get(way, {})
            if SIZE in by_size and LARGE in by_size:
                times = ratio(by_size, LARGE, SIZE) * int(SIZE) / int(LARGE)
                name = f"{way}: {kind} per vertex, {int(LARGE):,} / {int(SIZE):,}"
                yield Target(name, times, limit)


def _of_lbfgs(found: Mapping[str, Any]) -> Iterator[Target]:
    for label in found["seconds"]:
        if (way := label.removesuffix(large.BY_HAND)) != label:
            yield Target(f"{way}: L-BFGS / by hand", ratio(found["seconds"], way, label), 1.1)


def _of_videos(found: Mapping[str, Any]) -> Iterator[Target]:
    for name, one in found["seen"].items():
        label = f"{name}: LM iteration of {one['frames']} frames / these linearized one by one"
        yield Target(label, ratio(one["seconds"], large.ITERATION, large.APART), 1.2)
    each = {int(n): one[large.ITERATION]["least"] / int(n) for n, one in found["frames"].items()}
    if len(each) > 1:
        few, many = min(each), max(each)
        label = f"LM iteration per frame, {many:,} frames / {few:,}"
        yield Target(label, each[many] / each[few], 1.2)


def _of_closest(found: Mapping[str, Any]) -> Iterator[Target]:
    for kind, named in large.PLACES.items():
        seconds = found["seconds"].get(kind, {})
        if COMPILED not in seconds:
            continue
        if large.IGL in seconds:
            times = ratio(seconds, COMPILED, large.IGL)
            yield Target(f"closest places, {named}: compiled / libigl", times, 0.7)
        times = ratio(seconds, NUMPY, COMPILED)
        yield Target(f"closest places, {named}: NumPy / compiled", times, 30)


JUDGES: Mapping[str, Callable[[Mapping[str, Any]], Iterator[Target]]] = {
    "derivatives": _of_derivatives,
    "fits": _of_fits,
    "scaling": _of_scaling,
    "lbfgs": _of_lbfgs,
    "videos": _of_videos,
    "closest": _of_closest,
}
COLOURS = {
    NUMPY: BLUE,
    COMPILED: SKY,
    JAX: VERMILLION,
    TORCH: GREEN,
    DIFFERENCES: PURPLE,
    FLOOR: FAINT,
}
MARKS = {"forward": ("^", ":"), "jacobian": ("o", "-"), "step": ("s", "--")}


def draw(found: Mapping[str, Any], path: Path) -> None:
    """Save the figure as SVG, if derivatives, fits and scaling were measured at its size."""
    if any(SIZE not in found.get(part, {}) for part in ("derivatives", "fits")):
        return
    with style.house_style(), rc_context({"svg.fonttype": "none"}):  # a third of the size
        sheet = Figure(figsize=(10.5, 6.4), layout="constrained")
        axes = sheet.subplot_mosaic([[*"aabbcc"], [*"dddeee"]])
        seconds = found["derivatives"][SIZE]["seconds"]
        for letter, (kind, name) in zip("abc", fast.KINDS.items(), strict=True):
            _compare(axes[letter], seconds[kind], letter == "a")
            axes[letter].set_title(f"{letter}  {name[0].upper()}{name[1:]}", loc="left")
        _fits(axes["d"], found["fits"][SIZE]["seconds"])
        axes["d"].set_title("d  Whole fit, to 1 µm", loc="left")
        if "scaling" in found:
            _scaling(axes["e"], found["scaling"]["seconds"])
        axes["e"].set_title("e  Cost per vertex", loc="left")
        sheet.savefig(path, metadata={"Date": None})


def _compare(ax: Axes, timings: Mapping[str, Timing], named: bool) -> None:
    """One dot per candidate on a logarithmic axis, with its ratio to the workbench."""
    seconds = {name: one["least"] for name, one in timings.items()}
    for row, (name, t) in enumerate(seconds.items()):
        ax.plot(1e3 * t, row, "o", markersize=8, color=COLOURS[name])
        note = "" if name == NUMPY else f"  × {t / seconds[NUMPY]:.2g}"
        ax.annotate(note, (1e3 * t, row), (5, 0), textcoords="offset points", va="center")
    ax.set_yticks(range(len(seconds)), list(seconds) if named else [""] * len(seconds))
    _finish(ax, seconds.values())


def _fits(ax: Axes, timings: Mapping[str, Timing]) -> None:
    seconds = {label: one["least"] for label, one in timings.items()}
    first = seconds[f"{NUMPY}: {fast.LM}"]
    rows: list[str] = list(dict.fromkeys(label.partition(": ")[2] for label in seconds))
    for label, t in seconds.items():
        way, _, method = label.partition(": ")
        row = rows.index(method) + (-0.2 if way == NUMPY else 0.2)
        ax.plot(1e3 * t, row, "o", markersize=8, color=COLOURS[way])
        note = "" if t == first else f"  × {t / first:.2g}"
        ax.annotate(
            note, (1e3 * t, row), (5, 0), textcoords="offset points", va="center", fontsize=7.5
        )
    ax.set_yticks(range(len(rows)), rows)
    _finish(ax, seconds.values())


def _scaling(ax: Axes, seconds: Mapping[str, Any]) -> None:
    for kind, by_candidate in seconds.items():
        marker, dash = MARKS[kind]
        for name, by_size in by_candidate.items():
            N = [int(size) for size in by_size]
            each = [1e6 * t["least"] / n for n, t in zip(N, by_size.values(), strict=True)]
            label = fast.KINDS[kind] + ("" if name == NUMPY else f", {name.split(', ')[-1]}")
            ax.plot(N, each, dash, marker=marker, markersize=5, color=COLOURS[name], label=label)
    ax.set(xscale="log", yscale="log", xlabel="vertices", ylabel="time per vertex (µs)")
    ax.grid(color=FAINT, alpha=0.3)
    ax.legend(
        ncols=len(next(iter(seconds.values()))),
        fontsize=6.0,
        loc="lower left",
        columnspacing=0.8,
        handlelength=2.0,
    )
    low, high = ax.get_ylim()
    ax.set_ylim(low / 12, high)
    _plain(ax.xaxis)
    _plain(ax.yaxis)


def _plain(axis: Axis) -> None:
    """Ticks as numbers are written, not as powers."""
    axis.set_major_formatter(FuncFormatter(lambda number, _: f"{number:,g}"))
    axis.set_minor_formatter(NullFormatter())


def _finish(ax: Axes, seconds: Any) -> None:
    ax.invert_yaxis()
    ax.set(xscale="log", xlabel="time (ms)")
    wide = max(seconds) > 20 * min(seconds)
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0)))
    _plain(ax.xaxis)
    low, high = 1e3 * min(seconds), 1e3 * max(seconds)
    ax.set_xlim(low / 1.6, high * (high / low) ** 0.35 * 1.3)
    ax.grid(axis="x", color=FAINT, alpha=0.3)
    ax.tick_params(axis="y", length=0, labelcolor=INK)
