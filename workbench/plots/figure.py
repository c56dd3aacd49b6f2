"""Figures without a screen, in the house style, and their bytes as SVG or PNG."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO

from cycler import cycler
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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


def drawn(plot: Callable[..., object], width: float, height: float) -> Figure:
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
    """The figure as SVG or PNG, whichever is shorter, and its media type."""
    pixels = png(figure), "image/png"
    if any(artist.get_rasterized() for artist in figure.findobj()):
        return pixels  # paint inside an SVG is a PNG in itself
    lines = svg(figure), "image/svg+xml"
    return lines if len(lines[0]) < len(pixels[0]) else pixels


def _saved(figure: Figure, format: str, metadata: dict[str, None]) -> bytes:
    buffer = BytesIO()
    with house_style():
        figure.savefig(buffer, format=format, dpi=DPI, metadata=metadata or None)
    return buffer.getvalue()
