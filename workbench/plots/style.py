"""The house style, sheets and bytes of figures, and labels that matplotlib does not interpret."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from io import BytesIO

from cycler import cycler
from matplotlib import font_manager, style
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ft2font import FT2Font
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from workbench.plots.palette import FAINT, INK, LINES

DPI = 150  # of PNG, and of what is rasterized inside an SVG
STYLE = {
    "font.family": "DejaVu Sans",  # matplotlib brings it along
    "font.size": 10.0,
    "axes.titlesize": 11.0,
    "axes.labelsize": 10.0,
    "xtick.labelsize": 9.0,
    "ytick.labelsize": 9.0,
    "legend.fontsize": 9.0,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.axisbelow": True,
    "axes.prop_cycle": cycler(color=LINES),
    "svg.hashsalt": "workbench",  # the same figure is the same bytes
}


@contextmanager
def house_style() -> Iterator[None]:
    """Matplotlib's defaults with the changes of STYLE, until the context ends."""
    with style.context(["default", STYLE]):
        yield


def sheet(width: float, height: float, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """A figure of that many inches (100 px each on a page), and its axes side by side."""
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots(1, columns, squeeze=False)
    return figure, list(axes[0])


def figure_of(plot: Callable[..., object], width: float, height: float) -> Figure:
    """A figure of that many inches in the house style; `plot(ax=...)` draws on its axes."""
    with house_style():
        figure, (ax,) = sheet(width, height)
        plot(ax=ax)
    return figure


def side_by_side(
    plots: Sequence[Callable[..., object]], width: float, height: float, *, columns: int
) -> Figure:
    """Plots side by side, with one label of the y-axis and below them one legend in `columns`."""
    with house_style():
        figure, axes = sheet(width, height, len(plots))
        for ax, plot in zip(axes, plots, strict=True):
            plot(ax=ax)
            if legend := ax.get_legend():
                legend.remove()
        for ax in axes[1:]:
            ax.set_ylabel("")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=columns)
    return figure


def svg(figure: Figure) -> bytes:
    """The figure as SVG, its letters as outlines, so that it looks the same everywhere."""
    return _saved(figure, "svg", {"Date": None})


def png(figure: Figure) -> bytes:
    """The figure as PNG with 150 pixels to the inch."""
    return _saved(figure, "png", {})


def smallest(figure: Figure) -> tuple[bytes, str]:
    """The figure as SVG, or as PNG where it is painted, and its media type."""
    if any(artist.get_rasterized() for artist in figure.findobj()):
        return png(figure), "image/png"
    return svg(figure), "image/svg+xml"


def _saved(figure: Figure, format: str, metadata: dict[str, None]) -> bytes:
    buffer = BytesIO()
    with house_style():
        figure.savefig(buffer, format=format, dpi=DPI, metadata=metadata or None)
    return buffer.getvalue()


def to_scale(plot: Callable[..., object], height: float, width: float = 7.2) -> Figure:
    """A figure as high as axes of equal aspect need that have `width` inches across."""
    figure = figure_of(plot, 8.0, height)
    with house_style():
        figure.set_figheight(height_to_scale(figure.axes[0], width))
    return figure


def height_to_scale(ax: Axes, width: float) -> float:
    """The height in inches of axes of equal aspect, labels included, `width` inches across."""
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    lines = max((label.get_text().count("\n") for label in ax.get_xticklabels()), default=0)
    return min(7.0, width * (top - bottom) / (right - left) + 0.7 + 0.15 * lines)


SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
FEW_DECADES = 1.5  # decades: below, numbers between the powers of ten are written too


def plain(text: str) -> str:
    """The text with `$` as a plain dollar, and a question mark for every letter the font lacks."""
    known = _letters()
    kept = "".join(c if c == "\n" or ord(c) in known else "?" for c in text)
    return kept.replace("$", r"\$")


def shortened(text: str, most: int) -> str:
    """The text cut to at most `most` letters, the last of which is then an ellipsis."""
    return text if len(text) <= most else text[: most - 1].rstrip() + "…"


def labels_apart(places: Sequence[float], sizes: Sequence[float], gap: float) -> list[int]:
    """Which labels to keep so that no two stand closer than `gap`, larger ones first."""
    kept: list[int] = []
    for i in sorted(range(len(places)), key=lambda i: -sizes[i]):
        if all(abs(places[i] - places[j]) >= gap for j in kept):
            kept.append(i)
    return sorted(kept)


def note_at(
    ax: Axes, text: str, across: float, y: float, colour: str, *, above: float = 4.0
) -> None:
    """A short text beside a horizontal line at y, at a share of the width of the axes.

    It stands `above` points over the line, or below it if that is negative, and ends at its place
    if that is in the right half.
    """
    right = across > 0.5
    ax.annotate(
        text,
        (across, y),
        xycoords=("axes fraction", "data"),
        xytext=(0, above),
        textcoords="offset points",
        color=colour,
        fontsize=9,
        ha="right" if right else "left",
        va="bottom" if above > 0 else "top",
    )


@cache
def _letters() -> frozenset[int]:
    path = font_manager.findfont("DejaVu Sans")
    return frozenset(FT2Font(path).get_charmap())


def power(value: float) -> str:
    """`10⁻⁵`, and `1`, `10`, `0.1`, `200` where that is short."""
    exponent = round(math.log10(value)) if value > 0 else 0
    if -2 <= exponent <= 3 or not math.isclose(value, 10.0**exponent):
        return f"{value:g}"
    return "10" + str(exponent).translate(SUPERSCRIPTS)


def decades(axis: Axis, low: float, high: float) -> None:
    """Ticks for a logarithmic axis that shows low to high."""
    wide = math.log10(high / low) if low > 0 else 1.0
    subs = (1.0,) if wide > FEW_DECADES else (1.0, 2.0, 5.0)
    axis.set_major_locator(LogLocator(subs=subs, numticks=9))
    axis.set_major_formatter(FuncFormatter(lambda value, _: power(value)))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
