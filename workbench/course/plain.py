"""Plain values, which the process of a student's file may send, and their form in JSON.

Numbers, text, arrays of numbers, and lists, tuples and dicts of these are sent as themselves, in
JSON. Any other value is described in words. `decode` trusts nothing: it checks all that it reads,
and makes numbers, text and collections of these only, so that nothing that is sent can run code
here.
"""

import base64
import binascii
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from workbench.course.checks import Described, Raised, described, outcome, raised

DEEPEST = 20  # levels of lists within lists
LONGEST_LIST = 100_000  # entries; an array may have more
TYPES = {"b": "?", "i": "<i8", "u": "<f8", "f": "<f8", "c": "<c16"}  # by NumPy's kinds


class Malformed(ValueError):
    """A message that does not have the form that `encode` gives."""


def encode(value: Any, depth: int = 0) -> Any:
    """A value in the form in which JSON can hold it."""
    if value is None or isinstance(value, bool | np.bool_):
        return None if value is None else bool(value)
    if isinstance(value, Described):
        return {"described": [value.kind, value.words]}
    if isinstance(value, str):
        return str.__str__(value)
    if isinstance(value, np.ndarray):
        return _array(np.asarray(value), value)
    if isinstance(value, int | np.integer) and -(2**63) < int(value) < 2**63:
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value)
    if isinstance(value, complex | np.complexfloating):
        return {"complex": [float(value.real), float(value.imag)]}
    if isinstance(value, list | tuple | dict):
        return _parts(value, depth)
    if not callable(value):
        try:  # large integers, fractions, CasADi's numbers, whatever has a float or an array in it
            return _array(np.asarray(value, dtype=float), value)
        except Exception:  # a type of the student's own may raise anything
            pass
    return _in_words(value)


def _parts(value: Any, depth: int) -> Any:
    """The encoded form of a list, tuple or dict."""
    if depth >= DEEPEST or len(value) > LONGEST_LIST:
        return _in_words(value, "too long, or too deep, to be graded")
    if isinstance(value, dict):
        if not all(isinstance(key, str) for key in value):
            return _in_words(value)
        return {"dict": {str.__str__(key): encode(part, depth + 1) for key, part in value.items()}}
    parts = [encode(part, depth + 1) for part in value]
    return {"tuple" if isinstance(value, tuple) else "list": parts}


def _array(array: np.ndarray, value: Any) -> Any:
    if array.dtype.kind not in TYPES:
        if array.dtype.kind != "O":
            return encode(array.tolist()) if array.dtype.kind == "U" else _in_words(value)
        try:
            array = array.astype(float)
        except Exception:  # a type of the student's own may raise anything
            return _in_words(value)
    kind = array.dtype.kind
    data = base64.b64encode(array.astype(TYPES[kind]).tobytes()).decode("ascii")
    return {"array": [kind, list(array.shape), data]}


def _in_words(value: Any, words: str = "") -> Any:
    return encode(described(value, words))


def decode(data: Any) -> Any:
    """The value that was encoded, or a Described for one of no plain type. Raises Malformed."""
    if isinstance(data, dict) and len(data) != 1:
        raise Malformed("this is not a plain value")
    match data:
        case None | bool() | float() | str():
            return data
        case int() if abs(data) < 2**63:
            return data
        case {"list": list() as parts} if len(parts) <= LONGEST_LIST:
            return [decode(part) for part in parts]
        case {"tuple": list() as parts} if len(parts) <= LONGEST_LIST:
            return tuple(decode(part) for part in parts)
        case {"dict": dict() as parts}:
            return {key: decode(part) for key, part in parts.items()}
        case {"complex": [float() as real, float() as imaginary]}:
            return complex(real, imaginary)
        case {"array": [str() as kind, list() as shape, str() as text]} if kind in TYPES:
            return _decoded_array(kind, shape, text)
        case {"described": [str() as kind, str() as words]}:
            return Described(kind, words)
    raise Malformed("this is not a plain value")


def _decoded_array(kind: str, shape: list[Any], text: str) -> np.ndarray:
    if len(shape) > DEEPEST or not all(type(n) is int and 0 <= n < 2**31 for n in shape):
        raise Malformed("this is not a shape")
    try:
        numbers = np.frombuffer(base64.b64decode(text, validate=True), TYPES[kind])
    except (binascii.Error, ValueError) as error:  # no base64, no ASCII, no whole numbers of bytes
        raise Malformed("these are not numbers") from error
    if math.prod(shape) != len(numbers) or math.prod(max(n, 1) for n in shape) >= 2**31:
        raise Malformed("these are not as many numbers as the shape has")
    return numbers.reshape(shape).copy()


def answered(answer: Callable[..., Any], arguments: tuple[Any, ...]) -> dict[str, Any]:
    """A function's answer: {"value": encoded}, or {"raised": [class, message, unsolved]}."""
    found = outcome(answer, arguments)
    if not isinstance(found, Raised):
        try:
            return {"value": encode(found)}
        except Exception as error:  # of a type of the student's own, when it is looked at
            found = raised(error)
    return {"raised": [found.kind, found.message, found.unsolved]}


def received(answer: object) -> Any:
    """The value that `answered` sent, or Raised. Raises Malformed for anything else."""
    match answer:
        case {"value": data}:
            return decode(data)
        case {"raised": [str() as error, str() as message, bool() as unsolved]}:
            return Raised(error, message, unsolved)
    raise Malformed("this is no answer")
