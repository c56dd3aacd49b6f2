"""Where finished results are kept, each under a key that says all it depends on."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

from workbench.comparison.record import Stored
from workbench.errors import BadFile
from workbench.reading.arrays import doubles_or_nan, open_arrays, read_expected, texts
from workbench.reading.facts import facts_in, json_in
from workbench.writing import write_arrays, write_file

T = TypeVar("T")
MARK = "comparison.json"  # by which a folder of ours is known
RUNS = "runs"
FACTS = "facts"


class FolderStore:
    """One file for each result in FOLDER/runs, written whole or not at all.

    Raises BadFile if the folder holds something else, or cannot be made.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        self._runs = self.folder / RUNS
        try:
            exists = self.folder.exists() and (
                not self.folder.is_dir() or any(self.folder.iterdir())
            )
            if exists and not _ours(self.folder / MARK):
                raise BadFile(
                    f"{self.folder} exists and holds no comparison, so nothing is written there; "
                    "choose another folder"
                )
            self._runs.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BadFile(
                f"cannot make the folder {self.folder}: {error.strerror}; choose another"
            ) from error
        if not exists:
            text = json.dumps({"made_by": "workbench", "kind": "comparison"})
            write_file(self.folder / MARK, text)

    def get(self, key: str, of: Callable[[Stored], T]) -> T | None:
        """What is stored under a key, as `of` makes it; None if nothing is, or nothing whole.

        `of` raises BadFile for what is something else.
        """
        try:
            with open_arrays(self._runs / f"{key}.npz") as archive:
                facts = facts_in(read_expected(archive, {FACTS: texts()})[FACTS])
                numbers = {
                    name: doubles_or_nan(*header.shape)
                    for name, header in archive.headers.items()
                    if name != FACTS
                }
                return of((dict(facts.entries), read_expected(archive, numbers)))
        except BadFile:
            return None

    def put(self, key: str, stored: Stored) -> None:
        """Keep a result under its key, in a file."""
        facts, arrays = stored
        named = {**arrays, FACTS: np.array(json.dumps(facts))}
        write_arrays(self._runs / f"{key}.npz", named)


def _ours(mark: Path) -> bool:
    try:
        facts = json_in(mark)
    except BadFile:
        return False
    return isinstance(facts, dict) and facts.get("kind") == "comparison"
