"""Checks of an exercise in a notebook: on a function that is defined there, in the same process.

This is for learning. Files that count are graded in processes of their own.
"""

from collections.abc import Callable
from types import ModuleType
from typing import Any

from workbench.course.answer_process import Answerer
from workbench.course.grades import CheckResult, CheckState
from workbench.course.grading import grade_exercise
from workbench.course.outline import lecture
from workbench.errors import UnknownName


def check_here(number: int, answer: Callable[..., Any]) -> None:
    """Run the checks of a lecture's exercise on a function, and print what came of each.

    The exercise is the one with the name of the function. Raises UnknownName if there is none.
    """
    one, name = lecture(number), getattr(answer, "__name__", "")
    if name not in one.exercises:
        raise UnknownName(f"exercise of lecture {number}", name, one.exercises)
    module = ModuleType("answers")
    setattr(module, name, answer)
    results = grade_exercise(one, name, Answerer(module))
    for result in results:
        print("\n".join(_lines(result)))
    print(f"{sum(r.points for r in results)} of {sum(r.of for r in results)} points")


def _lines(result: CheckResult) -> list[str]:
    lines = [f"{result.state.value}: {result.check}"]
    if result.state is CheckState.FAILED:
        told = (("", result.what), ("expected ", result.expected), ("returned ", result.came))
        lines += [
            f"    {title}" + text.replace("\n", "\n    " + " " * len(title))
            for title, text in (*told, ("perhaps ", result.hint))
            if text
        ]
    return lines
