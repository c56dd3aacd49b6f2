"""The figure of benchmarks/README.md: the times of the last run."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from benchmarks import fits, floor, ours, page, peers
from benchmarks.table import NAMES
from benchmarks.timing import best
from workbench.plots import style
from workbench.plots.palette import BLUE, FAINT, GREEN, INK, PURPLE, SKY, VERMILLION

SIZE = "6890"
COLOURS = {
    ours.NUMPY: BLUE,
    ours.COMPILED: SKY,
    peers.JAX: VERMILLION,
    peers.TORCH: GREEN,
    peers.DIFFERENCES: PURPLE,
    floor.FLOOR: FAINT,
}
MARKS = {"forward": ("^", ":"), "jacobian": ("o", "-"), "step": ("s", "--")}


def draw(results: Mapping[str, Any], path: Path) -> str:
    """Save the figure and return its caption; all three parts must have been run."""
    found = {name: part["found"] for name, part in results.items()}
    with style.house_style():
        sheet = Figure(figsize=(10.5, 6.4), layout="constrained")
        axes = sheet.subplot_mosaic([[*"aabbcc"], [*"dddeee"]])
        seconds = found["derivatives"][SIZE]["seconds"]
        for letter, kind in zip("abc", NAMES, strict=True):
            _compare(axes[letter], {n: best(t) for n, t in seconds[kind].items()}, letter == "a")
            axes[letter].set_title(
                f"{letter}  {NAMES[kind][0].upper()}{NAMES[kind][1:]}", loc="left"
            )
        _fits(axes["d"], found["fits"][SIZE]["seconds"])
        axes["d"].set_title("d  Whole fit, to 1 µm", loc="left")
        _scaling(axes["e"], found["scaling"]["seconds"])
        axes["e"].set_title("e  Cost per vertex", loc="left")
    path.write_bytes(style.svg(sheet) if path.suffix == ".svg" else style.png(sheet))
    return caption(results)


def caption(results: Mapping[str, Any]) -> str:
    """What is seen, and on what machine."""
    body = results["derivatives"]["found"][SIZE]
    where, of_fits = (page.machine(results[part]["machine"]) for part in ("derivatives", "fits"))
    other = "" if of_fits == where else f" d: {of_fits}."
    return (
        f"Least times on one thread in double precision; a to d: {body['vertices']:,} vertices, "
        f"{body['unknowns']} unknowns, dense pose directions, random numbers in SMPL's shape. "
        "Numbers beside the marks are times over the first one's. The floor reads the pose "
        "directions (a), writes J as well (b), and forms J'J too (c). "
        f"{where}.{other}"
    )


def _compare(ax: Axes, seconds: Mapping[str, float], named: bool) -> None:
    """One dot per candidate on a logarithmic axis, with its ratio to the workbench."""
    for row, (name, t) in enumerate(seconds.items()):
        ax.plot(1e3 * t, row, "o", markersize=8, color=COLOURS[name])
        note = "" if name == ours.NUMPY else f"  × {t / seconds[ours.NUMPY]:.2g}"
        ax.annotate(note, (1e3 * t, row), (5, 0), textcoords="offset points", va="center")
    ax.set_yticks(range(len(seconds)), list(seconds) if named else [""] * len(seconds))
    _finish(ax, seconds.values())


def _fits(ax: Axes, timings: Mapping[str, list[float]]) -> None:
    seconds = {label: best(t) for label, t in timings.items()}
    first = seconds[f"{ours.NUMPY}: {fits.LM}"]
    rows: list[str] = list(dict.fromkeys(label.partition(": ")[2] for label in seconds))
    for label, t in seconds.items():
        way, _, method = label.partition(": ")
        row = rows.index(method) + (-0.2 if way == ours.NUMPY else 0.2)
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
            each = [1e6 * best(t) / n for n, t in zip(N, by_size.values(), strict=True)]
            label = NAMES[kind] + ("" if name == ours.NUMPY else f", {name.split(', ')[-1]}")
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
