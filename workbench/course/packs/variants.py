"""Exercises with numbers that differ from student to student: what `variants.py` is made of."""

import ast
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from workbench.errors import BadArgument

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


@dataclass(frozen=True)
class Slip:
    """A wrong answer that students are likely to give to a variant.

    Attributes:
        exercise: the name of the exercise.
        hint: what is wrong with the answer.
        answer: the wrong function, which takes what the solution takes.
    """

    exercise: str
    hint: str
    answer: Callable[..., Any]


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


def slip(exercise: str, hint: str) -> Callable[[Callable[..., Any]], Slip]:
    """Make a wrong function a slip: its hint is given for the same answers."""
    return lambda answer: Slip(exercise, hint, answer)


def variants_in(module: ModuleType) -> tuple[Variant, ...]:
    """The variants of a module, in the order in which they are written."""
    return tuple(found for found in vars(module).values() if isinstance(found, Variant))


def slips_in(module: ModuleType) -> tuple[Slip, ...]:
    """The slips of a module, in the order in which they are written."""
    return tuple(found for found in vars(module).values() if isinstance(found, Slip))


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
