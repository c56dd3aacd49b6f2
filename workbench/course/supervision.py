"""A student's file: it answers in a process that can be stopped, and is marked in this one."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import ModuleType, TracebackType
from typing import Any, Self

import workbench
from workbench import orphans
from workbench.course.answers import unheard
from workbench.course.channel import Question
from workbench.course.marking import Ended, mark
from workbench.course.marks import Mark, Marked, State
from workbench.course.outline import Lecture
from workbench.course.plain import Malformed
from workbench.course.words import legible
from workbench.errors import BadArgument, BadFile

STARTING = 120.0  # s, for Python to start and import the workbench on a slow machine
SECONDS = 10.0  # that the answers to an exercise, and the loading of the file, may take

LOADING = ""  # what is going on before the first exercise


def marked(lecture: Lecture, path: str | Path, seconds: float = SECONDS) -> Marked:
    """The marks of a file of answers.

    The file runs in a process of its own, which answers; the checks run here, on the plain values
    that it sends, and what it might say of marks is nowhere asked for. The answers to an exercise
    have `seconds`. An exercise that takes longer, or ends the process, fails; the others are
    answered by a new process. This keeps accidents in, and marks from being forged; it is no
    sandbox. Raises BadFile, BadArgument.
    """
    if not seconds > 0:
        raise BadArgument(f"the time limit must be a number of seconds above 0, not {seconds}")
    path = Path(path)
    if not path.is_file():
        raise BadFile(
            f"there is no file {path}; `workbench lecture start {lecture.number} FOLDER` makes one"
        )
    file, found, printed = str(path.resolve()), dict[str, list[Mark]](), dict[str, str]()
    _ = lecture.checks, lecture.mistakes, lecture.solutions  # loaded before the file is
    while left := [name for name in lecture.exercises if name not in found]:
        with Apart(file, left, seconds, lecture.module("checks")) as answers:
            try:
                printed[LOADING] = answers.loaded()
            except Ended as ended:
                if not found:
                    marks = _not_done(lecture, left, "the file could not be loaded")
                    return Marked(lecture, str(path), tuple(marks), str(ended), printed)
                again = f"the file could not be loaded again: {ended}"
                found |= {name: _not_done(lecture, [name], again) for name in left}
                break
            for name in left:
                try:
                    with unheard():
                        found[name] = mark(lecture, name, answers)
                    printed[name] = answers.printed()
                except Ended as ended:
                    found[name] = _not_done(lecture, [name], str(ended))
                    break
    marks = [mark for name in lecture.exercises for mark in found[name]]
    printed = {name: text for name, text in printed.items() if text}
    return Marked(lecture, str(path), tuple(marks), printed=printed)


def _not_done(lecture: Lecture, exercises: Sequence[str], what: str) -> list[Mark]:
    return [
        Mark(check.exercise, check.name, check.points, State.FAILED, what)
        for check in lecture.checks
        if check.exercise in exercises
    ]


class Apart:
    """A process that answers, from its start to its end."""

    def __init__(
        self, file: str, exercises: Sequence[str], seconds: float, checks: ModuleType
    ) -> None:
        self._seconds, self._number = seconds, 0
        self._limit = self._left = STARTING
        self._channel, theirs = socket.socketpair()
        self._question = Question(self._channel, checks)
        with theirs:
            theirs.set_inheritable(True)  # on Windows, where `pass_fds` is not known
            posix = os.name == "posix"
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "workbench.course.answering", str(theirs.fileno())]
                + [file, *exercises],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                cwd=Path(file).parent, env=environment(), start_new_session=True,
                close_fds=posix, pass_fds=(theirs.fileno(),) if posix else (),
            )  # fmt: skip

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """It leaves no process behind, whatever happens."""
        self._channel.close()
        with suppress(OSError):
            if hasattr(os, "killpg"):
                os.killpg(self._process.pid, signal.SIGKILL)
            else:
                self._process.kill()
        self._process.wait()

    def loaded(self) -> str:
        """What the file printed while it was loaded. Raises BadFile, or Ended: why it was not."""
        try:
            self._told(0)
        except Ended as ended:
            raise BadFile(f"the process that answers did not come up: {ended}") from ended
        self._limit = self._left = self._seconds
        self._number = 1
        match self._told(1):
            case {"loaded": str() as text}:
                return legible(text)
            case {"trouble": str() as text}:
                raise Ended(legible(text))
        raise Ended("its process sent what is no answer")

    def begin(self, exercise: str, parameters: Sequence[str]) -> dict[str, Any]:
        """See workbench.course.marking.Answers. From here on the exercise has its seconds."""
        self._left = self._limit
        return self._asked("begin", (exercise, parameters))

    def answer(self, arguments: tuple[Any, ...]) -> dict[str, Any]:
        """See workbench.course.marking.Answers."""
        return self._asked("answer", arguments)

    def printed(self) -> str:
        """By the answers to the exercise that was begun last. Raises Ended."""
        match self._asked("printed", ()):
            case {"printed": str() as text}:
                return legible(text)
        raise Ended("its process sent what is no answer")

    def _asked(self, what: str, arguments: Any) -> dict[str, Any]:
        self._number += 1
        began = time.monotonic()
        try:
            self._question.ask(self._number, what, arguments, self._left)
        except TimeoutError:
            raise self._late() from None
        except OSError:  # it has gone; what it said before is not read any more
            raise Ended(self._by()) from None
        self._left -= time.monotonic() - began
        return self._told(self._number)

    def _told(self, number: int) -> dict[str, Any]:
        began = time.monotonic()
        try:
            told: dict[str, Any] | None = self._question.told(number, self._left)
        except TimeoutError:
            raise self._late() from None
        except Malformed:
            raise Ended("its process sent what is no answer") from None
        if told is None:
            raise Ended(self._by())
        self._left -= time.monotonic() - began
        return told

    def _late(self) -> Ended:
        return Ended(f"stopped after {self._limit:g} s: it takes too long, or does not end")

    def _by(self) -> str:
        try:
            code = self._process.wait(timeout=10)
        except subprocess.TimeoutExpired:
            return "its process ended its output and went on"
        if code < 0:
            known = {one.value: one.name for one in signal.Signals}
            return f"its process was ended by {known.get(-code, f'signal {-code}')}"
        return f"it ended the program, with exit code {code}"


def environment() -> dict[str, str]:
    """This process's, and where the workbench is, for one that starts in another folder."""
    here = str(Path(workbench.__file__).parents[1])
    paths = [here, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    return os.environ | {
        "PYTHONPATH": os.pathsep.join(os.path.abspath(path) for path in paths),
        "PYTHONDONTWRITEBYTECODE": "1",
        **orphans.environment(),
    }
