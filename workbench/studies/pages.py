"""What the pages of studies share: tables as text, and their folder."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from workbench.reports.folder import Content, write_folder
from workbench.reports.page import Table

Report = Callable[[str], None]  # takes a line about what a study does next


def text_of(*tables: Table) -> str:
    """Tables for a terminal, an empty line between two of them."""
    return "\n\n".join("\n".join(table.lines()) for table in tables)


def write_study(
    folder: str | Path,
    page: str,
    tables: str,
    data: Mapping[str, Any],
    others: Mapping[str, Content],
) -> Path:
    """Write the folder of a study, and return its page; it is written whole or not at all.

    It holds the page, `tables.txt`, `summary.json` with the data, and each of `others`.
    """
    contents = {"index.html": page, "tables.txt": tables + "\n", **others}
    return write_folder(folder, "", contents, data)
