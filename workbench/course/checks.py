"""Checks of an exercise and its common mistakes: the form of an answer, comparison, words."""

import copy
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench.errors import Unsolved, line_of

Answer = Callable[..., Any]  # a student's function, or one of ours in its place


@dataclass(frozen=True)
class Check:
    """A test of an answer."""

    exercise: str  # the function's name in exercises.py
    points: int  # how many points it is worth
    name: str  # what it expects of the answer, in a line
    run: Callable[[Answer], None]  # takes the function, and raises Missed


@dataclass(frozen=True)
class Mistake:
    """A wrong answer that students are likely to give."""

    exercise: str  # the function's name in exercises.py
    hint: str  # what is wrong with the answer
    answer: Answer  # the wrong function


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

    def make(run: Callable[[Answer], None]) -> Check:
        return Check(exercise, points, (run.__doc__ or run.__name__).splitlines()[0], run)

    return make


def mistake(exercise: str, hint: str) -> Callable[[Answer], Mistake]:
    """Make a wrong function a known mistake; its hint is shown for the same answers."""
    return lambda answer: Mistake(exercise, hint, answer)


def checks_in(module: ModuleType) -> tuple[Check, ...]:
    """The checks of a module, in the order in which they are written."""
    return tuple(value for value in vars(module).values() if isinstance(value, Check))


def mistakes_in(module: ModuleType) -> tuple[Mistake, ...]:
    """The known mistakes of a module, in the order in which they are written."""
    return tuple(value for value in vars(module).values() if isinstance(value, Mistake))


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


NUMERIC = (bool, int, float, np.ndarray, np.number, np.bool_)
IMAGINARY_ROUNDING = 1e-9  # how large rounding leaves imaginary parts, as a share of real ones


@dataclass(frozen=True)
class Raised:
    """The error that a function raised instead of an answer."""

    kind: str  # the class of the error
    message: str  # what it said, with the line of the student's file
    unsolved: bool = False  # whether the exercise is as it was handed out


def outcome(answer: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    """A function's answer to copies of arguments, or Raised; its warnings are ignored."""
    try:
        with without_warnings():
            return answer(*copied(arguments))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # SystemExit, too
        return raised(error, answer)


@contextmanager
def without_warnings() -> Iterator[None]:
    """Ignore all warnings inside of the context."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield


def raised(error: BaseException, answer: Callable[..., Any] | None = None) -> Raised:
    """An error that a function raised, as a value."""
    if isinstance(error, Unsolved):
        return Raised(type(error).__name__, str(error), unsolved=True)
    return Raised(type(error).__name__, error_in_words(error, answer))


def error_in_words(
    error: BaseException, answer: Callable[..., Any] | None = None, file: str = ""
) -> str:
    """What was raised, and in which line of the student's file, in a sentence."""
    code = getattr(answer, "__code__", None)
    line = line_of(error, file or (code.co_filename if code is not None else ""))
    message = str(error)
    if isinstance(error, SyntaxError) and line is not None and line == error.lineno:
        message = error.msg
    text = f"{type(error).__name__}: {message}" if message else type(error).__name__
    if isinstance(error, SystemExit):
        text = f"it ends the program (sys.exit({error.code if error.code is not None else ''}))"
    return cut(f"line {line}: {text}" if line else text)


def copied(value: Any) -> Any:
    """A copy of arrays, also inside of tuples, lists and dicts; anything else as it is."""
    if isinstance(value, np.ndarray):
        return value.copy()
    if isinstance(value, tuple | list):
        return type(value)(copied(part) for part in value)
    if isinstance(value, dict):
        return {key: copied(part) for key, part in value.items()}
    return copy.copy(value) if isinstance(value, set) else value


def formed(answer: Any, model: Any, what: str) -> Any:
    """An answer in the form of the solution's `model`: arrays of its shape, finite where it is.

    A list of numbers may stand for an array. A list may have any length, a tuple that of the
    model. Raises Missed with what was expected and what came.
    """
    if answer is None and model is not None:
        raise Missed(what, kind(model), "None: is a `return` missing?")
    if isinstance(model, NUMERIC):
        return _numbers(answer, model, what)
    if isinstance(model, tuple | list):
        fits = isinstance(answer, tuple | list) or (isinstance(answer, np.ndarray) and answer.ndim)
        if not fits or (isinstance(model, tuple) and len(answer) != len(model)):
            raise Missed(what, kind(model), kind(answer))
        models = (
            model if isinstance(model, tuple) else [model[0] if model else part for part in answer]
        )
        return type(model)(
            formed(part, like, f"{what}[{i}]")
            for i, (part, like) in enumerate(zip(answer, models, strict=True))
        )
    if isinstance(model, dict):
        if not isinstance(answer, dict) or answer.keys() != model.keys():
            names = sorted(map(str, answer)) if isinstance(answer, dict) else kind(answer)
            raise Missed(what, f"a dict of {', '.join(sorted(map(str, model)))}", str(names))
        return {key: formed(answer[key], model[key], f"{what}[{key!r}]") for key in model}
    if not isinstance(answer, type(model)):
        raise Missed(what, kind(model), kind(answer))
    return answer


def _numbers(answer: Any, model: Any, what: str) -> Any:
    expected = np.asarray(model)
    try:
        if isinstance(answer, str | dict | Described):
            raise TypeError
        numbers = np.asarray(answer)
        if np.iscomplexobj(numbers):  # as roots of real matrices are: real but for rounding
            if np.abs(numbers.imag).max(initial=0) > IMAGINARY_ROUNDING * max(
                1, np.abs(numbers.real).max(initial=0)
            ):
                raise TypeError
            numbers = numbers.real
        numbers = np.asarray(numbers, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:  # not numbers, or not an array of them
        raise Missed(what, kind(expected), f"{kind(answer)}: {in_words(answer)}") from error
    if expected.ndim == 0 and numbers.size == 1:
        numbers = numbers.reshape(())
    if numbers.shape != expected.shape:
        raise Missed(what, kind(expected), kind(numbers))
    bad = ~np.isfinite(numbers) & np.isfinite(expected.astype(float))
    if bad.any():
        where = "" if expected.ndim == 0 else f" at {list(map(int, np.argwhere(bad)[0]))}"
        raise Missed(what, "finite numbers", f"{numbers[bad][0]}{where}")
    if expected.ndim:
        return numbers
    if isinstance(model, bool | int | np.integer) and float(numbers).is_integer():
        return type(model)(numbers)
    return float(numbers)


def same(a: Any, b: Any, within: float) -> bool:
    """Whether two answers agree to a relative error; NaN agrees with NaN, and errors by class."""
    if isinstance(a, Raised) or isinstance(b, Raised):
        both = isinstance(a, Raised) and isinstance(b, Raised)
        return both and a.kind == b.kind
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key], within) for key in a)
    try:
        left, right = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    except Exception:  # no numbers: see above
        if isinstance(a, tuple | list) and isinstance(b, tuple | list):
            return len(a) == len(b) and all(same(x, y, within) for x, y in zip(a, b, strict=True))
        return isinstance(a, str) and isinstance(b, str) and a == b
    if left.shape != right.shape:
        return False
    scale = np.abs(right[np.isfinite(right)]).max(initial=1e-3)
    return np.allclose(left, right, rtol=within, atol=within * scale, equal_nan=True)


