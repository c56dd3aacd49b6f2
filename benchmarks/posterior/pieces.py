"""Runs of a long benchmark in a file, one a line, so that it continues where it was stopped."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from workbench.errors import BadFile

Run = dict[str, Any]


class Pieces:
    """What was measured by now, by name; without a file it is kept in memory alone.

    Raises BadFile if a line of the file cannot be read, unless it is a last one of which only the
    beginning was written: that run is measured again.
    """

    def __init__(self, file: Path | None = None) -> None:
        self._file = file
        self._known = runs_of(file) if file is not None and file.exists() else {}

    def once(self, name: str, measure: Callable[[], Run]) -> Run:
        """The run of that name, which is carried out if it is not known."""
        if name not in self._known:
            run = measure()
            if self._file is not None:
                _append(self._file, {"name": name, "run": run})
            self._known[name] = run
        return self._known[name]


def runs_of(file: Path) -> dict[str, Run]:
    """The runs in a file, by name, which is not changed; a last half line is left out.

    Raises BadFile if any other line cannot be read.
    """
    runs = dict[str, Run]()
    for number, line in enumerate(_whole(file.read_bytes()).splitlines(), start=1):
        try:
            one = json.loads(line)
            runs[one["name"]] = one["run"]
        except (ValueError, KeyError, TypeError) as error:
            raise BadFile(
                f'line {number} of {file} is not {{"name": ..., "run": ...}} ({error!r}); without '
                "this line, its run would be measured again"
            ) from error
    return runs


def _append(file: Path, one: dict[str, Any]) -> None:
    """In place of the half line that a process may have left that was killed as it wrote."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a+b") as lines:
        lines.seek(0)
        whole = _whole(lines.read())
        lines.truncate(len(whole))
        begun = b"\n" if whole and not whole.endswith(b"\n") else b""
        lines.write(begun + json.dumps(one).encode() + b"\n")


def _whole(content: bytes) -> bytes:
    """Without a half line at the end: one without a line end that is not JSON."""
    ended, newline, last = content.rpartition(b"\n")
    try:
        json.loads(last)
    except ValueError:
        return ended + newline
    return content
