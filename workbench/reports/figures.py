"""Figures inside a page."""

from base64 import b64encode
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import ParamSpec

from workbench.diagnostics import Diagnosis
from workbench.plots import Figure, caption_singular_values, sheets, smallest
from workbench.plots.figure import drawn as figure_of

P = ParamSpec("P")


@dataclass(frozen=True)
class Shown:
    """A figure as a page holds it: its bytes as a data address, and what it shows in words."""

    data: str
    caption: str
    width: int  # px on the page at most
    chart: bool = True  # light and dark are exchanged on dark pages, but not in shaded bodies


def shown(figure: Figure, caption: str) -> Shown:
    """SVG or PNG, whichever is smaller."""
    drawn, kind = smallest(figure)
    code = b64encode(drawn).decode("ascii")
    chart = not any(artist.get_rasterized() for artist in figure.findobj())
    width = round(100 * figure.get_figwidth())
    return Shown(f"data:{kind};base64,{code}", caption, width, chart)


def drawn(
    sheet: Callable[P, Figure], caption: Callable[P, str], *results: P.args, **options: P.kwargs
) -> Shown:
    """A figure and its caption, both made from the same results."""
    return shown(sheet(*results, **options), caption(*results, **options))


def of_solvers(figure: Shown) -> Shown:
    """The figure in the colours that solvers have everywhere, also on dark pages."""
    return replace(figure, chart=False)


def plotted(
    width: float,
    height: float,
    plot: Callable[..., object],
    caption: Callable[..., str],
    *results: object,
) -> Shown:
    """What `plot(*results, ax=...)` draws on width x height inches, above `caption(*results)`."""
    return shown(figure_of(partial(plot, *results), width, height), caption(*results))


def spectrum(diagnosis: Diagnosis) -> Shown | None:
    """The singular values of a diagnosis; None where its rank was found without them."""
    if diagnosis.sparse is not None:
        return None
    return drawn(sheets.singular_values_sheet, caption_singular_values, diagnosis)
