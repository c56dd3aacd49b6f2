"""A lecture's line in the outline, and where its four files are."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from workbench.course.checks import Check, Mistake, checks_in, mistakes_in
from workbench.errors import BadFile, UnknownName

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

    def solution(self, exercise: str) -> Callable[..., Any]:
        """Ours."""
        found: Callable[..., Any] = getattr(self.module("solutions"), exercise)
        return found

    def module(self, name: str) -> ModuleType:
        """`exercises`, `solutions` or `checks`; importing `lecture` would hold it."""
        return import_module(f"lectures.{self.folder_name}.{name}")


def root() -> Path:
    """The folder of all lectures. Raises BadFile where the installation has none."""
    spec = find_spec("lectures")
    if spec is None or spec.origin is None:
        raise BadFile("the lectures are not installed; install the workbench's wheel or checkout")
    return Path(spec.origin).parent


def course() -> tuple[Lecture, ...]:
    """Every line of the outline."""
    root()
    found: tuple[Lecture, ...] = import_module("lectures.outline").COURSE
    return found


def lecture(number: int) -> Lecture:
    """The lecture of that number. Raises UnknownName, also if it is still to come."""
    lectures = course()
    for one in lectures:
        if one.number == number and one.there:
            return one
    there = ", ".join(f"{one.number} {one.name}" for one in lectures if one.there)
    raise UnknownName("lecture", str(number), hint=there)
