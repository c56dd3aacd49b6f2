"""A student's file, marked in a process that is stopped when it takes too long."""

import json
import os
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import workbench
from workbench.course.marks import Mark, Marked, State
from workbench.course.outline import Lecture
from workbench.errors import BadArgument, BadFile

STARTING = 120.0  # s, for Python to start and import the workbench on a slow machine
SECONDS = 10.0  # that an exercise, and the loading of the file, may take

LOADING = ""  # what is going on before the first exercise


def marked(lecture: Lecture, path: str | Path, seconds: float = SECONDS) -> Marked:
    """The marks of a file of answers.

    Every exercise has `seconds`. One that takes longer, or ends the process, fails; the others
    are marked in a new process. This keeps accidents in; it is no sandbox. Raises BadFile,
    BadArgument.
    """
    if not seconds > 0:
        raise BadArgument(f"the time limit must be a number of seconds above 0, not {seconds}")
    path = Path(path)
    if not path.is_file():
        raise BadFile(
            f"there is no file {path}; `workbench lecture start {lecture.number} FOLDER` makes one"
        )
    file, found, printed = str(path.resolve()), dict[str, list[Mark]](), dict[str, str]()
    while left := [name for name in lecture.exercises if name not in found]:
        run = _Run(lecture, file, left, seconds)
        run.follow()
        found |= run.found
        printed |= run.printed
        if run.trouble:
            marks = _not_done(lecture, left, "the file could not be loaded")
            return Marked(lecture, str(path), tuple(marks), run.trouble, printed)
        if run.at is not None and run.ending:
            found[run.at] = _not_done(lecture, [run.at], run.ending)
    marks = [mark for name in lecture.exercises for mark in found[name]]
    printed = {name: text for name, text in printed.items() if text}
    return Marked(lecture, str(path), tuple(marks), printed=printed)


def _not_done(lecture: Lecture, exercises: Sequence[str], what: str) -> list[Mark]:
    return [
        Mark(check.exercise, check.name, check.points, State.FAILED, what)
        for check in lecture.checks
        if check.exercise in exercises
    ]


class _Run:
    """One process, from its start to its end, and what it told."""

    def __init__(
        self, lecture: Lecture, file: str, exercises: Sequence[str], seconds: float
    ) -> None:
        self.seconds = seconds
        self.found: dict[str, list[Mark]] = {}
        self.printed: dict[str, str] = {}
        self.trouble = ""  # why there is no module to mark
        self.ending = ""  # what became of the exercise that it died at
        self.at: str | None = None  # what has begun and is not done
        self._said: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "workbench.course.marker", str(lecture.number), file]
            + list(exercises),
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            cwd=Path(file).parent, env=environment(), start_new_session=True,
        )  # fmt: skip
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def follow(self) -> None:
        """Until it is done, dies, or is silent for too long; it leaves no process behind."""
        try:
            while self._heard():
                pass
        finally:
            self._end()

    def _heard(self) -> bool:
        limit = STARTING if self.at is None else self.seconds
        try:
            told = self._said.get(timeout=limit)
        except queue.Empty:
            self._died(f"stopped after {self.seconds:g} s: it takes too long, or does not end")
            return False
        match told:
            case {"begun": name}:
                self.at = name
            case {"loaded": text}:
                self.printed[LOADING], self.at = text, None
            case {"exercise": name, "marks": marks, "printed": text}:
                self.found[name] = [Mark.from_data(one) for one in marks]
                self.printed[name], self.at = text, None
            case {"trouble": text}:
                self.trouble = text
                return False
            case {"done": True}:
                self.at = None
                return False
            case _:
                self._died(self._by())
                return False
        return True

    def _died(self, how: str) -> None:
        if self.at is None:
            raise BadFile(f"the process that marks did not come up: {how}")
        if self.at == LOADING:
            self.trouble = how
        else:
            self.ending = how

    def _by(self) -> str:
        try:
            code = self._process.wait(timeout=10)
        except subprocess.TimeoutExpired:
            return "its process ended its output and went on"
        if code < 0:
            return f"its process was ended by {signal.Signals(-code).name}"
        return f"it ended the program, with exit code {code}"

    def _end(self) -> None:
        with suppress(OSError):
            if hasattr(os, "killpg"):
                os.killpg(self._process.pid, signal.SIGKILL)
            else:
                self._process.kill()
        self._process.wait()
        self._listener.join(timeout=10)
        if self._process.stdout is not None and not self._listener.is_alive():
            self._process.stdout.close()  # else something that it started still holds it

    def _listen(self) -> None:
        with suppress(Exception):  # whatever happens to the channel is its end
            assert self._process.stdout is not None
            for line in self._process.stdout:
                self._said.put(json.loads(line))
        self._said.put(None)


def environment() -> dict[str, str]:
    """This process's, and where the workbench is, for one that starts in another folder."""
    here = str(Path(workbench.__file__).parents[1])
    paths = [here, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    return os.environ | {
        "PYTHONPATH": os.pathsep.join(os.path.abspath(path) for path in paths),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