LONGEST_VALUE = 300  # characters of a value
LONGEST_TEXT = 1000  # characters of any other text from the process of a student's file


@dataclass(frozen=True)
class Described:
    """Stands for a value that is no number, array, text, list, tuple or dict of these."""

    kind: str  # what the value is, such as `a set`
    words: str  # the value in words

    def __repr__(self) -> str:
        return f"<{self.kind}: {self.words}>"


def described(value: Any) -> Described:
    """A value that cannot be sent, in words; for a function they say that it has to be called."""
    return Described(kind(value), "call it" if callable(value) else in_words(value))


def in_words(value: Any) -> str:
    """Numbers to six digits; anything else as its repr, or as its type if that raises an error."""
    if isinstance(value, Described):
        return value.words
    if isinstance(value, bool | np.bool_ | str):
        return cut(repr(value) if isinstance(value, str) else str(bool(value)))
    try:
        array = np.asarray(value)
        if array.dtype.kind != "c":
            array = np.asarray(array, dtype=float)
    except Exception:  # a type of the student's own may raise anything
        with suppress(Exception):
            return cut(repr(value))
        return kind(value)
    if array.ndim == 0:
        return f"{array:.6g}"
    return cut(np.array2string(array, precision=6, suppress_small=True, threshold=40))


def kind(value: Any) -> str:
    """What a value is: `an array of shape (3, 3)`, `a str`."""
    if isinstance(value, Described):
        return value.kind
    if value is None:
        return "None"
    shape = np.shape(value) if isinstance(value, np.ndarray) else None
    if shape is not None:
        return f"an array of shape {shape}" if shape else "a number"
    if isinstance(value, bool | int | float | np.number):
        return "a number"
    if isinstance(value, list | tuple | dict):
        return f"a {type(value).__name__} of length {len(value)}"
    if hasattr(value, "is_symbolic"):
        return f"a CasADi {type(value).__name__} of shape {value.shape}"
    return f"a {type(value).__name__}"


def cut(text: str, longest: int = LONGEST_VALUE) -> str:
    """The text, or the beginning of one that is too long."""
    return text if len(text) <= longest else text[:longest] + " ..."


def legible(text: str) -> str:
    """A foreign text in a form that may be printed: cut, with control characters spelled out.

    A terminal obeys control characters: with a few of them a text could clear the screen and
    print results of its own.
    """
    return "".join(
        c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode("ascii")
        for c in cut(text, LONGEST_TEXT)
    )
