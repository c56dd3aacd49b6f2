"""Plain values, which the process of a student's file may send, and their form in JSON.

Numbers, text, arrays of numbers, and lists, tuples and dicts of these are sent as themselves, in
JSON. Any other value is described in words. `decode` trusts nothing: it checks all that it reads,
and makes numbers, text and collections of these only, so that nothing that is sent can run code
here.
"""

import base64
import binascii
from collections.abc import Callable
from typing import Any

import numpy as np

from workbench.course.checks import Described, Raised, described, outcome, raised

TYPES = {"b": "?", "i": "<i8", "u": "<f8", "f": "<f8", "c": "<c16"}  # by NumPy's kinds


class Malformed(ValueError):
    """A message that does not have the form that `encode` gives."""


def encode(value: Any) -> Any:
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
    if isinstance(value, dict):
        if not all(isinstance(key, str) for key in value):
            return _in_words(value)
        return {"dict": {str.__str__(key): encode(part) for key, part in value.items()}}
    if isinstance(value, list | tuple):
        name = "tuple" if isinstance(value, tuple) else "list"
        return {name: [encode(part) for part in value]}
    if not callable(value):
        try:  # large integers, fractions, CasADi's numbers, whatever has a float or an array in it
            return _array(np.asarray(value, dtype=float), value)
        except Exception:  # a type of the student's own may raise anything
            pass
    return _in_words(value)


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


def _in_words(value: Any) -> Any:
    return encode(described(value))


def decode(data: Any) -> Any:
    """The value that was encoded, or a Described for one of no plain type. Raises Malformed."""
    if isinstance(data, dict) and len(data) != 1:
        raise Malformed("this is not a plain value")
    match data:
        case None | bool() | float() | str():
            return data
        case int() if abs(data) < 2**63:
            return data
        case {"list": list() as parts}:
            return [decode(part) for part in parts]
        case {"tuple": list() as parts}:
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
    try:
        numbers = np.frombuffer(base64.b64decode(text, validate=True), TYPES[kind])
        if not all(type(n) is int and n >= 0 for n in shape):
            raise ValueError
        return numbers.reshape(shape).copy()
    except (binascii.Error, ValueError, OverflowError) as error:
        raise Malformed("these are not the numbers of an array") from error


def answered(answer: Callable[..., Any], arguments: tuple[Any, ...]) -> dict[str, Any]:
    """A function's answer: {"value": encoded}, or {"raised": [class, message, unsolved]}."""
    value = outcome(answer, arguments)
    if not isinstance(value, Raised):
        try:
            return {"value": encode(value)}
        except Exception as error:  # of a type of the student's own, when it is looked at
            value = raised(error)
    return {"raised": [value.kind, value.message, value.unsolved]}


def received(answer: object) -> Any:
    """The value that `answered` sent, or Raised. Raises Malformed for anything else."""
    match answer:
        case {"value": data}:
            return decode(data)
        case {"raised": [str() as error, str() as message, bool() as unsolved]}:
            return Raised(error, message, unsolved)
    raise Malformed("this is no answer")
