"""What a folder keeps of each of many files: facts with a key, by which they are known again."""

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from workbench.errors import BadFile
from workbench.reading.facts import json_in


@dataclass(frozen=True)
class Entry:
    """What is kept of a file in the table over all.

    Attributes:
        name: the name of its job.
        facts: the numbers of its page, and the key of everything that they depend on.
    """

    name: str
    facts: dict[str, Any]


def kept_entry(name: str, key: str, facts: Path, arrays: Sequence[Path]) -> Entry | None:
    """The entry that a file of facts holds; None if it is of another key, or a file is missing."""
    try:
        found = json_in(facts)
    except BadFile:
        return None
    whole = isinstance(found, dict) and all(file.is_file() for file in arrays)
    return Entry(name, found) if whole and found.get("key") == key else None


def csv_text(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table as CSV."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows((head, *rows))
    return text.getvalue()
