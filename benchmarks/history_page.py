"""The page HISTORY.md and its figure: promised ratios through time."""

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.history import WORSE, Course
from benchmarks.keeping import write_between
from workbench.plots import style
from workbench.plots.palette import DASHES, FAINT, LINES, MARKERS

PAGE, FIGURE = "HISTORY.md", "history.svg"
BEGIN, END = "<!-- from here on written by `python -m benchmarks` -->", "<!-- up to here -->"
COLUMNS = 2  # of panels


def write(out: Path, found: Sequence[Course]) -> None:
    """Draw the figure, and write the page between its marks if it is there."""
    if by_part(found):
        (out / "results" / FIGURE).write_bytes(style.svg(figure(found)))
    if (out / PAGE).exists():
        write_between(out / PAGE, BEGIN, END, text(found))


def text(found: Sequence[Course]) -> str:
    """What is slower than before, and every ratio that was measured more than once."""
    slower = [one for one in found if one.slower]
    again = [one for one in found if len(one.measured) > 1]
    lines = ["", told(found), ""]
    if slower:
        lines += [*(f"- {_change(one)}" for one in slower), ""]
    if again:
        lines += [
            f"![Promised ratios as a share of their limits, through time](results/{FIGURE})",
            "",
            caption(found),
            "",
        ]
    lines += [
        "| ratio of times | target | measured, oldest first | newest / median before | |",
        "| --- | --: | --- | --: | --- |",
        *map(_row, again),
        "",
    ]
    once = len(found) - len(again)
    lines += [
        f"Measured once on the processor of their last measurement: {once} more ratios, which "
        "have no past yet; the README of this folder has them.",
        "",
    ]
    return "\n".join(lines)


def told(found: Sequence[Course]) -> str:
    """One sentence: how many ratios have become slower."""
    again = [one for one in found if len(one.measured) > 1]
    slower = sum(one.slower for one in found)
    return (
        f"Of {len(again)} ratios that were measured more than once on one processor, {slower} "
        f"{'is' if slower == 1 else 'are'} now slower by more than "
        f"{100 * (WORSE - 1):.0f} % than the median of those before."
    )


def _change(one: Course) -> str:
    *_, before, newest = one.measured
    return (
        f"**{one.name}**: {newest.target.measured:.2f} on {newest.date[:10]}, "
        f"{before.target.measured:.2f} on {before.date[:10]}"
    )


def _row(one: Course) -> str:
    target = one.measured[-1].target
    limit = f"at {'most' if target.at_most else 'least'} {target.limit:g}"
    past = ", ".join(f"{each.target.measured:.2f} ({each.date[5:10]})" for each in one.measured)
    return (
        f"| {one.name} | {limit} | {past} | {one.change:.2f} "
        f"| {'**slower**' if one.slower else ''} |"
    )


def by_part(found: Sequence[Course]) -> dict[str, list[Course]]:
    """The ratios that were measured more than once, by part."""
    parts: dict[str, list[Course]] = {}
    for one in found:
        if len(one.measured) > 1:
            parts.setdefault(one.measured[-1].part, []).append(one)
    return parts


def figure(found: Sequence[Course]) -> Figure:
    """A panel for each part: each ratio's share of its limit, by day."""
    parts = by_part(found)
    rows = -(-len(parts) // COLUMNS)
    with style.house_style():
        sheet = Figure(figsize=(11, 4.4 * rows), layout="constrained")
        every = sheet.subplots(rows, COLUMNS, squeeze=False).ravel()
        for ax, (part, some) in zip(every, parts.items(), strict=False):
            _panel(ax, part, some)
        for ax in every[len(parts) :]:
            ax.set_axis_off()
    return sheet


def caption(found: Sequence[Course]) -> str:
    """What is seen."""
    where = sorted({one.measured[-1].processor for one in found if len(one.measured) > 1})
    return (
        "Each line is a promised ratio as a share of its limit, so that a line that rises is "
        "something that became slower, and one above 1 is a promise that is missed "
        f"({', '.join(where)})."
    )


def _panel(ax: Axes, part: str, some: Sequence[Course]) -> None:
    days = sorted({each.date for one in some for each in one.measured})
    for k, one in enumerate(some):
        ax.plot(
            [days.index(each.date) for each in one.measured],
            [each.used for each in one.measured],
            color=LINES[k % len(LINES)],
            linestyle=DASHES[k // len(LINES) % len(DASHES)],
            marker=MARKERS[k % len(MARKERS)],
            markersize=4,
            label=one.name,
        )
    ax.axhline(1, color=FAINT, linewidth=1)
    ax.set(title=part, ylabel="ratio / its limit", xlabel="measurements, oldest first")
    ax.set_xticks(range(len(days)), [datetime.fromisoformat(one).strftime("%d %b") for one in days])
    ax.set_ylim(bottom=0)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), fontsize=7.5)
