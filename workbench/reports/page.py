"""Pages from templates: tables, figures with captions, and what a page lists."""

import csv
import io
import json
import math
import platform
from base64 import b64encode
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from workbench.diagnostics import Diagnosis
from workbench.diagnostics.data import plain
from workbench.diagnostics.words import table as lines_of
from workbench.environment import DISTRIBUTION, version_of
from workbench.errors import BadFile
from workbench.plots import (
    Figure,
    caption_singular_values,
    caption_sparsity,
    plot_singular_values,
    plot_sparsity,
    smallest,
)
from workbench.plots.palette import solver_styles
from workbench.plots.style import figure_of
from workbench.reading.facts import json_in
from workbench.solvers import SOLVERS

PACKAGES = (DISTRIBUTION, "casadi", "numpy", "scipy", "nlopt", "emcee", "trimesh", "matplotlib")


def page(template: str, **content: Any) -> str:
    """Fill one of `templates/`; every text is escaped.

    They also get `versions`, and `solver_colours`, that of each solver in the figures.

    Templates may include the scripts of `workbench/reports/replay/scripts`.
    """
    return _templates().get_template(template).render(versions=versions(), **content)


@cache
def _templates() -> Environment:
    environment = Environment(
        loader=ChoiceLoader(
            [
                PackageLoader("workbench.reports", "templates"),
                PackageLoader("workbench.reports.replay", "scripts"),
            ]
        ),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    colours = {name: style.color for name, style in solver_styles(SOLVERS).items()}
    environment.globals["solver_colours"] = colours  # which macros see as well
    return environment


def versions() -> dict[str, str | None]:
    """Of Python and of what computes; None for what is not installed."""
    return {"python": platform.python_version()} | {name: version_of(name) for name in PACKAGES}


def as_json(summary: Mapping[str, Any]) -> str:
    """JSON as every reader takes it: arrays as lists, null where a number is not finite."""
    return json.dumps(plain(summary), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


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
    return plotted(8.0, 4.2, plot_singular_values, caption_singular_values, diagnosis)


def sparsity_figure(diagnosis: Diagnosis) -> Shown:
    """The sparsity pattern of the Jacobian of a diagnosis."""
    return plotted(8.0, 5.4, plot_sparsity, caption_sparsity, diagnosis)


@dataclass(frozen=True)
class Entry:
    """What is kept of a file in the table over all."""

    name: str  # the name of its job
    facts: dict[str, Any]  # the numbers of its page, and the key of everything that they depend on


def kept_entry(name: str, key: str, path: Path, arrays: Sequence[Path]) -> Entry | None:
    """The entry that a file of facts holds; None if it is of another key, or a file is missing."""
    try:
        facts = json_in(path)
    except BadFile:
        return None
    whole = isinstance(facts, dict) and all(file.is_file() for file in arrays)
    return Entry(name, facts) if whole and facts.get("key") == key else None


def csv_text(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table as CSV."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows((head, *rows))
    return text.getvalue()


TextRow = tuple[str, ...]
T = TypeVar("T")
Columns = Mapping[str, Callable[[T], str]]


@dataclass(frozen=True)
class Table:
    """Headings and rows of text, and which columns hold numbers: those stand to the right."""

    head: TextRow
    rows: tuple[TextRow, ...]
    numbers: tuple[int, ...] = (1,)

    @classmethod
    def of(
        cls, things: Iterable[T], columns: Columns[T], numbers: tuple[int, ...] = (1,)
    ) -> "Table":
        """A row for each of the things; a column is a heading and the function of its cells."""
        rows = tuple(tuple(cell(thing) for cell in columns.values()) for thing in things)
        return cls(tuple(columns), rows, numbers)

    def lines(self) -> list[str]:
        """The table for a terminal: its columns two spaces apart."""
        return [line.replace("−", "-") for line in lines_of(self.head, self.rows, self.numbers)]


def number(value: float, digits: int = 4) -> str:
    """A number as text, such as `12.35` or `3.1e-11`; a dash if it is not a number."""
    if not math.isfinite(value):
        return "∞" if value == math.inf else "–"
    return f"{value:.{digits}g}".replace("-", "−")


def unit_text(unit: str) -> str:
    """A unit as a table shows it: nothing for one."""
    return "" if unit == "1" else unit
