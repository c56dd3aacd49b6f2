"""Grading an exercise by its checks, and naming a known mistake that explains a wrong answer.

No code of the student runs here: the process that answers sends plain values, which are converted
to the form of the solution's answers and compared here.
"""

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from workbench.course.checks import (
    Check,
    Missed,
    Mistake,
    Raised,
    copied,
    cut,
    formed,
    in_words,
    kind,
    legible,
    outcome,
    same,
)
from workbench.course.grades import CheckResult, CheckState
from workbench.course.outline import Lecture
from workbench.course.plain import Malformed, opened

Function = Callable[..., Any]
TO_ALL_DIGITS, TO_SIX = 1e-10, 1e-6
Call = tuple[tuple[Any, ...], Any]  # arguments, and what came


class Answers(Protocol):
    """Something that answers exercises: an `answer_process.Answerer`, or a process with one."""

    def begin(self, exercise: str, parameters: Sequence[str]) -> dict[str, Any]:
        """Begin an exercise. Returns {"unfit": why it cannot be tried, in three texts, or None}."""

    def answer(self, arguments: tuple[Any, ...]) -> dict[str, Any]:
        """Call the function. Returns {"value": its answer in the form of `plain.sealed`} or
        {"raised": [class of the error, its message, whether the exercise is unsolved]}.
        """


class Ended(Exception):
    """The process that answers has ended; the message says why."""


class Unanswered(Exception):
    """The exercise stands as it was handed out, or calls one that does."""


@dataclass
class Recorder:
    """Takes the place of a student's function in the checks, and records its calls.

    Its answers have the form of the solution's answers to the same arguments, so that a check
    need not consider None, lists or NaN.
    """

    answers: Answers
    solution: Function
    calls: list[Call] = field(default_factory=list)

    def __call__(self, *arguments: Any) -> Any:
        """Ask for an answer. Raises Unanswered, Missed or Ended."""
        kept = copied(arguments)
        came = received(self.answers.answer(arguments))
        self.calls.append((kept, came))
        what = f"{self.solution.__name__}({', '.join(map(_short, arguments))})"
        if isinstance(came, Raised):
            if came.unsolved:
                raise Unanswered(came.message)
            raise Missed(what, "an answer", came.message)
        return formed(came, self.solution(*copied(arguments)), what)


def received(answer: dict[str, Any]) -> Any:
    """The value that was sent, or Raised. Raises Ended for anything else."""
    try:
        match answer:
            case {"value": data}:
                return opened(data)
            case {"raised": [str() as error, str() as message, bool() as unsolved]}:
                return Raised(error, message, unsolved)
    except (Malformed, RecursionError):  # lists in lists, deeper than anything that is sealed
        pass
    raise Ended("its process sent what is no answer")


def grade_exercise(lecture: Lecture, exercise: str, answers: Answers) -> list[CheckResult]:
    """The results of all checks of an exercise. Raises Ended."""
    checks = [check for check in lecture.checks if check.exercise == exercise]
    solution = lecture.solution(exercise)
    match answers.begin(exercise, list(inspect.signature(solution).parameters)):
        case {"unfit": None}:
            witness = Recorder(answers, solution)
        case {"unfit": [str() as what, str() as expected, str() as came]}:
            return [_failed(check, Missed(what, expected, came)) for check in checks]
        case _:
            raise Ended("its process sent what is no answer")
    results, parts = [], []
    for check in checks:
        before = len(witness.calls)
        results.append(_tried(check, witness))
        parts.append(witness.calls[before:])
    mistakes = [m for m in lecture.mistakes if m.exercise == exercise]
    return [
        replace(one, hint=_likeliest(mistakes, witness.calls, part))
        if one.state is CheckState.FAILED
        else one
        for one, part in zip(results, parts, strict=True)
    ]


def _tried(check: Check, witness: Recorder) -> CheckResult:
    try:
        check.run(witness)
    except Ended:
        raise
    except Unanswered as unsolved:
        if f"'{check.exercise}'" in str(unsolved):
            return CheckResult(check.exercise, check.name, check.points, CheckState.NOT_ATTEMPTED)
        return _failed(check, Missed("it calls another exercise", came=str(unsolved)))
    except Missed as missed:
        return _failed(check, missed)
    except Exception as error:
        text = f"{type(error).__name__}: {error}"
        return _failed(check, Missed("the check could not go on with this answer", came=cut(text)))
    return CheckResult(check.exercise, check.name, check.points, CheckState.PASSED)


def _failed(check: Check, missed: Missed) -> CheckResult:
    return CheckResult(
        check.exercise,
        check.name,
        check.points,
        CheckState.FAILED,
        legible(missed.what),
        legible(missed.expected),
        legible(missed.came),
    )


def _likeliest(mistakes: list[Mistake], calls: list[Call], part: list[Call]) -> str:
    """The hint of the first mistake with the same answers to all calls, to all digits or to six.

    If there is none, it is the hint of the only mistake with the same answers in this check.
    """
    for within in (TO_ALL_DIGITS, TO_SIX):
        for one in mistakes:
            if _explains(one, calls, within):
                return one.hint
    here = [one for one in mistakes if _explains(one, part, TO_SIX)]
    return here[0].hint if len(here) == 1 else ""


def _explains(one: Mistake, calls: list[Call], within: float) -> bool:
    return bool(calls) and all(
        same(came, outcome(one.answer, given), within) for given, came in calls
    )


def _short(value: Any) -> str:
    text = getattr(value, "__name__", "") if callable(value) else in_words(value)
    return " ".join(text.split()) if 0 < len(text) <= 40 else kind(value)
