"""Grading a student's file: it answers in a process that can be killed; checks run in this one."""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType, ModuleType, TracebackType
from typing import Any, Self, TypeVar

import workbench
from workbench.course.channel import receive_answer, send_question
from workbench.course.checks import legible, without_warnings
from workbench.course.grades import CheckResult, Grade, not_done
from workbench.course.grading import Ended, grade_exercise
from workbench.course.outline import Lecture
from workbench.course.plain import Malformed
from workbench.course.same_process import grade_here
from workbench.environment import in_browser
from workbench.errors import BadArgument, BadFile
from workbench.processes import Channel, Started, signal_name

STARTING = 120.0  # s, for Python to start and import the workbench on a slow machine
SECONDS = 10.0  # s, for all answers to an exercise, and for loading the file

Exchanged = TypeVar("Exchanged")
LOADING = ""  # stands for an exercise while the file is loaded


def grade(lecture: Lecture, path: str | Path, seconds: float = SECONDS) -> Grade:
    """Grade a file of answers.

    The file runs in a process of its own, which answers; the checks run here, on the plain values
    that it sends. All answers to an exercise together may take `seconds`. An exercise that takes
    longer, or ends the process, fails; the others are answered by a new process. Accidents are
    thus contained, and results cannot be forged, but this is no sandbox. In a browser, where there
    are no other processes, the file runs in this one without a limit of time, and the grade's note
    says so. Raises BadFile, BadArgument.
    """
    if not seconds > 0:
        raise BadArgument(f"the time limit must be a number of seconds above 0, not {seconds}")
    path = Path(path)
    if not path.is_file():
        raise BadFile(
            f"there is no file {path}; `workbench lecture start {lecture.asked} FOLDER` makes one"
        )
    if in_browser():
        return grade_here(lecture, path)
    file, found, printed = str(path.resolve()), dict[str, list[CheckResult]](), dict[str, str]()
    _ = lecture.checks, lecture.mistakes, lecture.solutions  # loaded before the file is
    while left := [name for name in lecture.exercises if name not in found]:
        with StudentProcess(file, left, seconds, lecture.module("checks")) as answers:
            try:
                printed[LOADING] = answers.loaded()
            except Ended as ended:
                if not found:
                    results = not_done(lecture, left, "the file could not be loaded")
                    return Grade(lecture, str(path), tuple(results), str(ended), printed)
                again = f"the file could not be loaded again: {ended}"
                found |= {name: not_done(lecture, [name], again) for name in left}
                break
            for name in left:
                try:
                    with without_warnings():
                        found[name] = grade_exercise(lecture, name, answers)
                    printed[name] = answers.printed()
                except Ended as ended:
                    found[name] = not_done(lecture, [name], str(ended))
                    break
    results = [result for name in lecture.exercises for result in found[name]]
    printed = {name: text for name, text in printed.items() if text}
    return Grade(lecture, str(path), tuple(results), printed=printed)


class StudentProcess:
    """A process that answers questions to a student's file, from its start to its end.

    `checks` is the module whose functions are sent as code, if any are; `module` is what runs in
    the process. `variables` are added to its environment, which is this process's, or `inherited`.

    Attributes:
        refused: what the process was not allowed to do, as far as it said when asked what it
            printed.
    """

    def __init__(
        self,
        file: str,
        exercises: Sequence[str],
        seconds: float,
        checks: ModuleType | None = None,
        module: str = "workbench.course.answer_process",
        variables: Mapping[str, str] = MappingProxyType({}),
        inherited: Mapping[str, str] | None = None,
    ) -> None:
        self._seconds, self._number = seconds, 0
        self.refused: list[str] = []
        self._limit = self._left = STARTING
        self._process = Started(
            ["-P", "-m", module, file, *exercises],
            {**environment(), **variables},
            Path(file).parent,
            inherited,
        )
        self._channel = Channel(self._process.connection)
        self._checks = checks

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the process, whatever has happened."""
        self._channel.close()
        self._process.end()

    def loaded(self) -> str:
        """What the file printed while it was loaded.

        Raises BadFile if the process did not start, and Ended if the file could not be loaded.
        """
        try:
            self._answer(0)
        except Ended as ended:
            raise BadFile(f"the process that answers did not start: {ended}") from ended
        self._limit = self._left = self._seconds
        self._number = 1
        match self._answer(1):
            case {"loaded": str() as text}:
                return legible(text)
            case {"trouble": str() as text}:
                raise Ended(legible(text))
        raise Ended("its process sent what is no answer")

    def begin(self, exercise: str, parameters: Sequence[str]) -> dict[str, Any]:
        """Begin an exercise, whose time starts here; see `workbench.course.grading.Answers`."""
        self._left = self._limit
        return self._asked("begin", (exercise, parameters))

    def answer(self, arguments: tuple[Any, ...]) -> dict[str, Any]:
        """Answer; see `workbench.course.grading.Answers`."""
        return self._asked("answer", arguments)

    def printed(self) -> str:
        """What the answers to the latest exercise have printed. Raises Ended."""
        match self._asked("printed", ()):
            case {"printed": str() as text, "refused": list() as refused}:
                self.refused = [legible(str(one)) for one in refused]
                return legible(text)
        raise Ended("its process sent what is no answer")

    def _asked(self, what: str, arguments: Any) -> dict[str, Any]:
        """Ask, and wait for the answer. Raises Ended."""
        self._number += 1
        self._in_time(
            lambda left: send_question(
                self._channel, self._checks, self._number, what, arguments, left
            )
        )
        return self._answer(self._number)

    def _answer(self, number: int) -> dict[str, Any]:
        """Wait for the answer to a question. Raises Ended."""
        answer = self._in_time(lambda left: receive_answer(self._channel, number, left))
        if answer is None:
            raise Ended(self._end())
        return answer

    def _in_time(self, exchange: Callable[[float], Exchanged]) -> Exchanged:
        """The result of an exchange; its time is subtracted from the seconds left. Raises Ended."""
        began = time.monotonic()
        try:
            exchanged = exchange(self._left)
        except TimeoutError:
            raise Ended(
                f"stopped after {self._limit:g} s: it takes too long, or does not end"
            ) from None
        except OSError:  # the process has ended; what it sent before is not read any more
            raise Ended(self._end()) from None
        except Malformed:
            raise Ended("its process sent what is no answer") from None
        self._left -= time.monotonic() - began
        return exchanged

    def _end(self) -> str:
        """How the process ended, for the end of a sentence."""
        code = self._process.wait(10)
        if code is None:
            return "its process ended its output and went on"
        if code < 0:
            return f"its process was ended by {signal_name(code)}"
        return f"it ended the program, with exit code {code}"


def environment() -> dict[str, str]:
    """Variables by which a process that starts in another folder finds the workbench."""
    here = str(Path(workbench.__file__).parents[1])
    paths = [here, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    return {
        "PYTHONPATH": os.pathsep.join(os.path.abspath(path) for path in paths),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
