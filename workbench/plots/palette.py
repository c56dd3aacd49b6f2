"""Colours, dashes and marks of every figure, distinct for colour-blind readers and in grey.

Okabe and Ito, Color Universal Design (2008), without its yellow, which is too pale for lines.
"""

from typing import TypedDict

INK = "#222222"
FAINT = "#8a8f98"  # frames and grids
BLUE = "#0072B2"
VERMILLION = "#D55E00"
GREEN = "#009E73"
PURPLE = "#CC79A7"
ORANGE = "#E69F00"
SKY = "#56B4E9"

LINES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, INK, FAINT)
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "h")
DASHES = ("-", "--", "-.", ":")

SKIN = "#d3dce6"  # a shaded body: pale, so that marks on it stand out
OUTSIDE = "#eceef1"  # beyond the frame of an image
AMOUNT = "cividis"  # the colour map of magnitudes


class Line(TypedDict):
    """The colour and dashes of a line, as `Axes.plot` takes them."""

    color: str
    linestyle: str


def solver_line(k: int) -> Line:
    """The line of the k-th solver of a comparison: 8 colours, then the same ones dashed."""
    return Line(color=LINES[k % len(LINES)], linestyle=DASHES[k // len(LINES) % len(DASHES)])


def solver_mark(k: int) -> str:
    """The mark of the k-th solver's points."""
    return MARKERS[k % len(MARKERS)]
