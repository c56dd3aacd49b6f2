"""A lecture's line in the outline, and where its four files are."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from workbench.course.checks import Check, Mistake, checks_in, mistakes_in
from workbench.errors import BadArgument, BadFile, UnknownName

LECTURES = "workbench.lectures"  # which says where they are: in the package or the checkout
FILES = ("lecture.py", "exercises.py", "solutions.py", "checks.py")


@dataclass(frozen=True)
class Lecture:
    """What the outline says of a lecture. One that is still to come has a number and no folder."""

    number: int
    name: str  # of its folder, after the number
    title: str
    question: str  # that it begins with
    minutes: int  # to read and to try, without the exercises
    assumes: str
    teaches: str

    @property
    def folder_name(self) -> str:
        """`lec02_rotations`."""
        return f"lec{self.number:02}_{self.name}"

    @property
    def folder(self) -> Path:
        """Where its files are, if it has any."""
        return root() / self.folder_name

    @property
    def there(self) -> bool:
        """Whether all of its files are."""
        return all((self.folder / name).is_file() for name in FILES)

    @cached_property
    def checks(self) -> tuple[Check, ...]:
        """Of all exercises, in order."""
        return checks_in(self.module("checks"))

    @cached_property
    def mistakes(self) -> tuple[Mistake, ...]:
        """That are known, of all exercises."""
        return mistakes_in(self.module("checks"))

    @property
    def exercises(self) -> tuple[str, ...]:
        """The names of the functions to write, in the order of their checks."""
        return tuple(dict.fromkeys(check.exercise for check in self.checks))

    @cached_property
    def solutions(self) -> ModuleType:
        """The module of our answers; it stays here when a marker keeps it from imports."""
        return self.module("solutions")

    def solution(self, exercise: str) -> Callable[..., Any]:
        """Ours."""
        found: Callable[..., Any] = getattr(self.solutions, exercise)
        return found

    def module(self, name: str) -> ModuleType:
        """`exercises`, `solutions` or `checks`; importing `lecture` would hold it."""
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
    """Every line of the outline."""
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
