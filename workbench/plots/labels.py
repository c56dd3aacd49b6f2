"""Labels of figures: users' names in letters that the font has, shortened, and kept apart."""

import math
from collections.abc import Sequence
from functools import cache

from matplotlib import font_manager
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ft2font import FT2Font
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
FEW = 1.5  # decades: below, numbers between the powers of ten are written too


def plain(text: str) -> str:
    """The text with `$` as a plain dollar, and a question mark for every letter the font lacks."""
    known = _letters()
    kept = "".join(c if c == "\n" or ord(c) in known else "?" for c in text)
    return kept.replace("$", r"\$")


def shortened(text: str, most: int) -> str:
    """The text cut to at most `most` letters, the last of which is then an ellipsis."""
    return text if len(text) <= most else text[: most - 1].rstrip() + "…"


def apart(places: Sequence[float], sizes: Sequence[float], gap: float) -> list[int]:
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
    found = font_manager.findfont("DejaVu Sans")
    return frozenset(FT2Font(found).get_charmap())


def power(value: float) -> str:
    """`10⁻⁵`, and `1`, `10`, `0.1`, `200` where that is short."""
    exponent = round(math.log10(value)) if value > 0 else 0
    if -2 <= exponent <= 3 or not math.isclose(value, 10.0**exponent):
        return f"{value:g}"
    return "10" + str(exponent).translate(RAISED)


def decades(axis: Axis, low: float, high: float) -> None:
    """Ticks for a logarithmic axis that shows low to high."""
    wide = math.log10(high / low) if low > 0 else 1.0
    subs = (1.0,) if wide > FEW else (1.0, 2.0, 5.0)
    axis.set_major_locator(LogLocator(subs=subs, numticks=9))
    axis.set_major_formatter(FuncFormatter(lambda value, _: power(value)))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
