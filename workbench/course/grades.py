"""Results of checks: what a table, a grade book and an exit code say of a student's file."""

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
    """The result of one check of one exercise."""

    exercise: str
    check: str
    of: int  # points
    state: CheckState
    what: str = ""  # the quantity or the property that was missed
    expected: str = ""
    came: str = ""
    hint: str = ""  # the likeliest mistake

    @property
    def points(self) -> int:
        """All points of the check if it passed, otherwise none."""
        return self.of if self.state is CheckState.PASSED else 0

    def data(self) -> dict[str, Any]:
        """Everything as plain data."""
        return asdict(self) | {"state": self.state.value, "points": self.points}


@dataclass(frozen=True)
class Grade:
    """The results of one file of answers to a lecture's exercises."""

    lecture: Lecture
    file: str
    results: tuple[CheckResult, ...]
    trouble: str = ""  # why the file as a whole could not be read
    printed: dict[str, str] = field(default_factory=dict)  # by exercise; "" is while loading

    @property
    def points(self) -> int:
        """The number of points reached."""
        return sum(mark.points for mark in self.results)

    @property
    def of(self) -> int:
        """The number of points that can be reached."""
        return sum(mark.of for mark in self.results)

    @property
    def passed(self) -> bool:
        """Whether every check passed."""
        return all(mark.state is CheckState.PASSED for mark in self.results)

    @property
    def exercises(self) -> dict[str, list[CheckResult]]:
        """The results by exercise, in the lecture's order."""
        names = dict.fromkeys(mark.exercise for mark in self.results)
        return {name: [mark for mark in self.results if mark.exercise == name] for name in names}

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
                    "points": sum(mark.points for mark in results),
                    "of": sum(mark.of for mark in results),
                    "printed": self.printed.get(name, ""),
                    "checks": [
                        {key: value for key, value in mark.data().items() if key != "exercise"}
                        for mark in results
                    ],
                }
                for k, (name, results) in enumerate(self.exercises.items(), 1)
            ],
        }
