"""The results of the checks of a student's file."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any

from workbench.course.outline import Lecture


class CheckState(Enum):
    """How a check ended."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_ATTEMPTED = "not attempted"


@dataclass(frozen=True)
class CheckResult:
    """The result of one check of one exercise.

    Attributes:
        exercise: the function's name in exercises.py.
        check: the name of the check.
        of: how many points it is worth.
        state: how it ended.
        what: the quantity or the property that was missed.
        expected: what was expected of it.
        came: what the answer was instead.
        hint: the likeliest mistake.
    """

    exercise: str
    check: str
    of: int
    state: CheckState
    what: str = ""
    expected: str = ""
    came: str = ""
    hint: str = ""

    @property
    def points(self) -> int:
        """All points of the check if it passed, otherwise none."""
        return self.of if self.state is CheckState.PASSED else 0

    def data(self) -> dict[str, Any]:
        """All fields and the points, as plain data."""
        return asdict(self) | {"state": self.state.value, "points": self.points}


@dataclass(frozen=True)
class Grade:
    """The results of one file of answers to a lecture's exercises.

    Attributes:
        lecture: the lecture.
        file: the path of the file.
        results: one for each check, in the lecture's order.
        trouble: why the file as a whole could not be read.
        printed: what the file printed for each exercise, and under "" while it was loaded.
        note: what has to be known of how it was graded, in whole sentences; usually nothing.
    """

    lecture: Lecture
    file: str
    results: tuple[CheckResult, ...]
    trouble: str = ""
    printed: dict[str, str] = field(default_factory=dict)
    note: str = ""

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
            "note": self.note,
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


def not_done(lecture: Lecture, exercises: Sequence[str], what: str) -> list[CheckResult]:
    """The results of checks that could not be run, all of them failed, for the reason `what`."""
    return [
        CheckResult(check.exercise, check.name, check.points, CheckState.FAILED, what)
        for check in lecture.checks
        if check.exercise in exercises
    ]
