"""The students of a class: from a CSV file of a learning platform, or a list of names."""

import csv
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from workbench.errors import BadArgument, BadFile
from workbench.reading.facts import bounded

FIRST, LAST = "first name", ("last name", "surname", "family name")
JOINED = "first name and last name"
COLUMNS = (
    "student", "name", "full name", JOINED, "login", "username", "id", "id number", "email",
    "email address",
)  # fmt: skip
LONGEST = 60  # characters of a folder's name


@dataclass(frozen=True)
class Students:
    """The students of a class.

    Attributes:
        names: their names, by the names of their folders.
        columns: the titles of the columns of the file from which they come; none for a list.
    """

    names: dict[str, str]
    columns: tuple[str, ...] = ()


def read_students(given: str, column: str | None = None) -> Students:
    """Students from a FILE.csv, or from names with commas between them.

    The first line of a file holds the titles of its columns. Names are read from `column`, or else
    from the first of COLUMNS that the file has. Raises BadArgument, BadFile.
    """
    is_file = given.lower().endswith(".csv")
    if column is not None and not is_file:
        raise BadArgument("--column chooses a column of --students FILE.csv, which is not given")
    names, columns = _read(Path(given), column) if is_file else (given.split(","), ())
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
                "by another name or a number, or take another --column"
            )
        found[folder] = name
    return Students(found, columns)


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


def _read(path: Path, column: str | None) -> tuple[list[str], tuple[str, ...]]:
    """The names in a file, and the titles of the columns that they come from."""
    try:
        text = bounded(path).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError, BadFile) as error:
        no_text = isinstance(error, UnicodeDecodeError)
        reason = "it is no text in UTF-8" if no_text else getattr(error, "strerror", None) or error
        raise BadFile(f"cannot read {path}: {reason}") from error
    between = max(",;\t", key=text.partition("\n")[0].count)
    rows = [row for row in csv.reader(text.splitlines(), delimiter=between) if any(row)]
    if len(rows) < 2:
        raise BadFile(f"{path} has no students: it needs a line of titles, and a line for each")
    titles = [title.strip() for title in rows[0]]
    places = _places(path, titles, column)
    names = [" ".join(row[k] for k in places if k < len(row)) for row in rows[1:]]
    return names, tuple(titles[k] for k in places)


def _places(path: Path, titles: Sequence[str], column: str | None) -> list[int]:
    """Which columns hold the names. Raises BadArgument, BadFile."""
    listed = ", ".join(repr(title) for title in titles if title)
    plain = [_title(title) for title in titles]
    if column is not None:
        if _title(column) not in plain:
            raise BadArgument(f"{path} has no column {column!r}; its columns are {listed}")
        return [plain.index(_title(column))]
    last = next((title for title in LAST if title in plain), None)
    for known in COLUMNS:
        if known == JOINED and FIRST in plain and last is not None:
            return [plain.index(FIRST), plain.index(last)]
        if known in plain:
            return [plain.index(known)]
    raise BadFile(
        f"none of the columns of {path} is known to hold names: its first line has {listed}. "
        f"Choose one with --column, or call it one of {', '.join(COLUMNS[:3])}, or "
        f"{FIRST} and {LAST[0]}"
    )


def _title(text: str) -> str:
    """A title to be compared: `E-mail_Address` is `email address`."""
    return " ".join(text.lower().replace("e-mail", "email").replace("_", " ").split())
