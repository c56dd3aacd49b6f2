"""A student's file answers in a process that can be killed, and is graded in this one."""

import os
import time
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType, TracebackType
from typing import Any, Self

import workbench
from workbench.course.answers import unheard
from workbench.course.channel import Question
from workbench.course.grades import CheckResult, CheckState, Grade
from workbench.course.grading import Ended, grade_exercise
from workbench.course.outline import Lecture
from workbench.course.plain import Malformed
from workbench.course.words import legible
from workbench.errors import BadArgument, BadFile
from workbench.processes.channel import Channel
from workbench.processes.started import Started, signal_name

STARTING = 120.0  # s, for Python to start and import the workbench on a slow machine
SECONDS = 10.0  # that the answers to an exercise, and the loading of the file, may take

LOADING = ""  # what is going on before the first exercise


def grade(lecture: Lecture, path: str | Path, seconds: float = SECONDS) -> Grade:
    """Grade a file of answers.

    The file runs in a process of its own, which answers; the checks run here, on the plain values
    that it sends, and it is never asked for results. The answers to an exercise
    have `seconds`. An exercise that takes longer, or ends the process, fails; the others are
    answered by a new process. This keeps accidents in, and results from being forged; it is no
    sandbox. Raises BadFile, BadArgument.
    """
    if not seconds > 0:
        raise BadArgument(f"the time limit must be a number of seconds above 0, not {seconds}")
    path = Path(path)
    if not path.is_file():
        raise BadFile(
            f"there is no file {path}; `workbench lecture start {lecture.number} FOLDER` makes one"
        )
    file, found, printed = str(path.resolve()), dict[str, list[CheckResult]](), dict[str, str]()
    _ = lecture.checks, lecture.mistakes, lecture.solutions  # loaded before the file is
    while left := [name for name in lecture.exercises if name not in found]:
        with StudentProcess(file, left, seconds, lecture.module("checks")) as answers:
            try:
                printed[LOADING] = answers.loaded()
            except Ended as ended:
                if not found:
                    results = _not_done(lecture, left, "the file could not be loaded")
                    return Grade(lecture, str(path), tuple(results), str(ended), printed)
                again = f"the file could not be loaded again: {ended}"
                found |= {name: _not_done(lecture, [name], again) for name in left}
                break
            for name in left:
                try:
                    with unheard():
                        found[name] = grade_exercise(lecture, name, answers)
                    printed[name] = answers.printed()
                except Ended as ended:
                    found[name] = _not_done(lecture, [name], str(ended))
                    break
    results = [grade_exercise for name in lecture.exercises for grade_exercise in found[name]]
    printed = {name: text for name, text in printed.items() if text}
    return Grade(lecture, str(path), tuple(results), printed=printed)


def _not_done(lecture: Lecture, exercises: Sequence[str], what: str) -> list[CheckResult]:
    return [
        CheckResult(check.exercise, check.name, check.points, CheckState.FAILED, what)
        for check in lecture.checks
        if check.exercise in exercises
    ]


class StudentProcess:
    """A process that answers, from its start to its end."""

    def __init__(
        self, file: str, exercises: Sequence[str], seconds: float, checks: ModuleType
    ) -> None:
        self._seconds, self._number = seconds, 0
        self._limit = self._left = STARTING
        self._process = Started(
            ["-P", "-m", "workbench.course.answer_process", file, *exercises],
            environment(),
            Path(file).parent,
        )
        self._channel = Channel(self._process.connection)
        self._question = Question(self._channel, checks)

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
        self._process.end()

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
        """See workbench.course.grading.Answers. From here on the exercise has its seconds."""
        self._left = self._limit
        return self._asked("begin", (exercise, parameters))

    def answer(self, arguments: tuple[Any, ...]) -> dict[str, Any]:
        """See workbench.course.grading.Answers."""
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
        code = self._process.wait(10)
        if code is None:
            return "its process ended its output and went on"
        if code < 0:
            return f"its process was ended by {signal_name(code)}"
        return f"it ended the program, with exit code {code}"


def environment() -> dict[str, str]:
    """This process's, and where the workbench is, for one that starts in another folder."""
    here = str(Path(workbench.__file__).parents[1])
    paths = [here, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    return {
        "PYTHONPATH": os.pathsep.join(os.path.abspath(path) for path in paths),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
