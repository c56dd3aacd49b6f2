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

    Attributes:
        exercise: the name of the lecture's exercise, which the function keeps.
        points: how many points it is worth.
        minutes: how long it takes; an estimate.
        draw: the numbers of one student, from a generator of random numbers.
        arguments: one random set of arguments, from a generator and the numbers.
        edges: sets of arguments at the ends of the range, which are worth one of the points.
        within: the largest relative error of an answer.
        solution: the right answer.
    """

    exercise: str
    points: int
    minutes: int
    draw: Callable[[np.random.Generator], Numbers]
    arguments: Callable[[np.random.Generator, Numbers], Arguments]
    edges: Callable[[Numbers], Sequence[Arguments]]
    within: float
    solution: Callable[..., Any]

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
        kinds = inspect.signature(self.solution).parameters.values()
        return [one.name for one in kinds if one.kind is not inspect.Parameter.KEYWORD_ONLY]

    @property
    def constants(self) -> list[str]:
        """The names of the student's own numbers."""
        kinds = inspect.signature(self.solution).parameters.values()
        return [one.name for one in kinds if one.kind is inspect.Parameter.KEYWORD_ONLY]

    @property
    def task(self) -> str:
        """What the student is asked to do, with shapes and units."""
        return inspect.getdoc(self.solution) or ""


def _none(numbers: Numbers) -> Sequence[Arguments]:
    return ()


def variant(
    exercise: str,
    *,
    points: int,
    minutes: int,
    draw: Callable[[np.random.Generator], Numbers],
    arguments: Callable[[np.random.Generator, Numbers], Arguments],
    edges: Callable[[Numbers], Sequence[Arguments]] = _none,
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


def variants_in(module: ModuleType) -> tuple[Variant, ...]:
    """The variants of a module, in the order in which they are written."""
    return tuple(found for found in vars(module).values() if isinstance(found, Variant))


def rounded(
    rng: np.random.Generator, low: float, high: float, count: int = 0, digits: int = 2
) -> Any:
    """A number from low to high with a few digits, or a list of `count` of them, for `draw`.

    Students read these numbers in their file, where they have to stand exactly. The last digit is
    never 0, so that another student's numbers can be recognised.
    """
    whole = np.round(rng.uniform(low, high, size=count or 1) * 10**digits).astype(int)
    drawn = [round(int(n + (n % 10 == 0)) / 10**digits, digits) for n in whole]
    return drawn if count else drawn[0]


FILE = "variants.py"


@dataclass(frozen=True)
class PackExercise:
    """An exercise of a pack.

    Attributes:
        number: as it is printed, such as `4.2`; for a file, its name and a number.
        sheet: the name of the student's file, without its ending.
        title: the title of the lecture or of the file.
        variant: the exercise.
        mistakes: wrong answers to it that are known.
        published: where a solution of the exercise in the lecture stands, or None.
    """

    number: str
    sheet: str
    title: str
    variant: Variant
    mistakes: tuple[Mistake, ...]
    published: Lecture | None


def chosen(what: Sequence[str]) -> list[PackExercise]:
    """The exercises that are named, in the order of their names; none is there twice.

    Raises BadArgument, BadFile, UnknownName.
    """
    found: dict[str, PackExercise] = {}
    for name in what:
        some = of_file(Path(name)) if name.endswith(".py") else _of_lecture(name)
        found |= {one.number: one for one in some}
    if not found:
        raise BadArgument("a pack needs exercises: numbers of lectures (4), or of exercises (4.2)")
    sheets: dict[str, str] = {}
    for one in found.values():
        if sheets.setdefault(one.sheet, one.title) != one.title:
            raise BadArgument(f"two files would be called {one.sheet}.py; rename {one.title}")
    _check_names(list(found.values()))
    return list(found.values())


def _check_names(some: list[PackExercise]) -> None:
    """Numbers stand in one file, so that no two exercises in it may use one name for them."""
    owners: dict[tuple[str, str], str] = {}
    for one in some:
        for name in one.variant.constants:
            other = owners.setdefault((one.sheet, name), one.number)
            if other != one.number:
                raise BadArgument(
                    f"{name} is a number of exercise {other} and of exercise {one.number}, which "
                    f"stand in one file, {one.sheet}.py; rename one of them"
                )


def variants_of(one: Lecture) -> list[PackExercise]:
    """All variants of a lecture, in the order of its exercises; none if it has no such file."""
    if not (one.folder / FILE).is_file():
        return []
    module = one.module("variants")
    places = {name: k for k, name in enumerate(one.exercises, 1)}
    return [
        PackExercise(
            f"{one.number}.{places[variant.exercise]}",
            one.folder_name,
            f"lecture {one.number}, {one.title}",
            variant,
            _mistakes(module, variant),
            one,
        )
        for variant in sorted(variants_in(module), key=lambda v: places[v.exercise])
    ]


def of_file(path: Path) -> list[PackExercise]:
    """All variants of a lecturer's own file. Raises BadFile."""
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
    found = variants_in(module)
    if not found:
        raise BadFile(
            f"{path} has no variants; write them with `workbench.course.packs.variant`, as "
            "lectures/lec04_skinning/variants.py does"
        )
    return [
        PackExercise(
            f"{path.stem}.{k}", path.stem, path.stem, variant, _mistakes(module, variant), None
        )
        for k, variant in enumerate(found, 1)
    ]


def _mistakes(module: ModuleType, variant: Variant) -> tuple[Mistake, ...]:
    return tuple(one for one in mistakes_in(module) if one.exercise == variant.exercise)


def _of_lecture(name: str) -> list[PackExercise]:
    if not re.fullmatch(r"\d{1,3}(\.\d{1,2})?", name):
        raise BadArgument(
            f"{name!r} is neither a lecture (4), nor an exercise (4.2), nor a file (mine.py)"
        )
    one = lecture(int(name.partition(".")[0]))
    some = variants_of(one)
    if not some:
        raise WorkbenchError(
            f"lecture {one.number} has no exercises with numbers that vary; write your own in a "
            "file, and name that"
        )
    if "." not in name:
        return some
    these = [found for found in some if found.number == name]
    if not these:
        there = ", ".join(found.number for found in some)
        raise UnknownName("exercise with numbers that vary", name, hint=there)
    return these
