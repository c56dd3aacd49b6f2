"""Exercises with numbers of each student's own, and which a pack holds."""

import ast
import importlib.util
import inspect
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from workbench.course.checks import Mistake, mistakes_in
from workbench.course.outline import Lecture, lecture
from workbench.errors import BadArgument, BadFile, UnknownName, WorkbenchError

Numbers = dict[str, Any]  # names in capitals, and numbers, text or lists of these
Arguments = tuple[Any, ...]


@dataclass(frozen=True)
class Variant:
    """An exercise of a lecture with numbers of each student's own.

    The solution takes the arguments that the student's function takes, and the numbers by name.
    """

    exercise: str  # the name of the lecture's exercise, which the function keeps
    points: int  # how many points it is worth
    minutes: int  # how long it takes; an estimate
    # the numbers of one student, from a generator of random numbers
    draw: Callable[[np.random.Generator], Numbers]
    # one random set of arguments, from a generator and the numbers
    arguments: Callable[[np.random.Generator, Numbers], Arguments]
    # sets of arguments at the ends of the range, which are worth one of the points
    edges: Callable[[Numbers], Sequence[Arguments]]
    within: float  # the largest relative error of an answer
    solution: Callable[..., Any]  # the right answer

    @property
    def signature(self) -> str:
        """The first line of the student's function, without the numbers."""
        (node,) = ast.parse(inspect.cleandoc("\n" + inspect.getsource(self.solution))).body
        assert isinstance(node, ast.FunctionDef)
        node.args.kwonlyargs, node.args.kw_defaults = [], []
        returns = f" -> {ast.unparse(node.returns)}" if node.returns else ""
        return f"def {self.exercise}({ast.unparse(node.args)}){returns}:"

    @property
    def parameters(self) -> list[str]:
        """The names of the arguments of the student's function."""
        names = list(inspect.signature(self.solution).parameters)
        return [name for name in names if name not in self.constants]

    @property
    def constants(self) -> list[str]:
        """The names of the student's own numbers."""
        return inspect.getfullargspec(self.solution).kwonlyargs

    @property
    def task(self) -> str:
        """What the student is asked to do, with shapes and units."""
        return inspect.getdoc(self.solution) or ""


def variant(
    exercise: str,
    *,
    points: int,
    minutes: int,
    draw: Callable[[np.random.Generator], Numbers],
    arguments: Callable[[np.random.Generator, Numbers], Arguments],
    edges: Callable[[Numbers], Sequence[Arguments]] = lambda numbers: (),
    within: float = 1e-7,
) -> Callable[[Callable[..., Any]], Variant]:
    """Make a solution with numbers by name a variant of a lecture's exercise; see Variant.

    The docstring of the solution is the task. Its keyword-only arguments are the numbers.
    """
    if points < 1 or minutes < 1:
        raise BadArgument(f"{exercise}: points and minutes have to be at least 1")
    return lambda solution: Variant(
        exercise, points, minutes, draw, arguments, edges, within, solution
    )


def rounded(
    rng: np.random.Generator, low: float, high: float, count: int = 0, digits: int = 2
) -> Any:
    """A number from low to high with a few digits, or a list of `count` of them, for `draw`.

    Students read these numbers in their file, where they have to stand exactly. The last digit is
    never 0.
    """
    whole = np.round(rng.uniform(low, high, size=count or 1) * 10**digits).astype(int)
    drawn = [round(int(n + (n % 10 == 0)) / 10**digits, digits) for n in whole]
    return drawn if count else drawn[0]


FILE = "variants.py"


@dataclass(frozen=True)
class PackExercise:
    """An exercise of a pack."""

    number: str  # as it is printed, such as `4.2`; for a file, its name and a number
    sheet: str  # the name of the student's file, without its ending
    title: str  # the title of the lecture or of the file
    variant: Variant  # the exercise
    mistakes: tuple[Mistake, ...]  # wrong answers to it that are known
    published: Lecture | None  # where a solution of the exercise in the lecture stands, or None


