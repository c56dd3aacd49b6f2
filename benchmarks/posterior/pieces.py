"""Runs of a long benchmark in a file, one a line, so that it continues where it was stopped."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

Run = dict[str, Any]


class Pieces:
    """What was measured by now, by name; without a file it is kept in memory alone."""

    def __init__(self, file: Path | None = None) -> None:
        self._file, self._known = file, dict[str, Run]()
        if file is not None and file.exists():
            for line in file.read_text().splitlines():
                one = json.loads(line)
                self._known[one["name"]] = one["run"]

    def once(self, name: str, measure: Callable[[], Run]) -> Run:
        """The run of that name, which is carried out if it is not known."""
        if name not in self._known:
            self._known[name] = measure()
            if self._file is not None:
                self._file.parent.mkdir(parents=True, exist_ok=True)
                with self._file.open("a") as lines:
                    lines.write(json.dumps({"name": name, "run": self._known[name]}) + "\n")
        return self._known[name]
