"""What the pages of studies share: figures with captions, tables as text, and their folder."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from workbench.plots import house_style, sheet
from workbench.reports.figures import Shown, shown
from workbench.reports.folder import MAKER, SUMMARY, replacing_folder
from workbench.reports.summary import as_json, versions
from workbench.reports.tables import Table

Report = Callable[[str], None]  # takes a line about what a study does next


def drawn(width: float, height: float, draw: Callable[[Any], object], caption: str) -> Shown:
    """A figure of one pair of axes, width x height inches, as a page holds it."""
    with house_style():
        figure, (ax,) = sheet(width, height)
        draw(ax)
    return shown(figure, caption)


def text_of(*tables: Table) -> str:
    """Tables for a terminal, an empty line between two of them."""
    return "\n\n".join(map(_text_of, tables))


def _text_of(table: Table) -> str:
    lines = [table.head, *table.rows]
    widths = [max(len(line[i]) for line in lines) for i in range(len(table.head))]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if i in table.numbers else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        )
        .rstrip()
        .replace("−", "-")
        for line in lines
    )


def write_study(
    folder: str | Path,
    page: str,
    tables: str,
    data: Mapping[str, Any],
    others: Mapping[str, Callable[[Path], object]],
) -> Path:
    """Write the folder of a study, whole or not at all, and return its page.

    It holds the page, `tables.txt`, `summary.json` with the data, and each of `others`: by file
    name a function that writes to the path it is given.
    """
    target = Path(folder)
    with replacing_folder(target, "") as fresh:
        (fresh / "index.html").write_text(page, encoding="utf-8")
        (fresh / "tables.txt").write_text(tables + "\n", encoding="utf-8")
        for name, write in others.items():
            write(fresh / name)
        about = {"made_by": MAKER, "source": "", **data, "versions": versions()}
        files = ["index.html", "tables.txt", *others, SUMMARY]
        (fresh / SUMMARY).write_text(as_json(about | {"files": files}), encoding="utf-8")
    return target / "index.html"
