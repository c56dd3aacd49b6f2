"""Grading an exercise by its checks, and naming a known mistake that explains a wrong answer."""

import inspect
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from enum import Enum
from typing import Any

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
from workbench.course.outline import Lecture
from workbench.course.outline import lecture as lecture_of
from workbench.course.plain import answered, received
from workbench.errors import UnknownName

Function = Callable[..., Any]
ALL_DIGITS, SIX_DIGITS = 1e-10, 1e-6
Call = tuple[tuple[Any, ...], Any]  # arguments, and what came


class CheckState(Enum):
    """How a check ended."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_ATTEMPTED = "not attempted"


@dataclass(frozen=True)
class CheckResult:
    """The result of one check of one exercise."""

    exercise: str  # the function's name in exercises.py
    check: str  # the name of the check
    of: int  # how many points it is worth
    state: CheckState  # how it ended
    what: str = ""  # the quantity or the property that was missed
    expected: str = ""  # what was expected of it
    came: str = ""  # what the answer was instead
    hint: str = ""  # the likeliest mistake

    @property
    def points(self) -> int:
        """All points of the check if it passed, otherwise none."""
        return self.of if self.state is CheckState.PASSED else 0

    @property
    def explanations(self) -> list[tuple[str, str]]:
        """What was missed, expected and returned, and the likeliest mistake: titles and texts."""
        every = ("", self.what), ("expected", self.expected), ("returned", self.came)
        return [(title, text) for title, text in (*every, ("perhaps", self.hint)) if text]

    def data(self) -> dict[str, Any]:
        """All fields and the points, as plain data."""
        return asdict(self) | {"state": self.state.value, "points": self.points}


@dataclass(frozen=True)
class Grade:
    """The results of one file of answers to a lecture's exercises."""

    lecture: Lecture  # the lecture
    file: str  # the path of the file
    results: tuple[CheckResult, ...]  # one for each check, in the lecture's order
    trouble: str = ""  # why the file as a whole could not be read
    # what the file printed for each exercise, and under "" while it was loaded
    printed: dict[str, str] = field(default_factory=dict)

    @property
    def points(self) -> int:
        """The number of points reached."""
        return sum(result.points for result in self.results)

    @property
    def of(self) -> int:
        """The number of points that can be reached."""
        return sum(result.of for result in self.results)

    @property
    def passed(self) -> bool:
        """Whether every check passed."""
        return all(result.state is CheckState.PASSED for result in self.results)

    @property
    def exercises(self) -> dict[str, list[CheckResult]]:
        """The results by exercise, in the lecture's order."""
        names = dict.fromkeys(result.exercise for result in self.results)
        return {
            name: [result for result in self.results if result.exercise == name] for name in names
        }

    def data(self) -> dict[str, Any]:
        """Everything as plain data, for a grade book."""
        return {
            "lecture": self.lecture.number,
            "title": self.lecture.title,
            "file": self.file,
            "points": self.points,
            "of": self.of,
            "passed": self.passed,
            "trouble": self.trouble,
            "exercises": [
                {
                    "number": f"{self.lecture.number}.{k}",
                    "exercise": name,
                    "points": sum(result.points for result in results),
                    "of": sum(result.of for result in results),
                    "printed": self.printed.get(name, ""),
                    "checks": [
                        {key: value for key, value in result.data().items() if key != "exercise"}
                        for result in results
                    ],
                }
                for k, (name, results) in enumerate(self.exercises.items(), 1)
            ],
        }


class Unanswered(Exception):
    """The exercise stands as it was handed out, or calls one that does."""


