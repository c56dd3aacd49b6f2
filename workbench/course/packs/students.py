"""The students of a class: from a CSV file of a learning platform, or a list of names."""

import csv
import re
import unicodedata
from pathlib import Path

from workbench.errors import BadArgument, BadFile

COLUMNS = ("student", "name", "full name", "login", "username", "id", "email")
LONGEST = 60  # characters of a folder's name


def students(given: str) -> dict[str, str]:
    """Names by the names of their folders, from a FILE.csv or from names with commas between them.

    Of a file the column `student` counts, or else `name` and the like, or else the first one; the
    first line holds the titles of the columns. Raises BadArgument, BadFile.
    """
    names = _read(Path(given)) if given.lower().endswith(".csv") else given.split(",")
    names = [" ".join(name.split()) for name in names]
    names = [name for name in names if name]
    if not names:
        raise BadArgument("there are no students; give --students FILE.csv, or names: ada,ben")
    found: dict[str, str] = {}
    for name in names:
        folder = folder_name(name)
        if folder in found:
            raise BadArgument(
                f"{found[folder]!r} and {name!r} would share the folder {folder}; tell them apart "
                "by another name or a number"
            )
        found[folder] = name
    return found


def folder_name(name: str) -> str:
    """A name as that of a folder: small letters, digits, and `-` between words."""
    found = re.sub(r"[^\w]+", "-", _small(name)).strip("-_")[:LONGEST]
    if not found:
        raise BadArgument(f"{name!r} has no letters and no digits, so that it cannot name a folder")
    return found


def plain_name(name: str) -> str:
    """A name to be compared with others: letters and digits alone, `-` between words."""
    return re.sub(r"[\W_]+", "-", _small(name)).strip("-")


def _small(name: str) -> str:
    return unicodedata.normalize("NFKC", name).lower()


def _read(path: Path) -> list[str]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is no text in UTF-8"
        raise BadFile(f"cannot read {path}: {reason}") from error
    dialect = ";" if text.split("\n", 1)[0].count(";") > text.split("\n", 1)[0].count(",") else ","
    rows = [row for row in csv.reader(text.splitlines(), delimiter=dialect) if any(row)]
    if len(rows) < 2:
        raise BadFile(f"{path} has no students: it needs a line of titles, and a line for each")
    titles = [title.strip().lower() for title in rows[0]]
    column = next((titles.index(title) for title in COLUMNS if title in titles), 0)
    return [row[column] for row in rows[1:] if len(row) > column]
