"""A student's file in a process of its own, with limits of time and memory.

`python -P -m workbench.course.process HANDLE` gets one job as JSON on a socket: a file, and its
exercises. Of a lecture it runs the checks there; this is for learning, and a file that wants to
forge its own result can. Of a pack it gets arguments alone, and sends what the functions return:
right answers never enter that process. What it sends is JSON, and nothing of it is executed.

This is no sandbox: a file runs as whoever marks it, and can read what they can read.
"""

import importlib.util
import io
import json
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import workbench
from workbench.course.checks import cut, error_in_words, legible, without_warnings
from workbench.course.grading import CheckResult, CheckState, Grade, grade_exercise, unfit
from workbench.course.outline import Lecture, lecture_named
from workbench.course.plain import answered, decode
from workbench.errors import BadArgument, BadFile
from workbench.processes import Channel, Started, TooLong, end_with_parent, signal_name

START_SECONDS = 120.0  # s, for Python to start and import the workbench on a slow machine
LARGEST_MESSAGE = 4 * 2**20  # bytes of what is sent for an exercise: half a million numbers
LONGEST_PRINTED = 400  # characters of what was printed
NO_ANSWER = "its process sent what is no answer"


@dataclass(frozen=True)
class ProcessLimits:
    """What the process of a file may take."""

    seconds: float = 10.0  # for all answers to an exercise, and for loading the file
    memory: float = 6.0  # address space in GiB, where the system can limit it

    def __post_init__(self) -> None:
        if not self.seconds > 0:
            raise BadArgument(f"--seconds takes a number above 0, not {self.seconds}")
        if not self.memory >= 1:
            raise BadArgument(f"--memory takes GiB, 1 or more, not {self.memory}")


class ProcessEnded(Exception):
    """The process of a file has ended, or sent what makes no sense; the message says which."""


@dataclass
class Sent:
    """What the process of a file sent."""

    # of each exercise what was sent, or why nothing was
    exercises: dict[str, dict[str, Any] | str] = field(default_factory=dict)
    # what the file printed, by exercise, and under "" while it was loaded
    printed: dict[str, str] = field(default_factory=dict)
    trouble: str = ""  # why the file could not be loaded at all


def grade(lecture: Lecture, path: str | Path, limits: ProcessLimits | None = None) -> Grade:
    """Grade a file of answers by the checks of a lecture, in a process of its own.

    All answers to an exercise together may take `limits.seconds`. An exercise that takes longer, or
    ends the process, fails; the others are answered by a new process. Raises
    BadFile, and NoProcesses in a browser.
    """
    path = Path(path)
    if not path.is_file():
        raise BadFile(
            f"there is no file {path}; `workbench lecture start {lecture.argument} FOLDER` makes it"
        )
    about = {"lecture": lecture.argument if lecture.place is None else str(lecture.place.resolve())}
    sent = ask(path, about, {name: {} for name in lecture.exercises}, limits or ProcessLimits())
    results = [
        result
        for name in lecture.exercises
        for result in _results(lecture, name, sent.exercises[name])
    ]
    return Grade(lecture, str(path), tuple(results), sent.trouble, sent.printed)


def _results(lecture: Lecture, name: str, sent: dict[str, Any] | str) -> list[CheckResult]:
    """The results of the checks of an exercise, as its process found them."""
    checks = [check for check in lecture.checks if check.exercise == name]
    why = sent
    if isinstance(sent, dict):
        try:
            return [
                CheckResult(name, check.name, check.points, CheckState(state), *map(legible, texts))
                for check, (state, *texts) in zip(checks, sent["results"], strict=True)
            ]
        except (KeyError, TypeError, ValueError):
            why = "its process sent what is no result"
    failed = CheckState.FAILED
    return [CheckResult(name, check.name, check.points, failed, str(why)) for check in checks]


def ask(
    file: Path, about: Mapping[str, Any], exercises: Mapping[str, Any], limits: ProcessLimits
) -> Sent:
    """Run a file in a process, for one exercise after the other.

    `about` is what the process is told beside the exercises, of which each name has its data.
    Where it ends, or is ended, a new one goes on with the exercises that are left.
    """
    sent = Sent()
    while left := {name: data for name, data in exercises.items() if name not in sent.exercises}:
        job = {"file": str(file.resolve()), "memory": limits.memory, **about, "exercises": left}
        with _Child(job) as child:
            try:
                sent.printed[""] = _loaded(child, limits.seconds)
            except ProcessEnded as ended:
                again = " again" if sent.exercises else ""
                sent.trouble = "" if again else str(ended)
                why = f"the file could not be loaded{again}: {ended}"
                sent.exercises |= dict.fromkeys(left, why)
                break
            for name in left:
                try:
                    message = child.receive(limits.seconds)
                except ProcessEnded as ended:
                    sent.exercises[name] = str(ended)
                    break
                sent.exercises[name] = message
                sent.printed[name] = legible(str(message.get("printed", "")))
    sent.printed = {name: text for name, text in sent.printed.items() if text}
    return sent


