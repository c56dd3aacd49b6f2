"""Plain values: what an answer's process may send, and the form in which it does.

Numbers, text, arrays of numbers, and lists, tuples and dicts of these are sent as themselves, in
JSON. Whatever else a function answers is described in words. `opened` believes nothing: it checks
all that it reads, and builds numbers, text and collections of these alone, so that nothing that is
sent can run code here.
"""

import base64
import binascii
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from workbench.course.words import Described, described

DEEPEST = 20  # lists within lists
LONGEST_LIST = 100_000  # entries; an array may have more
TYPES = {"b": np.dtype("?"), "i": np.dtype("<i8"), "f": np.dtype("<f8"), "c": np.dtype("<c16")}
AS = {"b": "b", "i": "i", "u": "f", "f": "f", "c": "c"}  # NumPy's kinds, and those above


class Malformed(ValueError):
    """What came is not in the form that `sealed` gives."""


def sealed(value: Any, depth: int = 0) -> Any:
    """A value as JSON can hold it."""
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
        except Exception:  # whatever a type of the student's own does when it is asked
            pass
    return _in_words(value)


def _parts(value: Any, depth: int) -> Any:
    """Of a list, tuple or dict."""
    if depth >= DEEPEST or len(value) > LONGEST_LIST:
        return _in_words(value, "too long, or too deep, to be graded")
    if isinstance(value, dict):
        if not all(isinstance(key, str) for key in value):
            return _in_words(value)
        return {"dict": {str.__str__(key): sealed(part, depth + 1) for key, part in value.items()}}
    parts = [sealed(part, depth + 1) for part in value]
    return {"tuple" if isinstance(value, tuple) else "list": parts}


def _array(array: np.ndarray, value: Any) -> Any:
    if array.dtype.kind not in AS:
        if array.dtype.kind != "O":
            return sealed(array.tolist()) if array.dtype.kind == "U" else _in_words(value)
        try:
            array = array.astype(float)
        except Exception:  # whatever a type of the student's own does when it is asked
            return _in_words(value)
    kind = AS[array.dtype.kind]
    data = base64.b64encode(array.astype(TYPES[kind]).tobytes()).decode("ascii")
    return {"array": [kind, list(array.shape), data]}


def _in_words(value: Any, words: str = "") -> Any:
    return sealed(described(value, words))


def opened(data: Any) -> Any:
    """The value that was sealed; a Described where it could not be. Raises Malformed."""
    match data:
        case None | bool() | float() | str():
            return data
        case int() if abs(data) < 2**63:
            return data
        case dict() if len(data) == 1:
            ((form, content),) = data.items()
            if isinstance(form, str) and form in FORMS:
                return FORMS[form](content)
    raise Malformed("this is no plain value")


def _opened_list(content: Any) -> list[Any]:
    if not isinstance(content, list) or len(content) > LONGEST_LIST:
        raise Malformed("this is no list, or too long a one")
    return [opened(part) for part in content]


def _opened_dict(content: Any) -> dict[str, Any]:
    if not isinstance(content, dict):
        raise Malformed("this is no dict")
    return {key: opened(part) for key, part in content.items()}


def _opened_complex(content: Any) -> complex:
    match content:
        case [float() as real, float() as imaginary]:
            return complex(real, imaginary)
    raise Malformed("this is no complex number")


def _opened_array(content: Any) -> np.ndarray:
    match content:
        case [str() as kind, list() as shape, str() as text] if kind in TYPES:
            pass
        case _:
            raise Malformed("this is no array")
    if len(shape) > DEEPEST or not all(type(n) is int and 0 <= n < 2**31 for n in shape):
        raise Malformed("this is no shape")
    try:
        numbers = np.frombuffer(base64.b64decode(text, validate=True), TYPES[kind])
    except (binascii.Error, ValueError) as error:  # no base64, no ASCII, no whole numbers of bytes
        raise Malformed("these are no numbers") from error
    if math.prod(shape) != len(numbers) or math.prod(max(n, 1) for n in shape) >= 2**31:
        raise Malformed("these are not as many numbers as the shape has")
    return numbers.reshape(shape).copy()


def _opened_description(content: Any) -> Described:
    match content:
        case [str() as kind, str() as words]:
            return Described(kind, words)
    raise Malformed("this is no description")


FORMS: dict[str, Callable[[Any], Any]] = {
    "list": _opened_list,
    "tuple": lambda content: tuple(_opened_list(content)),
    "dict": _opened_dict,
    "complex": _opened_complex,
    "array": _opened_array,
    "described": _opened_description,
}