def chosen_exercises(what: Sequence[str]) -> list[PackExercise]:
    """The exercises that are named, in the order of their names; none is there twice.

    Raises BadArgument, BadFile, UnknownName.
    """
    exercises: dict[str, PackExercise] = {}
    for name in what:
        read = _exercises_in_file if name.endswith(".py") else _exercises_of_lecture
        exercises |= {exercise.number: exercise for exercise in read(name)}
    if not exercises:
        raise BadArgument("a pack needs exercises: numbers of lectures (4), or of exercises (4.2)")
    sheets: dict[str, str] = {}
    owners: dict[tuple[str, str], str] = {}  # of names of numbers, which stand in one file
    for exercise in exercises.values():
        sheet, title, number = exercise.sheet, exercise.title, exercise.number
        if sheets.setdefault(sheet, title) != title:
            raise BadArgument(f"two files would be called {sheet}.py; rename {title}")
        for name in exercise.variant.constants:
            other = owners.setdefault((sheet, name), number)
            if other != number:
                raise BadArgument(
                    f"{name} is a number of exercise {other} and of exercise {number}, which stand "
                    f"in one file, {sheet}.py; rename one of them"
                )
    return list(exercises.values())


def variants_of(lecture: Lecture) -> list[PackExercise]:
    """All variants of a lecture, in the order of its exercises; none if it has no such file."""
    if not (lecture.folder / FILE).is_file():
        return []
    names, module = list(lecture.exercises), lecture.module("variants")
    title = f"lecture {lecture.number}, {lecture.title}"
    varying = _in_module(module, str(lecture.number), names, lecture.folder_name, title, lecture)
    return sorted(varying, key=lambda exercise: names.index(exercise.variant.exercise))


def _in_module(
    module: ModuleType,
    number: str,
    names: Sequence[str],
    sheet: str,
    title: str,
    published: Lecture | None = None,
) -> list[PackExercise]:
    """The variants of a module, numbered by the places of their names."""
    variants = [variant for variant in vars(module).values() if isinstance(variant, Variant)]
    names = names or [variant.exercise for variant in variants]
    places = {name: k for k, name in enumerate(names, 1)}
    return [
        PackExercise(
            f"{number}.{places[variant.exercise]}",
            sheet,
            title,
            variant,
            tuple(m for m in mistakes_in(module) if m.exercise == variant.exercise),
            published,
        )
        for variant in variants
    ]


def _exercises_in_file(name: str) -> list[PackExercise]:
    """All variants of a lecturer's own file. Raises BadFile."""
    path = Path(name)
    if not path.is_file():
        raise BadFile(f"there is no file {path}; name a file with variants, or a lecture's number")
    spec = importlib.util.spec_from_file_location(f"variants_of_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise BadFile(f"{path} does not run: {type(error).__name__}: {error}") from error
    exercises = _in_module(module, path.stem, (), path.stem, path.stem)
    if not exercises:
        raise BadFile(
            f"{path} has no variants; write them with `workbench.course.packs.variant`, as "
            "lectures/lec04_skinning/variants.py does"
        )
    return exercises


def _exercises_of_lecture(name: str) -> list[PackExercise]:
    if not re.fullmatch(r"\d{1,3}(\.\d{1,2})?", name):
        raise BadArgument(
            f"{name!r} is neither a lecture (4), nor an exercise (4.2), nor a file (mine.py)"
        )
    number = int(name.partition(".")[0])
    varying = variants_of(lecture(number))
    if not varying:
        raise WorkbenchError(
            f"lecture {number} has no exercises with numbers that vary; write your own in a file, "
            "and name that"
        )
    if "." not in name:
        return varying
    named = [exercise for exercise in varying if exercise.number == name]
    if not named:
        numbers = ", ".join(exercise.number for exercise in varying)
        raise UnknownName("exercise with numbers that vary", name, hint=numbers)
    return named
