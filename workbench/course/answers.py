"""Answers of functions: asked for with copies of arguments, converted, and compared."""

import copy
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.course.checks import Missed
from workbench.course.words import Described, cut, in_words, kind
from workbench.errors import Unsolved, line_of

NUMERIC = (bool, int, float, np.ndarray, np.number, np.bool_)
REAL = 1e-9  # how large rounding leaves imaginary parts, as a share of real ones


@dataclass(frozen=True)
class Raised:
    """The error that a function raised instead of an answer.

    Attributes:
        kind: the class of the error.
        message: what it said, with the line of the student's file.
        unsolved: whether the exercise is as it was handed out.
    """

    kind: str
    message: str
    unsolved: bool = False


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


def formed(came: Any, model: Any, what: str) -> Any:
    """An answer in the form of the solution's `model`: arrays of its shape, finite where it is.

    A list of numbers may stand for an array. A list may have any length, a tuple that of the
    model. Raises Missed with what was expected and what came.
    """
    if came is None and model is not None:
        raise Missed(what, kind(model), "None: is a `return` missing?")
    if isinstance(model, NUMERIC):
        return _numbers(came, model, what)
    if isinstance(model, tuple | list):
        fits = isinstance(came, tuple | list) or (isinstance(came, np.ndarray) and came.ndim)
        if not fits or (isinstance(model, tuple) and len(came) != len(model)):
            raise Missed(what, kind(model), kind(came))
        models = (
            model if isinstance(model, tuple) else [model[0] if model else part for part in came]
        )
        return type(model)(
            formed(part, like, f"{what}[{i}]")
            for i, (part, like) in enumerate(zip(came, models, strict=True))
        )
    if isinstance(model, dict):
        if not isinstance(came, dict) or came.keys() != model.keys():
            names = sorted(map(str, came)) if isinstance(came, dict) else kind(came)
            raise Missed(what, f"a dict of {', '.join(sorted(map(str, model)))}", str(names))
        return {key: formed(came[key], model[key], f"{what}[{key!r}]") for key in model}
    if not isinstance(came, type(model)):
        raise Missed(what, kind(model), kind(came))
    return came


def _numbers(came: Any, model: Any, what: str) -> Any:
    wanted = np.asarray(model)
    try:
        if isinstance(came, str | dict | Described):
            raise TypeError
        found = np.asarray(came)
        if np.iscomplexobj(found):  # as roots of real matrices are: real but for rounding
            if np.abs(found.imag).max(initial=0) > REAL * max(1, np.abs(found.real).max(initial=0)):
                raise TypeError
            found = found.real
        found = np.asarray(found, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:  # not numbers, or not an array of them
        raise Missed(what, kind(wanted), f"{kind(came)}: {in_words(came)}") from error
    if wanted.ndim == 0 and found.size == 1:
        found = found.reshape(())
    if found.shape != wanted.shape:
        raise Missed(what, kind(wanted), kind(found))
    bad = ~np.isfinite(found) & np.isfinite(wanted.astype(float))
    if bad.any():
        where = "" if wanted.ndim == 0 else f" at {list(map(int, np.argwhere(bad)[0]))}"
        raise Missed(what, "finite numbers", f"{found[bad][0]}{where}")
    if wanted.ndim:
        return found
    if isinstance(model, bool | int | np.integer) and float(found).is_integer():
        return type(model)(found)
    return float(found)


def same(a: Any, b: Any, within: float) -> bool:
    """Whether two answers agree to a relative error; NaN agrees with NaN, and errors by class."""
    if isinstance(a, Raised) or isinstance(b, Raised):
        both = isinstance(a, Raised) and isinstance(b, Raised)
        return both and a.kind == b.kind
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key], within) for key in a)
    try:
        x, y = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    except Exception:  # no numbers: see above
        if isinstance(a, tuple | list) and isinstance(b, tuple | list):
            return len(a) == len(b) and all(
                same(one, other, within) for one, other in zip(a, b, strict=True)
            )
        return isinstance(a, str) and isinstance(b, str) and a == b
    if x.shape != y.shape:
        return False
    scale = np.abs(y[np.isfinite(y)]).max(initial=1e-3)
    return np.allclose(x, y, rtol=within, atol=within * scale, equal_nan=True)