@dataclass
class RecordedCalls:
    """Takes the place of a student's function in the checks, and records its calls.

    Its answers are plain values in the form of the solution's answers to the same arguments, so
    that a check need not consider None, lists, NaN or types of the student's own.
    """

    answer: Function
    solution: Function
    calls: list[Call] = field(default_factory=list)

    def __call__(self, *arguments: Any) -> Any:
        """Ask for an answer. Raises Unanswered or Missed."""
        arguments_before = copied(arguments)
        value = received(answered(self.answer, arguments))
        self.calls.append((arguments_before, value))
        what = f"{self.solution.__name__}({', '.join(map(_short, arguments))})"
        if isinstance(value, Raised):
            if value.unsolved:
                raise Unanswered(value.message)
            raise Missed(what, "an answer", value.message)
        return formed(value, self.solution(*copied(arguments)), what)


def grade_exercise(lecture: Lecture, exercise: str, answer: Any) -> list[CheckResult]:
    """The results of all checks of an exercise, of what a file has under its name, or None."""
    checks = [check for check in lecture.checks if check.exercise == exercise]
    solution = lecture.solution(exercise)
    if wrong := unfit(exercise, answer, list(inspect.signature(solution).parameters)):
        return [_failed(check, Missed(*wrong)) for check in checks]
    calls = RecordedCalls(answer, solution)
    results, parts = [], []
    for check in checks:
        before = len(calls.calls)
        results.append(_run_check(check, calls))
        parts.append(calls.calls[before:])
    mistakes = [m for m in lecture.mistakes if m.exercise == exercise]
    return [
        replace(result, hint=_likeliest(mistakes, calls.calls, part))
        if result.state is CheckState.FAILED
        else result
        for result, part in zip(results, parts, strict=True)
    ]


def unfit(exercise: str, answer: Any, parameters: Sequence[str]) -> tuple[str, str, str] | None:
    """Why what has the exercise's name cannot be tried, or None if it can.

    The texts say what is wrong, what was expected, and what there is.
    """
    signature = f"{exercise}({', '.join(parameters)})"
    if answer is None:
        return "the function", f"a function {signature}", "no such name in the file"
    if not callable(answer):
        return "the function", f"a function {signature}", f"a {type(answer).__name__}"
    try:
        own_signature = inspect.signature(answer)
    except (TypeError, ValueError):  # some built-ins have none
        return None
    try:
        own_signature.bind(*parameters)
    except TypeError:
        return "the signature must stay as it was", signature, f"{exercise}{own_signature}"
    return None


def _run_check(check: Check, calls: RecordedCalls) -> CheckResult:
    try:
        check.run(calls)
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
    """The hint of the first mistake with the same answers to all calls.

    If there is none, it is the hint of the only mistake with the same answers in this check.
    """
    for within in (ALL_DIGITS, SIX_DIGITS):
        if hints := [mistake.hint for mistake in mistakes if _explains(mistake, calls, within)]:
            return hints[0]
    hints = [mistake.hint for mistake in mistakes if _explains(mistake, part, SIX_DIGITS)]
    return hints[0] if len(hints) == 1 else ""


def _explains(mistake: Mistake, calls: list[Call], within: float) -> bool:
    return bool(calls) and all(
        same(value, outcome(mistake.answer, arguments), within) for arguments, value in calls
    )


def _short(value: Any) -> str:
    text = getattr(value, "__name__", "") if callable(value) else in_words(value)
    return " ".join(text.split()) if 0 < len(text) <= 40 else kind(value)


def check_here(number: int, answer: Callable[..., Any]) -> None:
    """Run the checks of a lecture's exercise on a function, and print what came of each.

    The exercise is the one with the name of the function, which is defined in a notebook, say.
    Raises UnknownName if there is none.
    """
    lecture, name = lecture_of(number), getattr(answer, "__name__", "")
    if name not in lecture.exercises:
        raise UnknownName(f"exercise of lecture {number}", name, lecture.exercises)
    results = grade_exercise(lecture, name, answer)
    for result in results:
        print(f"{result.state.value}: {result.check}")
        for title, text in result.explanations:
            lead = f"{title} " if title else ""
            print(f"    {lead}" + text.replace("\n", "\n    " + " " * len(lead)))
    print(f"{sum(r.points for r in results)} of {sum(r.of for r in results)} points")
