"""Checks of exercises, known mistakes, and the two comparisons that checks are made of."""

from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench.course.words import in_words

Answer = Callable[..., Any]  # a student's function, or one of ours in its place


@dataclass(frozen=True)
class Check:
    """A test of an answer.

    Attributes:
        exercise: the function's name in exercises.py.
        points: how many points it is worth.
        name: what it expects of the answer, in a line.
        run: takes the function, and raises Missed.
    """

    exercise: str
    points: int
    name: str
    run: Callable[[Answer], None]


@dataclass(frozen=True)
class Mistake:
    """A wrong answer that students are likely to give.

    Attributes:
        exercise: the function's name in exercises.py.
        hint: what is wrong with the answer.
        answer: the wrong function.
    """

    exercise: str
    hint: str
    answer: Answer


class Missed(Exception):
    """An answer is not what a check expects.

    Attributes:
        what: the quantity or the property that was checked.
        expected: what was expected of it.
        came: what the answer was instead.
    """

    def __init__(self, what: str, expected: str = "", came: str = "") -> None:
        super().__init__(what)
        self.what, self.expected, self.came = what, expected, came


def check(exercise: str, points: int = 1) -> Callable[[Callable[[Answer], None]], Check]:
    """Make a function a check of an answer, named by the first line of its docstring."""

    def made(run: Callable[[Answer], None]) -> Check:
        return Check(exercise, points, (run.__doc__ or run.__name__).splitlines()[0], run)

    return made


def mistake(exercise: str, hint: str) -> Callable[[Answer], Mistake]:
    """Make a wrong function a known mistake; its hint is shown for the same answers."""
    return lambda answer: Mistake(exercise, hint, answer)


def checks_in(module: ModuleType) -> tuple[Check, ...]:
    """The checks of a module, in the order in which they are written."""
    return tuple(found for found in vars(module).values() if isinstance(found, Check))


def mistakes_in(module: ModuleType) -> tuple[Mistake, ...]:
    """The known mistakes of a module, in the order in which they are written."""
    return tuple(found for found in vars(module).values() if isinstance(found, Mistake))


def equal(came: ArrayLike, expected: ArrayLike, what: str, within: float = 1e-9) -> None:
    """Check that numbers agree: |came - expected| <= within max(1, |expected|), entry by entry.

    `what` is the quantity: `R'R for w = (0, 0, 1)`. Raises Missed.
    """
    a, b = np.asarray(came, dtype=float), np.asarray(expected, dtype=float)
    if a.shape != b.shape:
        raise Missed(what, f"an array of shape {b.shape}", f"an array of shape {a.shape}")
    off = np.abs(a - b) / np.maximum(1, np.abs(b))
    if (off <= within).all():
        return
    worst = np.unravel_index(np.argmax(np.where(np.isnan(off), np.inf, off)), b.shape)
    entry = f" at entry [{', '.join(map(str, worst))}]" if b.ndim else ""
    if b.size > 16:
        what += f",{entry}"
        a, b, entry = a[worst], b[worst], ""
    answer, wanted = in_words(a), in_words(b)
    if answer == wanted:  # they differ in digits that are not printed
        answer += f"\noff by up to {off[worst]:.1g}{entry}, allowed {within:.1g}"
    raise Missed(what, wanted, answer)


def holds(condition: object, what: str, expected: object = "", came: object = "") -> None:
    """Check that a property holds. `what` names it; `expected` and `came` explain a failure.

    Raises Missed.
    """
    if not condition:
        raise Missed(what, *(x if isinstance(x, str) else in_words(x) for x in (expected, came)))