def _loaded(child: "_Child", seconds: float) -> str:
    """What the file printed while it was loaded.

    Raises BadFile if the process did not start, and ProcessEnded if the file could not be loaded.
    """
    try:
        child.receive(START_SECONDS)
    except ProcessEnded as ended:
        raise BadFile(f"the process that answers did not start: {ended}") from ended
    match child.receive(seconds):
        case {"loaded": str() as text}:
            return legible(text)
        case {"trouble": str() as text}:
            raise ProcessEnded(legible(text))
    raise ProcessEnded(NO_ANSWER)


class _Child:
    """The process of a file, from its start to its end."""

    def __init__(self, job: Mapping[str, Any]) -> None:
        folder = Path(job["file"]).parent
        self._process = Started(["-P", "-m", __name__], environment(), folder)
        self._channel = Channel(self._process.connection)
        with suppress(OSError):  # it has ended already, which `_loaded` tells
            self._channel.send(json.dumps(job).encode(), START_SECONDS)

    def __enter__(self) -> "_Child":
        return self

    def __exit__(self, *_: object) -> None:
        """End the process, whatever has happened."""
        self._channel.close()
        self._process.end()

    def receive(self, seconds: float) -> dict[str, Any]:
        """The next thing that the process sends. Raises ProcessEnded."""
        try:
            message = self._channel.receive(seconds, LARGEST_MESSAGE)
            data = None if message is None else json.loads(message)
        except TimeoutError:
            raise ProcessEnded(
                f"stopped after {seconds:g} s: it takes too long, or does not end"
            ) from None
        except OSError:
            message = None
        except (TooLong, ValueError, RecursionError):
            raise ProcessEnded(NO_ANSWER) from None
        if message is None:
            raise ProcessEnded(self._end())
        if not isinstance(data, dict):
            raise ProcessEnded(NO_ANSWER)
        return data

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


# In the process of the file.


def main() -> None:
    """Do the job that is sent."""
    end_with_parent()
    channel = Channel.inherited(int(sys.argv[-1]))
    job = json.loads(channel.receive() or b"{}")
    with suppress(ImportError, ValueError, OSError):  # not on Windows, or limited below already
        import resource

        bytes_ = int(job["memory"] * 2**30)
        resource.setrlimit(resource.RLIMIT_AS, (bytes_, bytes_))
    for message in _messages(job):
        encoded = json.dumps(message).encode("ascii")
        if len(encoded) > LARGEST_MESSAGE:
            encoded = json.dumps({"too large": True}).encode("ascii")
        channel.send(encoded)
    os._exit(0)  # threads of the student's may still run, and exit handlers of theirs wait


def _messages(job: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Do a job: what is sent when it has begun, when the file is loaded, and for each exercise."""
    sys.dont_write_bytecode = True  # nothing is left in the student's folder
    sys.modules.pop("answers", None)
    lecture = lecture_named(job["lecture"]) if "lecture" in job else None
    if lecture is not None:
        _ = lecture.checks, lecture.mistakes, lecture.solutions  # loaded before the file is
    yield {"begun": True}
    module, outcome = load(job["file"])
    yield dict(outcome)
    for name, job_data in job["exercises"].items() if module is not None else ():
        page, answer = io.StringIO(), getattr(module, name, None)
        with _printing_to(page):
            if lecture is None:
                data = answers(name, answer, **job_data)
            else:
                data = {
                    "results": [
                        [result.state.value, result.what, result.expected, result.came, result.hint]
                        for result in grade_exercise(lecture, name, answer)
                    ]
                }
        yield {**data, "printed": cut(page.getvalue().rstrip(), LONGEST_PRINTED)}


def answers(
    exercise: str, answer: Any, parameters: Sequence[str], arguments: Sequence[Any]
) -> dict[str, Any]:
    """What a function returns for each of several lists of arguments, or why it is unfit."""
    if wrong := unfit(exercise, answer, parameters):
        return {"unfit": wrong}
    return {"answers": [answered(answer, tuple(decode(encoded))) for encoded in arguments]}


def load(file: str) -> tuple[ModuleType | None, dict[str, str]]:
    """Run a student's file: its module, and {"loaded": what it printed}.

    If it cannot be loaded, this is None, and {"trouble": why not}.
    """
    page = io.StringIO()
    with _printing_to(page):
        try:
            module = _module(file)
        except BaseException as error:  # SystemExit, too
            return None, {"trouble": error_in_words(error, file=file)}
    return module, {"loaded": cut(page.getvalue().rstrip(), LONGEST_PRINTED)}


def _module(file: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location("answers", file)
    if spec is None or spec.loader is None:
        raise ImportError(f"{Path(file).name} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules["answers"] = module
    sys.path.append(str(Path(file).parent))  # at the end: it may hold a random.py
    spec.loader.exec_module(module)
    return module


@contextmanager
def _printing_to(page: io.StringIO) -> Iterator[None]:
    with redirect_stdout(page), redirect_stderr(page), without_warnings():
        yield


if __name__ == "__main__":
    main()
