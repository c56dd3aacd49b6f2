"""Answers: called with copies, put into the form that the solution's have, and compared."""

import copy
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.course.checks import Missed
from workbench.course.words import Described, cut, in_words, kind
from workbench.errors import Unsolved

NUMERIC = (bool, int, float, np.ndarray, np.number, np.bool_)
REAL = 1e-9  # what is left of an imaginary part by rounding, as a share of the real one


@dataclass(frozen=True)
class Raised:
    """What came instead of an answer: the class of an error, and what it said."""

    kind: str
    said: str
    unsolved: bool = False  # the exercise stands as it was handed out


def outcome(answer: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    """What a function answers, or Raised; it is given copies, and its warnings are not heard."""
    try:
        with unheard():
            return answer(*copied(arguments))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # also of those who leave by sys.exit
        return raised(error, answer)


@contextmanager
def unheard() -> Iterator[None]:
    """Warnings are not heard inside."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield


def raised(error: BaseException, answer: Callable[..., Any] | None = None) -> Raised:
    """What a function raised, told in the words of its error."""
    if isinstance(error, Unsolved):
        return Raised(type(error).__name__, str(error), unsolved=True)
    return Raised(type(error).__name__, said(error, answer))


def said(error: BaseException, answer: Callable[..., Any] | None = None, file: str = "") -> str:
    """What was raised, and in which line of the student's file."""
    if isinstance(error, SystemExit):
        told = f"it ends the program (sys.exit({error.code if error.code is not None else ''}))"
    else:
        told = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    code = getattr(answer, "__code__", None)
    file = file or (code.co_filename if code is not None else "")
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == file]
    if isinstance(error, SyntaxError) and error.lineno is not None and error.filename == file:
        lines, told = [error.lineno], f"{type(error).__name__}: {error.msg}"
    return cut(f"line {lines[-1]}: {told}" if lines and lines[-1] else told)


def copied(value: Any) -> Any:
    """Arrays anew, inside of tuples, lists and dicts too; anything else as it is."""
    if isinstance(value, np.ndarray):
        return value.copy()
    if isinstance(value, tuple | list):
        return type(value)(copied(part) for part in value)
    if isinstance(value, dict):
        return {key: copied(part) for key, part in value.items()}
    return copy.copy(value) if isinstance(value, set) else value


def formed(came: Any, model: Any, what: str) -> Any:
    """An answer in the form of the solution's: arrays of that shape, finite where that is.

    A list of the right numbers does for an array. The length of a list is free, that of a tuple
    is not. Raises Missed with what was expected and what came.
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
    except (TypeError, ValueError, OverflowError) as error:  # no numbers, or no array of them
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
    """Whether two answers are one: to a relative error, NaN like NaN, alike in what was raised."""
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
