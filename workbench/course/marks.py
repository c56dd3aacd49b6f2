"""What became of every check: for a table, for a grade book, and for an exit code."""

from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any

from workbench.course.outline import Lecture


class State(Enum):
    """How a check ended."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_ATTEMPTED = "not attempted"


@dataclass(frozen=True)
class Mark:
    """One check of one exercise."""

    exercise: str
    check: str
    of: int  # points
    state: State
    what: str = ""  # the quantity or the property that was missed
    expected: str = ""
    came: str = ""
    hint: str = ""  # the likeliest mistake

    @property
    def points(self) -> int:
        """All or nothing."""
        return self.of if self.state is State.PASSED else 0

    def data(self) -> dict[str, Any]:
        """As plain data."""
        return asdict(self) | {"state": self.state.value, "points": self.points}


@dataclass(frozen=True)
class Marked:
    """One file of answers to a lecture's exercises."""

    lecture: Lecture
    file: str
    marks: tuple[Mark, ...]
    trouble: str = ""  # why the file as a whole could not be read
    printed: dict[str, str] = field(default_factory=dict)  # by exercise; "" is while loading

    @property
    def points(self) -> int:
        """Reached."""
        return sum(mark.points for mark in self.marks)

    @property
    def of(self) -> int:
        """To be had."""
        return sum(mark.of for mark in self.marks)

    @property
    def passed(self) -> bool:
        """Every check."""
        return all(mark.state is State.PASSED for mark in self.marks)

    @property
    def exercises(self) -> dict[str, list[Mark]]:
        """The marks by exercise, in the lecture's order."""
        names = dict.fromkeys(mark.exercise for mark in self.marks)
        return {name: [mark for mark in self.marks if mark.exercise == name] for name in names}

    def data(self) -> dict[str, Any]:
        """For a grade book."""
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
                    "points": sum(mark.points for mark in marks),
                    "of": sum(mark.of for mark in marks),
                    "printed": self.printed.get(name, ""),
                    "checks": [
                        {key: value for key, value in mark.data().items() if key != "exercise"}
                        for mark in marks
                    ],
                }
                for k, (name, marks) in enumerate(self.exercises.items(), 1)
            ],
        }
