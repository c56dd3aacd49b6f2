"""The process of a student's file: `python -m workbench.course.answer_process FILE EXERCISES
HANDLE`.

HANDLE is that of a socket, on which the process receives questions and sends answers as plain
values. It has no checks and no solutions, and gives no grades. What the student's code prints is
kept for each exercise.
"""

import importlib.util
import inspect
import io
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from types import ModuleType
from typing import Any

from workbench.course.channel import receive_question, send_answer
from workbench.course.checks import Described, Raised, error_in_words, outcome, raised
from workbench.course.plain import sealed
from workbench.course.withheld_files import withhold
from workbench.processes import Channel, end_with_parent

MEMORY = 6 * 2**30  # bytes that a student's code may take, where the system can limit them
KEPT = 400  # characters of what was printed


class Page(io.TextIOBase):
    """A stream that keeps the beginning of what is written, and counts the rest."""

    def __init__(self) -> None:
        self._kept, self._count = "", 0

    def write(self, text: str) -> int:
        """Keep as much of a text as there is room for."""
        self._kept += text[: max(0, KEPT - len(self._kept))]
        self._count += len(text)
        return len(text)

    @property
    def text(self) -> str:
        """The beginning of what was written, and the number of characters that were not kept."""
        left = self._count - len(self._kept)
        return self._kept.rstrip() + (f"\n... and {left:,} characters more" if left else "")


class Answerer:
    """A student's module, asked for one exercise after the other."""

    def __init__(self, module: ModuleType, refusals: Sequence[str] = ()) -> None:
        self._module, self._page, self._refusals = module, Page(), refusals
        self._answer: Callable[..., Any] | None = None

    def begin(self, exercise: str, parameters: Sequence[str]) -> dict[str, Any]:
        """Begin an exercise whose function has these parameters: {"unfit": why not, or None}."""
        self._answer, self._page = getattr(self._module, exercise, None), Page()
        return {"unfit": _unfit(exercise, self._answer, parameters)}

    def answer(self, arguments: tuple[Any, ...]) -> dict[str, Any]:
        """Answer: {"value": sealed}, or {"raised": [class, message, whether it is unsolved]}."""
        assert self._answer is not None
        with kept(self._page):
            came = outcome(self._answer, arguments)
            if not isinstance(came, Raised):
                try:
                    return {"value": sealed(came)}
                except Exception as error:  # of a type of the student's own, when it is looked at
                    came = raised(error)
        return {"raised": [came.kind, came.message, came.unsolved]}

    def printed(self) -> dict[str, Any]:
        """What the answers to this exercise have printed, and what the process was refused."""
        return {"printed": self._page.text, "refused": list(self._refusals)}


def main(guard: Callable[[str], Sequence[str]] = withhold) -> None:
    """Load the file, then answer questions until the connection ends.

    `guard` is called with the file, refuses from then on what it may not do, and returns the list
    to which what was refused is added.
    """
    end_with_parent()
    file, *exercises, handle = sys.argv[1:]
    channel = Channel.inherited(int(handle))
    sys.dont_write_bytecode = True  # nothing is left in the student's folder
    _limit_memory()
    refusals = guard(file)
    send_answer(channel, 0, {"begun": True})
    module, told = begun(file, exercises)
    send_answer(channel, 1, told)
    if module is None:
        return
    answering = Answerer(module, refusals)
    while (question := receive_question(channel)) is not None:
        number, what, arguments = question
        match what:
            case "begin":
                answer = answering.begin(*arguments)
            case "answer":
                answer = answering.answer(arguments)
            case _:
                answer = answering.printed()
        if not send_answer(channel, number, answer):
            too_large = sealed(Described("an answer", "too large to be graded"))
            send_answer(channel, number, {"value": too_large})
    os._exit(0)  # threads of the student's may still run, and exit handlers of theirs wait


def begun(file: str, exercises: Sequence[str]) -> tuple[ModuleType | None, dict[str, str]]:
    """Run a student's file: its module, and {"loaded": what it printed}.

    If it cannot be loaded, this is None, and {"trouble": why not}.
    """
    page = Page()
    with kept(page):
        try:
            module = load(file)
        except BaseException as error:
            found = sys.modules.get("answers")
            late = isinstance(error, SystemExit) and any(hasattr(found, e) for e in exercises)
            if found is None or not late:
                return None, {"trouble": error_in_words(error, file=file)}
            module = found  # a script may end by sys.exit: what stands above is there
    return module, {"loaded": page.text}


def load(file: str) -> ModuleType:
    """Run a student's file. Raises whatever it raises, also SystemExit."""
    spec = importlib.util.spec_from_file_location("answers", file)
    if spec is None or spec.loader is None:
        raise ImportError(f"{Path(file).name} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules["answers"] = module
    sys.path.append(str(Path(file).parent))  # at the end: it may hold a random.py
    spec.loader.exec_module(module)
    return module


def _unfit(exercise: str, answer: Any, parameters: Sequence[str]) -> list[str] | None:
    """Why what has the exercise's name cannot be tried, in three texts, or None if it can.

    The texts say what is wrong, what was expected, and what came.
    """
    wanted = f"{exercise}({', '.join(parameters)})"
    if answer is None:
        return ["the function", f"a function {wanted}", "no such name in the file"]
    if not callable(answer):
        return ["the function", f"a function {wanted}", f"a {type(answer).__name__}"]
    try:
        theirs = inspect.signature(answer)
    except (TypeError, ValueError):  # some built-ins have none
        return None
    try:
        theirs.bind(*parameters)
    except TypeError:
        return ["the signature must stay as it was", wanted, f"{exercise}{theirs}"]
    return None


@contextmanager
def kept(page: Page) -> Iterator[None]:
    """Write what is printed inside of the context to the page."""
    with redirect_stdout(page), redirect_stderr(page):
        yield


def _limit_memory() -> None:
    with suppress(ImportError, ValueError, OSError):  # not on Windows, or already limited below
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


if __name__ == "__main__":
    main()
