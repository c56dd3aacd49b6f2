"""One exercise, tried by its checks; and the mistake that explains what came."""

import inspect
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from types import ModuleType
from typing import Any

from workbench.course.answers import Raised, copied, formed, outcome, same
from workbench.course.checks import Check, Missed, Mistake
from workbench.course.marks import Mark, State
from workbench.course.outline import Lecture
from workbench.course.words import cut, in_words, kind
from workbench.errors import Unsolved

Function = Callable[..., Any]
TO_ALL_DIGITS, TO_SIX = 1e-10, 1e-6
Call = tuple[tuple[Any, ...], Any]  # arguments, and what came


@dataclass
class Witness:
    """Stands in for a student's function before the checks, and remembers what it answered.

    What it passes on has the form of the solution's answer to the same arguments, so a check
    need not think of None, of lists or of NaN.
    """

    answer: Function
    solution: Function
    heard: list[Call] = field(default_factory=list)

    def __call__(self, *arguments: Any) -> Any:
        """Raises Unsolved or Missed."""
        kept = copied(arguments)
        came = outcome(self.answer, arguments)
        self.heard.append((kept, came))
        what = f"{self.solution.__name__}({', '.join(map(_short, arguments))})"
        if isinstance(came, Raised):
            if isinstance(came.error, Unsolved):
                raise came.error
            raise Missed(what, "an answer", said(came.error, self.answer)) from came.error
        return formed(came, self.solution(*copied(arguments)), what)


def mark(lecture: Lecture, exercise: str, module: ModuleType) -> list[Mark]:
    """All checks of an exercise, on the function of that name in a student's module."""
    checks = [check for check in lecture.checks if check.exercise == exercise]
    solution = lecture.solution(exercise)
    answer = getattr(module, exercise, None)
    wrong = _not_it(exercise, answer, solution)
    if wrong is not None or answer is None:
        return [_failed(check, wrong or Missed("")) for check in checks]
    witness = Witness(answer, solution)
    marks, parts = [], []
    for check in checks:
        before = len(witness.heard)
        marks.append(_tried(check, witness))
        parts.append(witness.heard[before:])
    mistakes = [m for m in lecture.mistakes if m.exercise == exercise]
    return [
        replace(one, hint=_likeliest(mistakes, witness.heard, part))
        if one.state is State.FAILED
        else one
        for one, part in zip(marks, parts, strict=True)
    ]


def _tried(check: Check, witness: Witness) -> Mark:
    try:
        check.run(witness)
    except Unsolved as unsolved:
        if f"'{check.exercise}'" in str(unsolved):
            return Mark(check.exercise, check.name, check.points, State.NOT_ATTEMPTED)
        return _failed(check, Missed("it calls another exercise", came=str(unsolved)))
    except Missed as missed:
        return _failed(check, missed)
    except Exception as error:
        said = f"{type(error).__name__}: {error}"
        return _failed(check, Missed("the check could not go on with this answer", came=cut(said)))
    return Mark(check.exercise, check.name, check.points, State.PASSED)


def _failed(check: Check, missed: Missed) -> Mark:
    return Mark(
        check.exercise, check.name, check.points, State.FAILED,
        missed.what, missed.expected, missed.came,
    )  # fmt: skip


def _likeliest(mistakes: list[Mistake], heard: list[Call], part: list[Call]) -> str:
    """The hint of the first mistake that answers alike throughout, to all digits or else to six;
    or of the only one that does in this check.
    """
    for within in (TO_ALL_DIGITS, TO_SIX):
        for one in mistakes:
            if _explains(one, heard, within):
                return one.hint
    here = [one for one in mistakes if _explains(one, part, TO_SIX)]
    return here[0].hint if len(here) == 1 else ""


def _explains(one: Mistake, calls: list[Call], within: float) -> bool:
    return bool(calls) and all(
        same(came, outcome(one.answer, given), within) for given, came in calls
    )


def _not_it(exercise: str, answer: Any, solution: Function) -> Missed | None:
    """Why what has the exercise's name cannot be tried."""
    asked = inspect.signature(solution)
    wanted = f"{exercise}({', '.join(asked.parameters)})"
    if answer is None:
        return Missed("the function", f"a function {wanted}", "no such name in the file")
    if not callable(answer):
        return Missed("the function", f"a function {wanted}", f"a {type(answer).__name__}")
    try:
        theirs = inspect.signature(answer)
    except (TypeError, ValueError):  # some built-ins have none
        return None
    try:
        theirs.bind(*asked.parameters)
    except TypeError:
        return Missed("the signature must stay as it was", wanted, f"{exercise}{theirs}")
    return None


def said(error: BaseException, answer: Function | None = None, file: str = "") -> str:
    """What was raised, and in which line of the student's file."""
    if isinstance(error, SystemExit):
        told = f"it ends the program (sys.exit({error.code if error.code is not None else ''}))"
    else:
        told = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    code = getattr(answer, "__code__", None)
    file = file or (code.co_filename if code is not None else "")
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == file]
    if isinstance(error, SyntaxError) and error.lineno is not None and error.filename == file:
        lines, told = [error.lineno], f"{type(error).__name__}: {error.msg}"
    return cut(f"line {lines[-1]}: {told}" if lines and lines[-1] else told)


def _short(value: Any) -> str:
    text = getattr(value, "__name__", "") if callable(value) else in_words(value)
    return " ".join(text.split()) if 0 < len(text) <= 40 else kind(value)
