"""Colours, dashes and marks of every figure, distinct for colour-blind readers and in grey.

Okabe and Ito, Color Universal Design (2008), without its yellow, which is too pale for lines.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import cycle
from typing import TypedDict

from workbench.fitting.setup import MANY
from workbench.solvers import SOLVERS

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


@dataclass(frozen=True)
class SolverStyle:
    """How a solver is drawn in every figure and on every page."""

    color: str
    linestyle: str
    marker: str

    @property
    def line(self) -> Line:
        """Colour and dashes, as `Axes.plot` takes them."""
        return Line(color=self.color, linestyle=self.linestyle)


# visible on white and on black, in the order in which solvers get them: first those that
# experiments compare, which have a colour each, then the others, whose lines are dashed
OF_SOLVERS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, "#8c6bb1", "#6b7280")
PLACES = {name: k for k, name in enumerate(dict.fromkeys((*MANY, *SOLVERS)))}


def solver_styles(names: Iterable[str]) -> dict[str, SolverStyle]:
    """The style of each solver: always the same for one of `SOLVERS`.

    One in stages or from several starts, `staged ipopt`, has that of the solver at the end of its
    name, unless this is there too. Others, such as a user's own, get places that are free, in
    colours that are not taken where there are any.
    """
    names = tuple(names)
    own = {name: PLACES[name] for name in names if name in PLACES}
    for name in names:
        last = PLACES.get(name.split(" ")[-1])
        if name not in own and last is not None and last not in own.values():
            own[name] = last
    taken, n = {k % len(OF_SOLVERS) for k in own.values()}, len(OF_SOLVERS)
    free = cycle(sorted({*range(n * len(DASHES))} - {*own.values()}, key=lambda k: k % n in taken))
    return {name: _style(own[name] if name in own else next(free)) for name in names}


def _style(k: int) -> SolverStyle:
    n = len(OF_SOLVERS)
    return SolverStyle(OF_SOLVERS[k % n], DASHES[k // n % len(DASHES)], MARKERS[k % len(MARKERS)])
