"""How each of many solvers is drawn: colour, dashes and marker, the same in every figure."""

from typing import TypedDict

from workbench.plots.palette import DASHES, LINES, MARKERS


class Line(TypedDict):
    """What `Axes.plot` takes."""

    color: str
    linestyle: str


def line(k: int) -> Line:
    """Of the k-th solver: 8 colours, and then the same ones dashed."""
    return Line(color=LINES[k % len(LINES)], linestyle=DASHES[k // len(LINES) % len(DASHES)])


def marker(k: int) -> str:
    """Of the k-th solver."""
    return MARKERS[k % len(MARKERS)]
