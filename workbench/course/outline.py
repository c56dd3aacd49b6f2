"""The lectures of the course and of one's own folder, and handing out their exercises."""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from importlib.machinery import ModuleSpec
from importlib.util import module_from_spec
from os.path import isdir
from pathlib import Path
from types import ModuleType
from typing import Any

from workbench.course.checks import Check, Mistake, checks_in, mistakes_in
from workbench.errors import BadFile, UnknownName
from workbench.writing import write_new

LECTURES = "workbench.lectures"  # leads to the package's lectures or the checkout's
FILES = ("lecture.py", "exercises.py", "solutions.py", "checks.py")


@dataclass(frozen=True)
class Lecture:
    """A line of the outline."""

    number: int  # its number
    name: str  # the name of its folder, after the number
    title: str  # its title
    question: str  # the question that it begins with
    minutes: int  # how long it takes to read and to try, without the exercises
    assumes: str  # what a reader has to know
    teaches: str  # what a reader learns
    place: Path | None = None  # the folder of its files, if it is not part of the course

    @property
    def argument(self) -> str:
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
        function: Callable[..., Any] = getattr(self.solutions, exercise)
        return function

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
    lectures: tuple[Lecture, ...] = import_module(f"{LECTURES}.outline").COURSE
    return lectures


def lecture(number: int) -> Lecture:
    """The lecture of that number. Raises UnknownName."""
    lectures = {entry.number: entry for entry in course()}
    if number not in lectures:
        numbers = ", ".join(map(str, lectures))
        hint = f"{numbers}; `workbench lecture list` names them"
        raise UnknownName("lecture", str(number), hint=hint)
    return lectures[number]


OUTLINE = "outline.py"  # of a single lecture: it defines LECTURE


def lecture_named(text: str) -> Lecture:
    """A lecture by its number in the course, or by the folder of one that is not part of it.

    Raises UnknownName for a number that the course does not have, and BadFile for a folder that
    holds no lecture.
    """
    return lecture(int(text)) if text.strip().isdecimal() else own_lecture(text)


def own_lecture(folder: str | Path) -> Lecture:
    """The lecture in a folder, which has the files of every lecture and an `outline.py`.

    Its modules are imported as `workbench.lectures.<name of the folder>.checks` and so on, as those
    of the course are, so that the folder may later be moved there as it is. Raises BadFile.
    """
    place = Path(folder).resolve()
    if not isdir(place):  # also for a name that no file system takes
        raise BadFile(
            f"there is no folder {folder}; give the number of a lecture, which `workbench lecture "
            "list` names, or the folder of a lecture of your own (`workbench new lecture NAME`)"
        )
    if missing := [name for name in (*FILES, OUTLINE) if not (place / name).is_file()]:
        raise BadFile(
            f"{folder} holds no lecture: it has no {', '.join(missing)}; `workbench new lecture "
            "NAME` writes a folder that has all files"
        )
    name = f"{LECTURES}.{place.name}"
    taken = root() / place.name
    if not place.name.isidentifier() or (taken.is_dir() and not taken.samefile(place)):
        raise BadFile(
            f"{folder} cannot be imported as {name}, because the course has a lecture of this name "
            "or it is no name in Python; call the folder lecNN_name"
        )
    known = sys.modules.setdefault(name, _package(name, place))
    if Path(known.__path__[0]) != place:
        raise BadFile(f"{folder} and {known.__path__[0]} have the same name; rename one of them")
    lecture = getattr(import_module(f"{name}.{OUTLINE.removesuffix('.py')}"), "LECTURE", None)
    if not isinstance(lecture, Lecture) or lecture.folder_name != place.name:
        called = lecture.folder_name if isinstance(lecture, Lecture) else "no Lecture"
        raise BadFile(
            f"{place.name}/{OUTLINE} must define LECTURE, a Lecture whose number and name are "
            f"those in the name of its folder; it defines {called}"
        )
    return replace(lecture, place=Path(folder))


def _package(name: str, place: Path) -> ModuleType:
    """A package whose modules are in a folder, whatever file of that name stands beside it."""
    spec = ModuleSpec(name, None, is_package=True)
    spec.submodule_search_locations = [str(place)]
    return module_from_spec(spec)


def hand_out(lecture: Lecture, folder: str | Path) -> Path:
    """Write a copy of the exercises, named after the lecture, to a folder, which is made.

    Returns the file. Raises BadFile if it exists: answers are never overwritten.
    """
    path = Path(folder) / f"{lecture.folder_name}.py"
    write_new(path, (lecture.folder / "exercises.py").read_text(encoding="utf-8"))
    return path
