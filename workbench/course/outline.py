"""The outline of the course: a line for each lecture, and where its four files are."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from workbench.course.checks import Check, Mistake, checks_in, mistakes_in
from workbench.errors import BadArgument, BadFile, UnknownName

LECTURES = "workbench.lectures"  # leads to the package's lectures or the checkout's
FILES = ("lecture.py", "exercises.py", "solutions.py", "checks.py")


@dataclass(frozen=True)
class Lecture:
    """A line of the outline. A lecture that is still to come has no folder.

    Attributes:
        number: its number.
        name: the name of its folder, after the number.
        title: its title.
        question: the question that it begins with.
        minutes: how long it takes to read and to try, without the exercises.
        assumes: what a reader has to know.
        teaches: what a reader learns.
        place: the folder of its files, if it is not part of the course.
    """

    number: int
    name: str
    title: str
    question: str
    minutes: int
    assumes: str
    teaches: str
    place: Path | None = None

    @property
    def asked(self) -> str:
        """What commands take for it: its number, or the folder of one that is not in the course."""
        return str(self.number if self.place is None else self.place)

    @property
    def folder_name(self) -> str:
        """The name of its folder, such as `lec02_rotations`."""
        return f"lec{self.number:02}_{self.name}"

    @property
    def folder(self) -> Path:
        """The folder of its files, which may be missing."""
        return self.place or root() / self.folder_name

    @property
    def there(self) -> bool:
        """Whether all of its files exist."""
        return all((self.folder / name).is_file() for name in FILES)

    @cached_property
    def checks(self) -> tuple[Check, ...]:
        """The checks of all exercises, in order."""
        return checks_in(self.module("checks"))

    @cached_property
    def mistakes(self) -> tuple[Mistake, ...]:
        """The known mistakes of all exercises, in order."""
        return mistakes_in(self.module("checks"))

    @property
    def exercises(self) -> tuple[str, ...]:
        """The names of the functions to write, in the order of their checks."""
        return tuple(dict.fromkeys(check.exercise for check in self.checks))

    def minutes_for(self, exercise: str) -> int | None:
        """How long an exercise takes, as was estimated; None if nobody has estimated it."""
        table: dict[int, dict[str, int]] = import_module(f"{LECTURES}.minutes").ESTIMATED
        return table.get(self.number, {}).get(exercise)

    @property
    def exercise_minutes(self) -> int:
        """How long all exercises take that somebody has estimated."""
        return sum(self.minutes_for(exercise) or 0 for exercise in self.exercises)

    @cached_property
    def solutions(self) -> ModuleType:
        """The module of solutions, which is kept once it has been imported."""
        return self.module("solutions")

    def solution(self, exercise: str) -> Callable[..., Any]:
        """The solution of an exercise."""
        found: Callable[..., Any] = getattr(self.solutions, exercise)
        return found

    def module(self, name: str) -> ModuleType:
        """Import `exercises`, `solutions` or `checks`. (To import `lecture` would run it.)"""
        return import_module(f"{LECTURES}.{self.folder_name}.{name}")


def root() -> Path:
    """The folder of all lectures. Raises BadFile where the installation has none."""
    (place,) = import_module(LECTURES).__path__
    if not (Path(place) / "outline.py").is_file():
        raise BadFile(
            f"there are no lectures in {place}; install the workbench's wheel, or use a whole "
            "checkout, which has them in its folder `lectures`"
        )
    return Path(place)


def course() -> tuple[Lecture, ...]:
    """All lectures of the outline. Raises BadFile where the installation has none."""
    root()
    found: tuple[Lecture, ...] = import_module(f"{LECTURES}.outline").COURSE
    return found


def lecture(number: int) -> Lecture:
    """The lecture of that number. Raises UnknownName, or BadArgument if it is still to come."""
    lectures = course()
    for one in lectures:
        if one.number == number and one.there:
            return one
        if one.number == number:
            raise BadArgument(
                f"lecture {number}, {one.title}, is still to come; `workbench lecture list` says "
                "which are there"
            )
    there = ", ".join(str(one.number) for one in lectures if one.there)
    raise UnknownName("lecture", str(number), hint=f"{there}; `workbench lecture list` names them")
